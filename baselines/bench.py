"""Systems to measure and tune controllers on: assembled in a temporary folder, run by the orchestrator."""

from collections.abc import Mapping
from typing import Any

from orchestrator.system.assembly import STEP_S, assemble, driven_machine
from orchestrator.system.system import System
from specs import systems


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
    sensed = [f"{q}_{joint}" for q in ("q", "qd") for joint in ("boom", "stick")]
    return driven_machine("arm_loop", sensed, ["u_boom", "u_stick"])
