"""`slewright bundle`: builds the folder that a runtime loads; what it holds is read by `runtime.bundle`.

manifest.json        controller, versions, platforms, SHA-256 of every other file
core-PLATFORM.so     the control core, compiled
guard-scene.json     what the guard keeps off, where there is one
parameters.json      every parameter that was compiled in: value, unit, source
sources/             the C code it was compiled from: core/, blocks/NAME/
"""

import dataclasses
import json
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from baselines import registry
from baselines.load.balance import unknowns
from baselines.load.calibration_file import read
from baselines.load.online import model as load_estimate
from baselines.registry import Controller
from deployment.bundling import commissioned, config, guard as guarding, policy
from deployment.bundling.blocks import COMPILED, CORE, Block, External, Outside
from deployment.bundling.content import Content
from fmus.definition import Model
from fmus.paths import BUILD, SHIM
from fmus.toolchain import compiler
from fmus.toolchain.build import compile_generated
from fmus.toolchain.loader import load_model
from runtime import bundle as form, image
from specs import parameters, scene_text
from specs.errors import InputError
from specs.scene import Scene
from specs.version import VERSION

ARM = "arm_velocity"
HAND_WRITTEN = (
    *("slr.h", "gate.h", "guard.h", "block.h", "wire.h", "canopen.h"),
    *("scan.h", "bus.h", "exchange.h", "memory.h", "seats.h", "page.h"),
    *("image_layout.h", "wire_layout.h", "canopen_layout.h", "scan_layout.h"),
    *("gate.c", "guard.c", "check.c", "mode.c", "step.c", "explain.c", "wire.c", "canopen.c"),
    *("scan.c", "bus.c", "exchange.c", "memory.c", "seats.c", "page.c"),
)
IN_ITS_PLACE: dict[type, tuple[str, ...]] = {External: ("external.c",), Outside: ("outside.c",)}
BAKED_IN = ("geometry", "slew", "machine", "load_estimate")  # files whose figures are constants of the C code
UNCHECKED = ("geometry.c", "model.c")  # CasADi's own code
UNUSED_OUT = ["-ffunction-sections", "-fdata-sections"]
UNUSED_GONE = {
    "linux": ["-Wl,--gc-sections"],
    "darwin": ["-Wl,-dead_strip"],
    "windows": ["-Wl,--gc-sections"],
}


def bundle(
    controller: str,
    out: Path,
    platforms: Sequence[str] = (),
    changes: Mapping[str, float] | None = None,
    engine: str = form.NATIVE,
    calibration: Path | None = None,
    commissioning: Path | None = None,
    files: Mapping[str, bytes] | None = None,
    guard: Scene | None = None,
) -> form.Bundle:
    """Build the bundle of a controller of `baselines.registry`, a policy's ONNX file, or "outside", in `out`.

    What was in `out` before is replaced.  `platforms` are names of fmus.toolchain.compiler.TARGETS (default:
    this machine); `changes` are parameters of specs/parameters/gate.toml; `engine` says how a policy is
    evaluated: "native" C or "onnxruntime"; `calibration` is a file of `slewright estimate calibrate`,
    `commissioning` the calibration.json of `slewright commission`, whose tare a `calibration` replaces;
    `files` lie beside the core; `guard` is the scene that the guard keeps off (none: there is no guard).
    "outside" is a policy in a node outside (docs/how-to/ros2.md).
    Raises InputError for an unknown controller, platform, parameter or engine, a controller that no core can
    run, or a folder that holds something else; RunError if C fails.
    """
    content = _content(controller, engine)
    content = dataclasses.replace(content, files={**content.files, **(files or {})})
    if commissioning is not None:
        found = commissioned.read(commissioning)
        calibration = calibration or found.load_calibration
        content = dataclasses.replace(
            content, zeros=found.zeros, arm=found.arm, files={**content.files, **found.files}
        )
    if calibration is not None:
        content = _calibrated(content, calibration)
    if guard is not None:
        kept = {**content.files, form.GUARD_SCENE: _json(scene_text.plain(guard))}
        content = dataclasses.replace(content, guard=guarding.zones(guard), files=kept)
    return assemble(content, out, platforms, changes)


def bundle_model(
    model: Model,
    name: str,
    out: Path,
    platforms: Sequence[str] = (),
    changes: Mapping[str, float] | None = None,
) -> form.Bundle:
    """The same for any discrete model with a controller's signals, under the name `name`."""
    return assemble(Content(name, Block(model, "controller")), out, platforms, changes)


