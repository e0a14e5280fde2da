"""Systems to measure and tune controllers on: assembled in a temporary folder, run by the orchestrator."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fmus.build import build_fmu
from orchestrator.check import load_system
from orchestrator.system import System
from specs import ssd, systems

STEP_S = 0.02


def assemble(spec: systems.SystemSpec) -> System:
    """Build the FMUs (FMI 2.0) of a system definition and load it as the orchestrator would its package."""
    with TemporaryDirectory(prefix="slewright-") as name:
        folder = Path(name)
        (folder / "resources").mkdir()
        for fmu in {component.fmu for component in spec.components}:
            path = build_fmu(fmu, 2)
            (folder / "resources" / path.name).write_bytes(path.read_bytes())
        (folder / "SystemStructure.ssd").write_text(ssd.render(spec, 2), encoding="utf-8")
        return load_system(folder / "SystemStructure.ssd")


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
