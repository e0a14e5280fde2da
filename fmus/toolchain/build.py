"""Builds FMUs from model folders: generate C, compile for each target, pack; cached by content.

build/fmus/fmi2/NAME.fmu and build/fmus/fmi3/NAME.fmu are the results.  Two keys spare work: a quick one
over the sources (nothing at all to do) and the model's token over the generated code (compile nothing).
"""

import hashlib
import html
import json
import os
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from markdown_it import MarkdownIt

from fmus.definition import Model
from fmus.paths import BUILD, BUILT_HERE, ROOT, SHIM, built_here
from fmus.toolchain import codegen, compiler, description, reference, terminals
from fmus.toolchain.loader import load_model, model_folders
from specs.errors import InputError

FMI_VERSIONS = (2, 3)
SHIM_FILES = ("core.h", "core.c", "integrator.c", "slw_math.h")
HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
EPOCH = (2020, 1, 1, 0, 0, 0)  # of every file in an archive: same content, same bytes


def build_fmu(
    folder: Path | str, fmi_version: int = 2, targets: Sequence[str] | None = None, out: Path | None = None
) -> Path:
    """Build the model in `folder` (a path or a project model's name) and return the path of its FMU.

    `targets` are platform names of fmus.toolchain.compiler.TARGETS (default: this machine, and those
    it was built for before if nothing has changed since); `out` is the directory
    for the FMU.  Raises InputError for an unknown model, FMI version or target, RunError if C fails.
    """
    if fmi_version not in FMI_VERSIONS:
        raise InputError(f"no FMI version '{fmi_version}'; valid: 2, 3")
    known = model_folders()
    path = known.get(str(folder), Path(folder))
    result = (out or BUILD / "fmus" / f"fmi{fmi_version}") / f"{path.name}.fmu"
    stamp = result.with_suffix(".json")
    stamped = json.loads(stamp.read_text()) if stamp.is_file() else {}
    names = [compiler.target(t).name for t in (targets or [compiler.host().name])]
    if not targets and compiler.host().name in stamped.get("targets", []):
        names = stamped["targets"]  # using an FMU does not drop the other platforms' binaries
    quick = _quick_key(path, names)
    if (
        stamped.get("quick") == quick
        and result.is_file()
        and stamped["sha256"] == _sha256(result.read_bytes())
        and built_here(stamped["sha256"])
    ):
        return result
    if not targets:
        names = [compiler.host().name]
        quick = _quick_key(path, names)
    model = load_model(path)
    codegen.check_no_feedthrough(model)
    archive = _archive(model, path, fmi_version, names)
    write_whole(result, archive)
    mark_built(archive)
    write_whole(stamp, json.dumps({"quick": quick, "targets": names, "sha256": _sha256(archive)}).encode())
    return result


def build_all(
    targets: Sequence[str] | None = None, progress: Callable[[str], None] | None = None
) -> list[dict[str, object]]:
    """Build every model of the project for both FMI versions.

    Returns one entry an FMU: {"model", "fmi", "targets", "path", "sha256"}.
    """
    names = list(targets or [compiler.host().name])
    results: list[dict[str, object]] = []
    for name in model_folders():
        for version in FMI_VERSIONS:
            if progress:
                progress(f"{name} (FMI {version})")
            path = build_fmu(name, version, names)
            digest = _sha256(path.read_bytes())
            results.append(
                {"model": name, "fmi": version, "targets": names, "path": str(path), "sha256": digest}
            )
    return results


def generate_sources(model: Model, directory: Path) -> str:
    """Write shim and generated C files of `model` into `directory`; return the model's token."""
    code = codegen.model_c(model)
    shim = "".join((SHIM / n).read_text() for n in (*SHIM_FILES, "fmi2.c", "fmi3.c"))
    token = codegen.token(model, code, shim)
    (directory / "fmi").mkdir(parents=True, exist_ok=True)
    for name in (*SHIM_FILES, "fmi2.c", "fmi3.c"):
        (directory / name).write_bytes((SHIM / name).read_bytes())
    for name in (*HEADERS[2], *HEADERS[3]):
        (directory / "fmi" / name).write_bytes((SHIM / "fmi" / name).read_bytes())
    (directory / "model.c").write_text(code)
    (directory / "model_config.h").write_text(codegen.model_config_h(model, token))
    return token


