"""A bundle's control core as an FMU, and the reference system with it: what is verified is what runs.

The FMU is compiled from the very sources in the bundle, with the shim around them: core.c and fmi2.c or
fmi3.c as they are, runtime/core/fmu.c in the place of the integrator.
"""

import tempfile
from pathlib import Path
from typing import Any, Literal

from deployment.bundling.blocks import CORE
from deployment.bundling.build import UNUSED_GONE, UNUSED_OUT, Cached, objects_of
from fmus.definition import Model, from_signals
from fmus.paths import SHIM
from fmus.toolchain import codegen, compiler, description, reference, terminals
from fmus.toolchain.build import HEADERS, SHIM_FILES, build_fmu as build_model, mark_built, pack, write_whole
from orchestrator.system.pack import pack as pack_ssp
from runtime.bundle import NATIVE, Bundle
from runtime.control import ControlCore
from runtime.image import INPUT, TICK_S, Group, group
from specs import systems
from specs.errors import InputError
from specs.schema import ROOT, read_toml
from specs.ssd import render

NAME = "control_core"
TARGETS = ("target_x", "target_y", "target_z", "load_told", "pace")
COMMANDS = ("u_slew", "u_boom", "u_stick", "qd_boom_ref", "qd_stick_ref")
SHOWN = ("control_mode", "fault_code", "target_reached")
REPLACED = ("pi", "arm_velocity")  # components of the reference system whose place the core takes
FMI: Literal[2] = 2  # of the system that is verified
INTERFACES = ("fmi2.c", "fmi3.c")
BEFORE = "  double start_time;\n"  # in the shim's SlwState: where the core's memory is put
AFTER = BEFORE + "  int64_t extra[SLR_EXTRA]; /* what fmu.c keeps */\n"


def system_of(bundle: Bundle, out: Path, fmi_version: Literal[2, 3] = FMI) -> Path:
    """Pack the reference system with the bundle's core as its controller; the path of the SSP.

    Raises InputError for a bundle whose policy is evaluated outside of its core, RunError if C fails.
    """
    spec = systems.parse("reference", _definition())
    fmus = {f"{NAME}.fmu": build_fmu(bundle, out / f"{NAME}.fmu", fmi_version)}
    fmus["machine.fmu"] = build_model("machine", fmi_version)
    return pack_ssp(render(spec, fmi_version), fmus, out / "reference.ssp")


def build_fmu(bundle: Bundle, path: Path, fmi_version: Literal[2, 3] = 3) -> Path:
    """Build the FMU `path` (co-simulation, this machine's platform) from a bundle's sources.

    Raises InputError for a bundle whose policy is evaluated outside of its core, RunError if C fails.
    """
    check_native(bundle)
    model, host = facade(), compiler.host()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        token = _write_sources(model, bundle, folder)
        library = {version: _compile(model, bundle, folder, version) for version in {FMI, fmi_version}}
        place = host.fmi2_folder if fmi_version == 2 else host.name
        files = {"modelDescription.xml": description.description(model, fmi_version, token)}
        files[f"binaries/{place}/{NAME}{host.suffix}"] = library[fmi_version]
        files["documentation/licenses/license.txt"] = b"Apache License, Version 2.0 (SPDX: Apache-2.0)\n"
        archive = pack(files | reference.files(model, library[FMI], token) | terminals.files(model))
    write_whole(path, archive)
    mark_built(archive)
    return path


def check_native(bundle: Bundle) -> None:
    """InputError for a bundle whose policy is evaluated outside of its core."""
    if bundle.engine != NATIVE:
        raise InputError(f"bundle {bundle.folder}: {bundle.engine} evaluates its policy outside of the core")


