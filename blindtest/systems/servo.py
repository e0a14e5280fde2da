"""A position servo with two or three states of the plain model; equations in native/servo.c and README.md.

    J q'' = K a - b q' - k q        a' = (u - a) / T        measured: q, q'

Three plain models: `servo` (T = 0, k = 0), `servo_spring` (T = 0) and `servo_actuator` (k = 0).
"""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from blindtest.integrator import doubles, library
from blindtest.systems.axis import absent, block, longest
from blindtest.systems.system import STEP, Base, Drive, Signal, Trace
from specs.errors import RunError

BASE = ("inertia", "gain", "viscous", "spring", "actuator_lag")
LONGEST = 0.005  # s, of a step
LONGEST_STIFF = 0.001  # s, where a contact or a shaft is stiff
LAGS = ("actuator_lag", "in_lag", "out_lag_q", "out_lag_v")


@dataclass(frozen=True)
class Servo:
    """A position servo; `base` holds its own values of this draw."""

    name: str
    base: tuple[Base, ...]
    outputs: tuple[Signal, ...] = (
        Signal("q", "rad", noise=2e-4, quantum=1e-4, size=1.0),
        Signal("qd", "rad/s", noise=2e-3, quantum=1e-3, size=1.0),
    )
    inputs: tuple[Signal, ...] = (Signal("u", "1", noise=5e-4, size=1.0),)
    starts: int = 2
    disturbances: int = 1

    @property
    def model(self) -> str:
        """Folder of the plain model."""
        return f"blindtest/models/{self.name}"

    def simulate(
        self,
        values: Mapping[str, float],
        drive: Drive,
        start: np.ndarray,
        disturbance: np.ndarray | None = None,
        noise: np.ndarray | None = None,
    ) -> Trace:
        """Run it: disturbance torque [n] held over each sample, noise [n, 2] seen by the controller too."""
        n = len(drive.commands)
        base = np.array([values.get(name, 0.0) for name in BASE])
        axis = block({k: v for k, v in values.items() if k in absent()})
        u = np.ascontiguousarray(drive.commands[:, 0], dtype=float).copy()
        disturbance = np.zeros(n) if disturbance is None else np.ascontiguousarray(disturbance)
        noise = np.zeros((n, 2)) if noise is None else np.ascontiguousarray(noise)
        control = np.array(drive.gains, dtype=float) if drive.closed else None
        reference = None if drive.reference is None else np.ascontiguousarray(drive.reference)
        y, held, history = np.empty((n, 2)), np.empty(n), np.empty((2, n, 2))
        function = library().bt_servo
        events = function(
            doubles(base),
            doubles(axis),
            doubles(control),
            ctypes.c_int(n),
            ctypes.c_double(STEP),
            ctypes.c_double(_longest(values)),
            doubles(u),
            doubles(reference),
            doubles(disturbance),
            doubles(noise),
            doubles(np.ascontiguousarray(start, dtype=float)),
            doubles(y),
            doubles(held),
            doubles(history),
        )
        if events < 0 or not np.isfinite(y).all():
            raise RunError(f"{self.name}: the run does not stay finite")
        return Trace(u[:, None], y, events)


def _longest(values: Mapping[str, float]) -> float:
    """The longest step (s) that is right for what is stiff, and for the shortest lag."""
    stiff = values.get("shaft_stiffness", 0.0) > 0 or np.isfinite(values.get("stop_position", np.inf))
    return longest(LONGEST_STIFF if stiff else LONGEST, values, LAGS)


def draw(rng: np.random.Generator) -> Servo:
    """A servo of one of the three forms with drawn parameters."""
    name = str(rng.choice(["servo", "servo_spring", "servo_actuator"]))
    inertia = float(np.exp(rng.uniform(np.log(0.2), np.log(5.0))))
    base = [
        Base("inertia", inertia, "kg.m2", known=True),
        Base("gain", inertia * rng.uniform(2.0, 8.0), "N.m"),
        Base("viscous", inertia * rng.uniform(0.3, 2.0), "N.m.s/rad"),
    ]
    if name == "servo_spring":
        base.append(Base("spring", inertia * rng.uniform(1.0, 8.0), "N.m/rad"))
    if name == "servo_actuator":
        base.append(Base("actuator_lag", rng.uniform(0.05, 0.25), "s"))
    return Servo(name, tuple(base))
