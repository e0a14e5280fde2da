"""Targets to work through: slew angles to either side, and arm poses that keep the plan's limits."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import radians

from learning.collection.draws import Draws
from learning.collection.plan import ATTEMPTS, Limits, clearance
from specs.errors import InputError

TRAVEL_RAD = (radians(30.0), radians(150.0))
ROOM_M = 0.3  # between the grab and what the supervisor keeps


@dataclass(frozen=True)
class Target:
    """Where the machine is to go, rad."""

    slew: float
    boom: float
    stick: float


def targets(draws: Draws, limits: Limits, start: tuple[float, float, float]) -> Iterator[Target]:
    """Endless targets, each some TRAVEL_RAD of slew from the one before it, with another arm pose."""
    slew, boom, stick = start
    while True:
        slew += draws.sign() * draws.between(*TRAVEL_RAD)
        boom, stick = _pose(draws, limits)
        yield Target(slew, boom, stick)


def _pose(draws: Draws, limits: Limits) -> tuple[float, float]:
    for _ in range(ATTEMPTS):
        boom, stick = draws.between(*limits.boom_rad), draws.between(*limits.stick_rad)
        if clearance(boom, stick).min() > limits.keepout_margin_m + ROOM_M:
            return boom, stick
    raise InputError("limits: no arm pose keeps the grab off the keep-out")
