"""A system definition made ready to run, in memory: for tools that measure, tune or drive models."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from fmus.toolchain.build import build_fmu
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack
from orchestrator.system.system import System
from specs import ssd, systems

STEP_S = 0.02
ARM = ("boom", "stick")


def assemble(spec: systems.SystemSpec, models: Mapping[str, Path] | None = None) -> System:
    """Build the FMUs (FMI 2.0) of a system definition and load it as the orchestrator would its package.

    `models` replaces models by their names with model folders or FMUs.
    """
    known = {c.fmu: (models or {}).get(c.fmu, c.fmu) for c in spec.components}
    fmus = {
        f"{name}.fmu": model if isinstance(model, Path) and model.suffix == ".fmu" else build_fmu(model, 2)
        for name, model in known.items()
    }
    with TemporaryDirectory(prefix="slewright-") as folder:
        return load_system(pack(ssd.render(spec, 2), fmus, Path(folder) / f"{spec.name}.ssp"))


def driven_machine(name: str, machine: Sequence[str], arm_velocity: Sequence[str] = ()) -> System:
    """The reference machine with its arm velocity controller, driven from outside: u_slew, qd_*_ref.

    Recorded are the named outputs of the two.
    """
    sensed = [f"{kind}_{joint}" for kind in ("q", "qd") for joint in ARM]
    references, commands = [f"qd_{joint}_ref" for joint in ARM], [f"u_{joint}" for joint in ARM]
    components = {
        "arm_velocity": {"fmu": "arm_velocity", "inputs": {systems.SYSTEM: references, "machine": sensed}},
        "machine": {"fmu": "machine", "inputs": {systems.SYSTEM: ["u_slew"], "arm_velocity": commands}},
    }
    data = {
        "description": "Reference machine and arm velocity controller, driven from outside",
        "step_s": STEP_S,
        "stop_s": 60.0,
        "components": components,
        "outputs": {"arm_velocity": list(arm_velocity), "machine": list(machine)},
    }
    return assemble(systems.parse(name, data))
