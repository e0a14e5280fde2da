"""What a machine is told for one command period, and what tells it."""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np

Sample = Mapping[str, float]  # the newest value of each sensor by name


class Command(NamedTuple):
    """Joystick of the slew (-1..1) and velocity references of the arm, rad/s."""

    u_slew: float
    qd_boom_ref: float
    qd_stick_ref: float


NEUTRAL = Command(0.0, 0.0, 0.0)


class Pilot(Protocol):
    """Whatever wants to move the machine."""

    def __call__(self, period: int, seen: Sample) -> Command:
        """What it wants in the period with this number (0, 1, …), given the sensors at its beginning."""
        ...


class Replay:
    """A pilot that looks at nothing: `commands` [n, 3] one after another."""

    def __init__(self, commands: np.ndarray) -> None:
        self.commands = commands

    def __call__(self, period: int, seen: Sample) -> Command:
        """See `Pilot`."""
        u, boom, stick = map(float, self.commands[period])
        return Command(u, boom, stick)