def assemble(
    content: Content, out: Path, platforms: Sequence[str] = (), changes: Mapping[str, float] | None = None
) -> form.Bundle:
    """Write, compile and hash; `out` is replaced only when all of it is there."""
    targets = [compiler.target(n).name for n in platforms or [compiler.host().name]]
    zeros = {f"zero_{name}": value for name, value in content.zeros.items()}
    known = dict(changes or {})
    bounds = {name: known.pop(name) for name in guarding.names() & known.keys()}
    constants = {**config.constants(known), **guarding.constants(bounds), **zeros}
    _check_folder(out)
    part = out.with_name(f"{out.name}.{os.getpid()}.part")
    try:
        blocks = write_sources(
            content.controller,
            part / "sources",
            constants,
            content.calibration,
            content.zeros,
            content.arm,
            content.guard,
        )
        identity = sources_hash(part / "sources")
        for target in targets:
            suffix = compiler.target(target).suffix
            compile_core(part / "sources", identity, part / f"core-{target}{suffix}", target)
        for name, data in content.files.items():
            (part / name).write_bytes(data)
        (part / form.PARAMETERS).write_bytes(_parameters(blocks, constants))
        (part / form.MANIFEST).write_bytes(_json(_manifest(part, content, identity, targets)))
        shutil.rmtree(out, ignore_errors=True)
        part.replace(out)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return form.load(out)


def write_sources(
    controller: Block | External | Outside,
    folder: Path,
    constants: Mapping[str, float],
    calibration: Mapping[str, float] | None = None,
    zeros: Mapping[str, float] | None = None,
    tables: Mapping[str, float] | None = None,
    guard: guarding.Zones | None = None,
) -> list[Block]:
    """Write core and blocks; the blocks."""
    arm = Block(commissioned.with_tables(load_model(ARM), tables or {}), ARM)
    estimator = Block(load_estimate(calibration), "load")
    core = folder / "core"
    core.mkdir(parents=True, exist_ok=True)
    for name in (*HAND_WRITTEN, *IN_ITS_PLACE.get(type(controller), ())):
        (core / name).write_bytes((CORE / name).read_bytes())
    (core / "slw_math.h").write_bytes((SHIM / "slw_math.h").read_bytes())
    (core / "core_config.h").write_text(config.config_h(constants, controller))
    (core / "core_config.c").write_text(
        config.config_c(controller, arm, estimator, constants, zeros or {}, guard is not None)
    )
    (core / "guard_config.c").write_text(guarding.guard_c(guard, constants))
    (core / "geometry.c").write_text(config.geometry_c())
    blocks = [controller, arm, estimator] if isinstance(controller, Block) else [arm, estimator]
    for block in blocks:
        block.write(folder / "blocks" / block.name)
    digest = form.digest(_parameters(blocks, constants))
    (core / "parameters.c").write_text(config.parameters_c(digest))
    return blocks


def compile_core(sources: Path, identity: str, out: Path, target: str) -> Path:
    """Compile and link one platform's library.

    What was compiled before from the same sources by the same compiler is taken from a cache.
    """
    cached = Cached(repr((identity, compiler.identity(target), target)))
    if not cached.path.is_file():
        with tempfile.TemporaryDirectory() as scratch:
            cached.put(link(sources, identity, Path(scratch), target))
    return Path(shutil.copy(cached.path, out))


