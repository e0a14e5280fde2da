"""Closed-loop slew control for collection: a braking parabola with the dead band made up for.

    e     = target - (q + lead qd)                    where the slew will be when the command acts
    ref   = sign(e) min(pace top_speed, sqrt(2 braking_torque / I |e|))
    w     = feedforward ref + gain (ref - qd)
    u     = clip(w + dead_band sat(w / EDGE)), and 0 within TOLERANCE_RAD at rest

It is a tool to collect data where controllers work, in place of the paper's early policy; controllers to
compare with live in `baselines`.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import radians

import numpy as np

from fmus.equations import kinematics
from learning.collection.command import Command, Sample
from learning.collection.draws import Draws
from learning.collection.plan import PERIOD_S, Recording
from learning.collection.targets import TRAVEL_RAD
from specs.errors import InputError, nearest

EDGE = 0.08  # of w: below it the dead band is made up for in part, so that the command does not chatter
TOLERANCE_RAD = radians(1.5)  # closer it cannot well come: the least pull is a turn of a degree
STILL_RAD_S = 0.04
INTERVAL_S = (6.0, 15.0)
PACE = (0.4, 1.0)


@dataclass(frozen=True)
class Gains:
    """What is tuned (SI units); `RANGES` says within which bounds."""

    dead_band: float  # joystick at which the machine begins to move
    feedforward: float  # s/rad
    gain: float  # s/rad
    braking_torque: float  # N m
    lead_s: float
    top_speed: float  # rad/s

    @classmethod
    def of(cls, values: Mapping[str, float]) -> "Gains":
        """From a plan or manifest; raises InputError for a missing, unknown or unusable one."""
        for name in values:
            if name not in RANGES:
                raise InputError(f"gains: unknown {name}; {nearest(name, RANGES)}")
        missing = [name for name in RANGES if name not in values]
        if missing:
            raise InputError(f"gains: missing {', '.join(missing)}")
        for name, (low, high) in RANGES.items():
            if not low <= values[name] <= high:
                raise InputError(f"gains: {name} = {values[name]:g} outside {low:g} … {high:g}")
        return cls(**values)

    def as_dict(self) -> dict[str, float]:
        """By name."""
        return asdict(self)


RANGES: dict[str, tuple[float, float]] = {
    "dead_band": (0.0, 0.3),
    "feedforward": (0.3, 2.0),
    "gain": (0.0, 2.0),
    "braking_torque": (10e3, 200e3),
    "lead_s": (0.0, 1.2),
    "top_speed": (0.3, 0.8),
}


def joystick(
    gains: np.ndarray, target: np.ndarray, q: np.ndarray, qd: np.ndarray, inertia: np.ndarray, pace: float
) -> np.ndarray:
    """Commands [...] of gains [..., 6] (in the order of `Gains`); rad, rad/s, kg m2."""
    dead_band, feedforward, gain, torque, lead, top = np.moveaxis(gains, -1, 0)
    error = target - q - lead * qd
    braking = np.sqrt(2 * torque / inertia * np.abs(error))
    reference = np.sign(error) * np.minimum(pace * top, braking)
    w = feedforward * reference + gain * (reference - qd)
    u = np.clip(w + dead_band * np.clip(w / EDGE, -1.0, 1.0), -1.0, 1.0)
    there = (np.abs(target - q) < TOLERANCE_RAD) & (np.abs(qd) < STILL_RAD_S)
    return np.where(there, 0.0, u)


class SlewControl:
    """A pilot that goes to one slew target after the other; the arm stands."""

    def __init__(self, gains: Gains, recording: Recording, seed: int) -> None:
        self.gains = np.array(list(gains.as_dict().values()))
        self.draws: Draws = recording.draws(seed, "closed loop")
        self.load_kg = recording.load_kg
        self.target, self.pace, self.until = 0.0, 1.0, 1.0

    def __call__(self, period: int, seen: Sample) -> Command:
        """See `Pilot`."""
        if period * PERIOD_S >= self.until:
            self.target += self.draws.sign() * self.draws.between(*TRAVEL_RAD)
            self.pace = self.draws.between(*PACE)
            self.until += self.draws.between(*INTERVAL_S)
        names = ("q_slew", "qd_slew", "q_boom", "q_stick")
        q, qd, boom, stick = (np.array(seen[name]) for name in names)
        inertia = kinematics.inertia_z(boom, stick, self.load_kg, kinematics.geometry())
        u = joystick(self.gains, np.array(self.target), q, qd, inertia, self.pace)
        return Command(float(u), 0.0, 0.0)
