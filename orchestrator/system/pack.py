"""Packs a system of `specs/systems` and its FMUs into one `.ssp`, the same bytes for the same content."""

import os
import zipfile
from collections.abc import Mapping
from pathlib import Path

from fmus.toolchain.build import BUILD, build_fmu
from fmus.toolchain.loader import load_model, model_folders
from specs import systems
from specs.errors import InputError, nearest
from specs.ssd import FmiVersion, render, stem

SYSTEMS = BUILD / "systems"
SSD_NAME = "SystemStructure.ssd"
EPOCH = (2020, 1, 1, 0, 0, 0)  # of every entry


def pack_system(
    name: str,
    fmi_version: FmiVersion = 2,
    out: Path = SYSTEMS,
    models: Mapping[str, Path] | None = None,
    opened: Mapping[str, Mapping[str, str]] | None = None,
) -> Path:
    """Build the FMUs of the system `name`, pack it and return the path, e.g. build/systems/nominal-fmi3.ssp.

    `models` replaces model folders by the name the system knows them by, with other folders or with FMUs; a
    model there gets the signals that the system offers in its place and that it has as inputs.
    Raises InputError for an unknown system or a component without a model folder.
    """
    spec = systems.load(name)
    known = model_folders() | dict(models or {})
    for component in spec.components:
        if component.fmu in (models or {}) and known[component.fmu].suffix != ".fmu":
            inputs = {v.name for v in load_model(known[component.fmu]).inputs}
            spec = spec.fitted(component.name, inputs)
    for component_name, inputs in (opened or {}).items():
        spec = spec.opened(component_name, inputs)
    resources: dict[str, Path] = {}
    for component in spec.components:
        if component.fmu not in known:
            raise InputError(
                f"system {name}: component {component.name} needs the model '{component.fmu}'; "
                f"{nearest(component.fmu, known)}"
            )
        model = known[component.fmu]
        resources[f"{component.fmu}.fmu"] = model if model.suffix == ".fmu" else build_fmu(model, fmi_version)
    return pack(render(spec, fmi_version), resources, out / f"{stem(name, fmi_version)}.ssp")


def pack(ssd: str, resources: Mapping[str, Path], path: Path) -> Path:
    """Write an SSP from the text of an SSD and the files of its `resources/`; replaces `path` at once."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")  # another process may pack the same
    with zipfile.ZipFile(part, "w") as archive:
        _add(archive, SSD_NAME, ssd.encode(), zipfile.ZIP_DEFLATED)
        for name in sorted(resources):  # FMUs are compressed already
            _add(archive, f"resources/{name}", resources[name].read_bytes(), zipfile.ZIP_STORED)
    part.replace(path)
    return path


def _add(archive: zipfile.ZipFile, name: str, content: bytes, compression: int) -> None:
    entry = zipfile.ZipInfo(name, EPOCH)
    entry.compress_type, entry.create_system, entry.external_attr = compression, 3, 0o644 << 16
    archive.writestr(entry, content)