def compile_library(model: Model, sources: Path, fmi_version: int, target: str) -> bytes:
    """The shared library of an FMU for one target; objects are cached by the model's token."""
    config = (sources / "model_config.h").read_bytes()
    key = _sha256(config + repr((fmi_version, compiler.identity(target), target, compiler.FLAGS)).encode())
    cached = BUILD / "cache" / key[:2] / key
    if not cached.is_file():
        with tempfile.TemporaryDirectory() as scratch:
            objects = [
                (compile_generated if name == "model.c" else compiler.compile_object)(
                    sources / name, Path(scratch) / f"{name}.o", target
                )
                for name in (*description.SOURCES, f"fmi{fmi_version}.c")
            ]
            library = Path(scratch) / (model.name + compiler.target(target).suffix)
            libm = ["-lm"] if codegen.needs_libm((sources / "model.c").read_text()) else []
            made = compiler.link_shared(objects, library, target, libraries=libm)
            write_whole(cached, made.read_bytes())
    return cached.read_bytes()


def compile_generated(source: Path, out: Path, target: str, extra: Sequence[str] = ()) -> Path:
    """Compile CasADi's code to `out`, which takes seconds, or take it from the cache.

    The code and the headers beside it say what comes out, whichever FMU or bundle it goes into.
    """
    content = b"".join(path.read_bytes() for path in (source, *sorted(source.parent.glob("*.h"))))
    about = (compiler.identity(target), target, compiler.FLAGS, *extra)
    key = _sha256(content + repr(about).encode())
    cached = BUILD / "cache" / key[:2] / key
    if not cached.is_file():
        write_whole(cached, compiler.compile_object(source, out, target, extra, generated=True).read_bytes())
    out.write_bytes(cached.read_bytes())
    return out


def _archive(model: Model, folder: Path, fmi_version: int, targets: Iterable[str]) -> bytes:
    with tempfile.TemporaryDirectory() as scratch:
        sources = Path(scratch) / "sources"
        token = generate_sources(model, sources)
        files: dict[str, bytes] = {"modelDescription.xml": description.description(model, fmi_version, token)}
        for name in targets:
            target = compiler.target(name)
            folder_name = target.fmi2_folder if fmi_version == 2 else target.name
            library = compile_library(model, sources, fmi_version, name)
            files[f"binaries/{folder_name}/{model.name}{target.suffix}"] = library
        for name in (*SHIM_FILES, "model.c", "model_config.h", f"fmi{fmi_version}.c"):
            files["sources/" + name] = (sources / name).read_bytes()
        for name in HEADERS[fmi_version]:
            files["sources/fmi/" + name] = (sources / "fmi" / name).read_bytes()
        files |= reference.files(model, compile_library(model, sources, 2, compiler.host().name), token)
    if fmi_version == 3:
        files["sources/buildDescription.xml"] = description.build_description(model)
    files |= terminals.files(model)
    files["documentation/index.html"] = _documentation(model, folder)
    files["documentation/licenses/license.txt"] = b"Apache License, Version 2.0 (SPDX: Apache-2.0)\n"
    return pack(files)


def mark_built(archive: bytes) -> None:
    """Note that the FMU of this content was made here: its machine code is our own."""
    write_whole(BUILT_HERE / _sha256(archive), b"")


def pack(files: dict[str, bytes]) -> bytes:
    """A zip archive with the same bytes for the same content."""
    with tempfile.TemporaryFile() as stream:
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in sorted(files):
                entry = zipfile.ZipInfo(name, EPOCH)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, files[name])
        stream.seek(0)
        return stream.read()


def _documentation(model: Model, folder: Path) -> bytes:
    readme = folder / "README.md"
    text = readme.read_text() if readme.is_file() else model.description
    title = html.escape(model.name)
    style = "body{font:16px/1.5 sans-serif;max-width:50em;margin:2em auto;padding:0 1em}"
    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    page = (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title><style>{style}</style>'
    )
    return (page + markdown.render(text) + "</html>\n").encode()


def _quick_key(folder: Path, targets: Sequence[str]) -> str:
    """Hash of everything an FMU can depend on, without generating anything."""
    sources = {p for base in (ROOT / "fmus", ROOT / "specs", folder) for p in _inputs(base)}
    digest = hashlib.sha256(repr((sorted(targets), [compiler.identity(t) for t in targets])).encode())
    for path in sorted(sources):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def _inputs(base: Path) -> Iterator[Path]:
    """Files below `base` that an FMU may depend on; what the folders above are called does not matter."""
    skipped = {"__pycache__", "generated", "scenarios", "systems"}
    for path in base.rglob("*"):
        wanted = path.suffix in (".py", ".c", ".h", ".toml", ".md", ".npz")
        if wanted and not skipped & set(path.relative_to(base).parts) and path.is_file():
            yield path


def write_whole(path: Path, content: bytes) -> None:
    """Write by rename, so that a reader never sees half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")  # another process may write the same
    part.write_bytes(content)
    part.replace(path)


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
