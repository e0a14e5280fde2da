"""Systems to measure and tune controllers on: assembled in a temporary folder, run by the orchestrator."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fmus.build import build_fmu
from orchestrator.check import load_system
from orchestrator.pack import pack
from orchestrator.system import System
from specs import ssd, systems

STEP_S = 0.02


def assemble(spec: systems.SystemSpec) -> System:
    """Build the FMUs (FMI 2.0) of a system definition and load it as the orchestrator would its package."""
    fmus = {f"{component.fmu}.fmu": build_fmu(component.fmu, 2) for component in spec.components}
    with TemporaryDirectory(prefix="slewright-") as folder:
        return load_system(pack(ssd.render(spec, 2), fmus, Path(folder) / f"{spec.name}.ssp"))


def bare_machine(outputs: list[str]) -> System:
    """The reference machine alone, its three commands driven from outside, the named `outputs` recorded."""
    commands = ["u_slew", "u_boom", "u_stick"]
    component = {"fmu": "machine", "inputs": {systems.SYSTEM: commands}}
    data: Mapping[str, Any] = {
        "description": "The reference machine alone",
        "step_s": STEP_S,
        "stop_s": 60.0,
        "components": {"machine": component},
        "outputs": {"machine": outputs},
    }
    return assemble(systems.parse("bare_machine", data))
