"""The reference machine's FMU on a bench: its commands driven from outside, through the orchestrator."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.optimize import brentq

from fmus.equations import kinematics
from fmus.models.slew import features
from fmus.models.slew.features import Features
from fmus.models.slew.traces import PERIOD
from fmus.toolchain.build import build_fmu
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.record import Record
from specs import signals, ssd, systems

STEP_S = 0.02
STEP_RUN_S = 15.0  # as long as the step traces
GRAB_HEIGHT_M = 6.0  # of the poses at a given inertia: the usual target height
COMMANDS = ("u_slew", "u_boom", "u_stick")
JOINTS = ("slew", "boom", "stick", "tool_x", "tool_y")


@dataclass(frozen=True)
class Pose:
    """A start pose: joint angles in rad, radius of the arm tip in m, slew inertia in kg m2 without load."""

    q_boom: float
    q_stick: float
    radius: float
    inertia: float

    @property
    def parameters(self) -> dict[str, float]:
        return {"start_q_boom": self.q_boom, "start_q_stick": self.q_stick}


def pose(inertia: float, load: float = 0.0) -> Pose:
    """The pose with the grab at 6 m height in which the slew inertia is `inertia`, kg m2."""
    p = kinematics.geometry()

    def joints(radius: float) -> tuple[float, float]:
        _, q_boom, q_stick = kinematics.inverse(radius, 0.0, GRAB_HEIGHT_M, p)
        return float(q_boom), float(q_stick)

    def excess(radius: float) -> float:
        return float(kinematics.inertia_z(*joints(radius), load, p)) - inertia

    radius = float(brentq(excess, 6.0, 16.0, xtol=1e-9))  # type: ignore[arg-type]
    return Pose(*joints(radius), radius, inertia)


class Bench:
    """The machine alone; all outputs by name, noise off unless a seed is given."""

    @cached_property
    def system(self) -> System:
        """The machine as a system: commands and disturbances are inputs, sensors and true states outputs."""
        disturbances = [n for n in signals.signals() if n.startswith("disturbance_")]
        true = [f"true_{q}_{j}" for j in JOINTS for q in ("q", "qd")]
        data: Mapping[str, Any] = {
            "description": "The reference machine alone",
            "step_s": STEP_S,
            "stop_s": 60.0,
            "components": {
                "machine": {"fmu": "machine", "inputs": {systems.SYSTEM: [*COMMANDS, *disturbances]}}
            },
            "outputs": {"machine": ["q_slew", "qd_slew", *true]},
        }
        spec = systems.parse("bench", data)
        with TemporaryDirectory(prefix="slewright-") as folder:
            return load_system(
                pack(
                    ssd.render(spec, 2), {"machine.fmu": build_fmu("machine", 2)}, Path(folder) / "bench.ssp"
                )
            )

    def run(
        self,
        seconds: float,
        changes: Mapping[float, Mapping[str, float]] | None = None,
        parameters: Mapping[str, float] | None = None,
        seed: int | None = None,
    ) -> Record:
        """Simulate; `changes` maps seconds to input values, `parameters` are the machine's by name."""
        ticks = {round(t / STEP_S): dict(values) for t, values in (changes or {}).items()}
        given = {f"machine.{name}": value for name, value in (parameters or {}).items()}
        return simulate(self.system, round(seconds / STEP_S), Stimuli(ticks), given, seed=seed)

    def step(
        self, command: float, parameters: Mapping[str, float] | None = None, seed: int | None = None
    ) -> Record:
        """A joystick step as in the step traces: from 1 s to 8 s, then released."""
        changes = {features.STEP_AT: {"u_slew": command}, features.RELEASE_AT: {"u_slew": 0.0}}
        return self.run(STEP_RUN_S, changes, parameters, seed)


def read_step(record: Record, prefix: str = "") -> Features:
    """Features of a step, sampled at 10 Hz as the traces are; `prefix` true_ reads the true states."""
    rows = slice(0, None, round(PERIOD / STEP_S))
    qd, q = (record.column(f"{prefix}{n}_slew")[rows] for n in ("qd", "q"))
    return features.features(np.asarray(record.time[rows]), qd, q)
