"""Boom and stick under their velocity controller, first order with delay; equations in native/arm.c.

The plain model is fmus/models/arm with recorded references; what it has in whole steps (the delays) is so
here too.
"""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from blindtest.integrator import doubles, library
from blindtest.systems.axis import blocks
from blindtest.systems.system import STEP, Base, Drive, Signal, Trace, around
from specs.errors import RunError

JOINTS = ("boom", "stick")
LIMIT = 0.2  # rad/s, of references: arm_rate_limit


@dataclass(frozen=True)
class Arm:
    """Both joints; the disturbance torque acts on `active`, the one that has the effects."""

    base: tuple[Base, ...]
    active: int
    name: str = "arm"
    model: str = "fmus/models/arm"
    inputs: tuple[Signal, ...] = (
        Signal("qd_boom_ref", "rad/s", noise=2e-5),
        Signal("qd_stick_ref", "rad/s", noise=2e-5),
    )
    outputs: tuple[Signal, ...] = (
        Signal("q_boom", "rad", noise=2e-4, quantum=1e-4, within=("boom_min", "boom_max")),
        Signal("q_stick", "rad", noise=2e-4, quantum=1e-4, within=("stick_min", "stick_max")),
        Signal("qd_boom", "rad/s", noise=5e-4, quantum=5e-5),
        Signal("qd_stick", "rad/s", noise=5e-4, quantum=5e-5),
    )
    starts: int = 4
    disturbances: int = 1

    def simulate(
        self,
        values: Mapping[str, float],
        drive: Drive,
        start: np.ndarray,
        disturbance: np.ndarray | None = None,
        noise: np.ndarray | None = None,
    ) -> Trace:
        """Run it: references [n, 2]; closed loop is a P position loop; disturbance torque [n] in N.m."""
        n = len(drive.commands)
        names = [[f"{j}_{what}" for what in ("response", "delay", "joint_inertia")] for j in JOINTS]
        parts = np.array([[values[name] for name in joint] for joint in names])
        u = np.ascontiguousarray(drive.commands, dtype=float).copy()
        y = np.empty((n, 4))
        reference = None if drive.reference is None else np.ascontiguousarray(drive.reference)
        library().bt_arm(
            doubles(parts),
            doubles(blocks(values, JOINTS)),
            ctypes.c_double(LIMIT),
            ctypes.c_int(n),
            ctypes.c_double(STEP),
            doubles(u),
            doubles(reference),
            doubles(np.array([drive.gains[0], LIMIT]) if drive.closed else None),
            doubles(np.zeros(n) if disturbance is None else np.ascontiguousarray(disturbance)),
            ctypes.c_int(self.active),
            doubles(np.zeros((n, 4)) if noise is None else np.ascontiguousarray(noise)),
            doubles(np.ascontiguousarray(start, dtype=float)),
            doubles(y),
        )
        if not np.isfinite(y).all():
            raise RunError("arm: the run does not stay finite")
        return Trace(u, y)


def draw(rng: np.random.Generator) -> Arm:
    """An arm beside the values of specs; inertias are known."""
    base = [around(f"{j}_response", rng) for j in JOINTS]
    base += [around(f"{j}_delay", rng, step=STEP) for j in JOINTS]
    base += [around(f"{j}_joint_inertia", rng, known=True) for j in JOINTS]
    return Arm(tuple(base), int(rng.integers(2)))