class Cached:
    """A compiled library in the build folder, by all that it depends on."""

    def __init__(self, key: str) -> None:
        digest = form.digest(key.encode())
        self.path = BUILD / "cores" / digest[:2] / digest

    def put(self, library: Path) -> Path:
        """Keep `library`; another process may do the same."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        part = self.path.with_name(f"{self.path.name}.{os.getpid()}.part")
        shutil.copy(library, part)
        return part.replace(self.path)


def link(sources: Path, identity: str, folder: Path, target: str, extra: Sequence[str] = ()) -> Path:
    """Compile into object files in `folder`, and link them there; `extra`: further flags (sanitizers)."""
    objects = objects_of(sources, identity, folder, target, extra)
    gone = UNUSED_GONE[target.partition("-")[2]]
    return compiler.link_shared(objects, folder / "core.so", target, [*extra, *gone])


def objects_of(
    sources: Path, identity: str, folder: Path, target: str, extra: Sequence[str] = ()
) -> list[Path]:
    """Compile every source into `folder`; hand-written C without any warning."""
    flags = [*UNUSED_OUT, *extra, f'-DSLR_IDENTITY="{identity}"']
    include = ["-I", str(sources / "core")]
    objects = [
        compiler.compile_object(
            path, folder / f"{path.stem}.o", target, [*flags, *include], path.name in UNCHECKED
        )
        for path in sorted((sources / "core").glob("*.c"))
    ]
    for own in sorted((sources / "blocks").iterdir()):
        more = [*flags, "-I", str(own), *include]
        for name in COMPILED:
            out = folder / f"{own.name}_{name}.o"
            if name == "model.c" and not extra:
                objects.append(compile_generated(own / name, out, target, UNUSED_OUT))
            else:
                objects.append(compiler.compile_object(own / name, out, target, more, name in UNCHECKED))
    return objects


def identity_of(controller: str) -> str:
    """The identity that a bundle of a controller would have if it were built now."""
    with tempfile.TemporaryDirectory() as scratch:
        write_sources(
            _content(controller, form.NATIVE).controller,
            Path(scratch),
            {**config.constants({}), **guarding.constants({})},
        )
        return sources_hash(Path(scratch))


def sources_hash(folder: Path) -> str:
    """SHA-256 over all sources and the compiler's flags: what a compiled core says it is."""
    files = form.hashes(folder)
    return form.digest(repr((compiler.FLAGS, sorted(files.items()))).encode())


def _content(controller: str, engine: str) -> Content:
    if engine not in form.ENGINES:
        raise InputError(f"no engine '{engine}'; valid: {', '.join(form.ENGINES)}")
    if controller == form.OUTSIDE:
        if engine not in (form.NATIVE, form.OUTSIDE):
            raise InputError(f"controller {controller} is evaluated outside: no --engine {engine}")
        return Content(controller, Outside(), form.OUTSIDE)
    if engine == form.OUTSIDE:
        raise InputError(f"engine {engine} is that of the controller {form.OUTSIDE} only")
    if controller.endswith(".onnx"):
        return policy.content(Path(controller), engine)
    found = registry.find(controller, (form.OUTSIDE,))
    if engine != form.NATIVE:
        raise InputError(f"controller {controller} is no policy: its engine is {form.NATIVE}")
    return Content(controller, Block(settled(found), "controller"))


def _calibrated(content: Content, path: Path) -> Content:
    """The same with the load estimate of a calibrated machine."""
    found = dict(zip((u.name for u in unknowns()), read(path).values.tolist(), strict=True))
    files = {**content.files, "load-calibration.json": path.read_bytes()}
    return dataclasses.replace(content, files=files, calibration=found)


def settled(controller: Controller) -> Model:
    """A controller's model with its settings as its parameters' values."""
    model = load_model(controller.folder)
    for name in controller.settings:
        model.index("parameters", name)
    values = {v.name: controller.settings.get(v.name, v.start) for v in model.parameters}
    changed = tuple(dataclasses.replace(v, start=values[v.name]) for v in model.parameters)
    return dataclasses.replace(model, parameters=changed)


def _check_folder(out: Path) -> None:
    """InputError for a path that is a file, or a folder with anything but a bundle in it."""
    if out.exists() and not (out / form.MANIFEST).is_file() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} holds something that is no bundle; choose another folder")
    if not out.parent.is_dir():
        raise InputError(f"{out}: there is no folder {out.parent}")


def _parameters(blocks: Sequence[Block], constants: Mapping[str, float]) -> bytes:
    """`parameters.json`."""
    known = parameters.check()
    found = {name: p.value for name, p in parameters.load(*BAKED_IN).items()}
    found |= {v.name: v.start for block in blocks for v in block.model.parameters} | dict(constants)
    entries = {
        name: {"value": value, "unit": known[name].unit, "source": known[name].source}
        if name in known
        else {"value": value}
        for name, value in found.items()
    }
    return _json(entries)


def _manifest(folder: Path, content: Content, identity: str, targets: Sequence[str]) -> dict[str, Any]:
    return {
        "format": form.FORMAT,
        "controller": content.name,
        "engine": content.engine,
        "slewright": VERSION,
        "layout": image.token(),
        "identity": identity,
        "platforms": sorted(targets),
        "guard": content.guard.name if content.guard else "",
        "files": form.hashes(folder),
    }


def _json(content: Any) -> bytes:
    return (json.dumps(content, indent=1, sort_keys=True) + "\n").encode()
