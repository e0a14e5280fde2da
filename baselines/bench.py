"""Systems to measure and tune controllers on: assembled in a temporary folder, run by the orchestrator."""

from collections.abc import Callable, Mapping
from typing import Any

from orchestrator.assembly import assemble
from orchestrator.system import System
from specs import systems

STEP_S = 0.02
Report = Callable[[str, float, float], None]  # what is being done, how many of how many steps are


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


def arm_loop() -> System:
    """The reference machine with its arm velocity controller, velocity references from outside."""
    references = [f"qd_{joint}_ref" for joint in ("boom", "stick")]
    sensed = [f"{q}_{joint}" for q in ("q", "qd") for joint in ("boom", "stick")]
    components = {
        "arm_velocity": {"fmu": "arm_velocity", "inputs": {systems.SYSTEM: references, "machine": sensed}},
        "machine": {"fmu": "machine", "inputs": {"arm_velocity": ["u_boom", "u_stick"]}},
    }
    data = {
        "description": "Reference machine and arm velocity controller",
        "step_s": STEP_S,
        "stop_s": 60.0,
        "components": components,
        "outputs": {"machine": sensed, "arm_velocity": ["u_boom", "u_stick"]},
    }
    return assemble(systems.parse("arm_loop", data))