def facade() -> Model:
    """The FMU's variables: sensors and targets in, commands and modes out; its behaviour is the core's."""
    sensors = [s.name for s in INPUT.signals if group(s) is Group.SENSOR]
    return Model(
        name=NAME,
        description="Control core of a bundle: state machine, controller, arm loops, safety gate",
        kind="discrete",
        step=TICK_S,
        states=(),
        inputs=from_signals(*TARGETS, *sensors),
        outputs=from_signals(*COMMANDS, *SHOWN),
        parameters=(),
        rhs=lambda x, u, m, p: {},
        out=lambda x, u, m, p: dict.fromkeys((*COMMANDS, *SHOWN), 0.0),
    )


def _write_sources(model: Model, bundle: Bundle, folder: Path) -> str:
    """The shim with room for the core, the façade's tables, the map of its signals; returns the token."""
    shim = {name: (SHIM / name).read_text() for name in (*SHIM_FILES, *INTERFACES)}
    if BEFORE not in shim["core.h"]:
        raise RuntimeError("fmus/shim/core.h: SlwState has changed")
    shim["core.h"] = shim["core.h"].replace(BEFORE, AFTER)
    shim["integrator.c"] = (CORE / "fmu.c").read_text()
    code = codegen.model_c(model)
    token = codegen.token(model, code + bundle.identity, "".join(shim.values()))
    words = len(ControlCore(bundle).snapshot()) // 8 + 1 + len(model.outputs)
    config = codegen.model_config_h(model, token) + f"#define SLR_EXTRA {words}\n"
    files = {**shim, "model.c": code, "model_config.h": config, "fmu_map.h": _map(model)}
    for name, text in files.items():
        (folder / name).write_text(text)
    (folder / "fmi").mkdir()
    for name in (*HEADERS[2], *HEADERS[3]):
        (folder / "fmi" / name).write_bytes((SHIM / "fmi" / name).read_bytes())
    return token


def _map(model: Model) -> str:
    inputs = ", ".join(f"SLR_IN_{v.name}" for v in model.inputs)
    outputs = ", ".join(f"SLR_OUT_{v.name}" for v in model.outputs)
    return (
        f"#define SLR_LEN_INPUTS {len(model.inputs)}\n#define SLR_FMU_INPUTS {{{inputs}}}\n"
        f"#define SLR_LEN_OUTPUTS {len(model.outputs)}\n#define SLR_FMU_OUTPUTS {{{outputs}}}\n"
    )


def _compile(model: Model, bundle: Bundle, folder: Path, fmi_version: int) -> bytes:
    target = compiler.host().name
    config = (folder / "model_config.h").read_text()  # with the token, and so with everything else
    cached = Cached(repr((config, bundle.identity, compiler.identity(target), target, fmi_version)))
    if cached.path.is_file():
        return cached.path.read_bytes()
    sources, made = bundle.folder / "sources", folder / f"objects{fmi_version}"
    made.mkdir()
    objects = objects_of(sources, bundle.identity, made, target)
    include = ["-I", str(folder), "-I", str(sources / "core")]
    for name in ("core.c", "integrator.c", "model.c", f"fmi{fmi_version}.c"):
        flags = [*UNUSED_OUT, *include]
        objects.append(
            compiler.compile_object(folder / name, made / f"{name}.o", target, flags, name == "model.c")
        )
    gone = UNUSED_GONE[target.partition("-")[2]]
    library = compiler.link_shared(objects, folder / f"fmu{fmi_version}.so", target, gone)
    return cached.put(library).read_bytes()


def _definition() -> dict[str, Any]:
    """specs/systems/reference.toml with the core in its controllers' place."""
    data = read_toml(ROOT / "systems" / "reference.toml")
    core = facade()
    sensors = [v.name for v in core.inputs if v.name in data["outputs"]["machine"]]
    machine = data["components"]["machine"]
    commands = [n for name in REPLACED for n in machine["inputs"].pop(name, [])]
    machine["inputs"]["core"] = commands
    components = {"core": {"fmu": NAME, "description": core.description}, "machine": machine}
    components["core"]["inputs"] = {systems.SYSTEM: list(TARGETS), "machine": sensors}
    outputs = {"core": [*COMMANDS, *SHOWN], "machine": data["outputs"]["machine"]}
    return {**data, "components": components, "outputs": outputs}
