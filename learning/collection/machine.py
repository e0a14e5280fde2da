"""The reference machine in lock step: placed in a pose, then advanced by one command period at a time.

What a recording needs of a machine is in `Machine`; a driver for a real one takes the same place.
"""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from types import TracebackType
from typing import Protocol, Self

import numpy as np

from learning.collection.command import Command
from learning.collection.plan import PERIOD_S
from orchestrator.run.master import Master, Options
from orchestrator.system.assembly import driven_machine
from orchestrator.system.layout import lay_out
from orchestrator.system.system import System
from specs import draws

STEP_S = 0.02
TICKS = round(PERIOD_S / STEP_S)  # in one command period
LABEL = "simulated reference machine"
NOMINAL = "nominal"
REFERENCES = ("u_slew", "qd_boom_ref", "qd_stick_ref")
SENSED = (
    *(f"{kind}_{joint}" for kind in ("q", "qd") for joint in ("slew", "boom", "stick")),
    *(f"p_{joint}_{side}" for joint in ("slew", "boom", "stick") for side in "ab"),
    "p_pump",
    "brake_released",
    *(f"imu_{imu}_{kind}_{axis}" for imu in ("cabin", "tool") for kind in ("rate", "acc") for axis in "xyz"),
    *(f"imu_{imu}_{angle}" for imu in ("cabin", "tool") for angle in ("roll", "pitch")),
)
RECORDED = (*REFERENCES, "u_boom", "u_stick", *SENSED)


class Run(AbstractContextManager["Run", None], Protocol):
    """A machine that stands in the wanted pose, tool hanging still."""

    def advance(self, command: Command) -> np.ndarray:
        """Hold `command` for one period; the rows [TICKS, 1 + RECORDED] that passed, time in s first."""
        ...


class Machine(Protocol):
    """Where recordings are made."""

    label: str
    identity: Mapping[str, object]

    def at(self, q_boom: float, q_stick: float, load_kg: float, seed: int) -> Run:
        """Stand in a pose with a load; `seed` is of the sensors' noise, where it is simulated."""
        ...


class LockStep:
    """The simulated reference machine with its arm velocity controller."""

    def __init__(self, which: str = NOMINAL) -> None:
        """`which`: "nominal", "tuning:K" or "validation:K"; InputError for what is none of them."""
        self.label, self.parameters = LABEL, draws.named(which)
        self.system = _system()
        self.layout = lay_out(self.system, list(RECORDED))
        fmus = {name: component.sha256 for name, component in self.system.components.items()}
        self.identity: Mapping[str, object] = {"machine": which, "parameters": self.parameters, "fmus": fmus}

    def at(self, q_boom: float, q_stick: float, load_kg: float, seed: int) -> "LockStepRun":
        """See `Machine`."""
        pose = {"start_q_slew": 0.0, "start_q_boom": q_boom, "start_q_stick": q_stick}
        values = {**self.parameters, **pose, "load_mass": load_kg, "noise_seed": float(seed)}
        start = self.system.start_values({f"machine.{name}": value for name, value in values.items()})
        return LockStepRun(Master(self.system, self.layout, start, Options()))


class LockStepRun:
    """One recording's instance of the machine; a context, which frees it."""

    def __init__(self, master: Master) -> None:
        self.master = master
        master.plan.log(64 * TICKS)
        try:
            master.initialise()
        except BaseException:
            master.free()
            raise

    def advance(self, command: Command) -> np.ndarray:
        """See `Run`; RunError when the model fails."""
        for name, value in zip(REFERENCES, command, strict=True):
            self.master.set_input(name, value)
        self.master.run(self.master.tick + TICKS)
        rows = self.master.take(TICKS, 4 * TICKS, 0)
        rows[:, 0] = rows[:, 0].view(np.int64) * STEP_S
        return rows

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.master.log_finish()
        self.master.free()


def _system() -> System:
    return driven_machine("collection", SENSED, ["u_boom", "u_stick"])
