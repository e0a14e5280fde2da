"""How fast along the way: time-optimal within the limits (toppra).

Limits: speed and acceleration of each joint, flow of the one pump, speed of the grab in slow zones.
"""

import math
from dataclasses import dataclass
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from baselines.planning.path import TICK_S
from fmus.equations import cylinder, kinematics
from fmus.models.machine import arm_hydraulics
from specs import parameters

GRID = 120  # places on the path
SLOWEST = 1e-3  # of the way per second: below this the place at an end is taken as reached


@dataclass(frozen=True)
class Limits:
    """Of joints (slew, boom, stick) and pump: rad/s, rad/s2, m3/s."""

    rates: np.ndarray
    accelerations: np.ndarray
    flow: float


def timed(curve: BSpline, scale: np.ndarray, limits: Limits, slow: Any) -> np.ndarray | None:
    """Places on the `curve` (its parameter) at each tick; None where no timing keeps to the limits.

    `scale` turns the curve's states into angles; `slow(poses)` is the largest speed of the grab there, m/s.
    """
    toppra = import_module("toppra")
    algorithms, constraint = (import_module(f"toppra.{name}") for name in ("algorithm", "constraint"))
    toppra.setup_logging("ERROR")
    span = float(curve.t[-1])
    grid = np.linspace(0.0, span, GRID + 1)
    path = toppra.SplineInterpolator(grid, curve(grid) * scale)
    acceleration = constraint.JointAccelerationConstraint(
        np.stack([-limits.accelerations, limits.accelerations], axis=1)
    )
    bound = _bound(constraint, lambda s: _fastest(path(s), path(s, 1), limits, slow))
    found = algorithms.TOPPRA(
        [bound, acceleration], path, gridpoints=grid, parametrizer="ParametrizeConstAccel"
    )
    _, speeds, _ = found.compute_parameterization(0.0, 0.0)
    if speeds is None or not np.all(np.isfinite(speeds)):
        return None
    return _over_time(grid, speeds)


def _over_time(grid: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """The place at each tick, from the speed at each place: even acceleration between them."""
    pace = np.maximum((speeds[:-1] + speeds[1:]) / 2, SLOWEST)
    times = np.concatenate([[0.0], np.cumsum(np.diff(grid) / pace)])
    ticks = np.arange(math.ceil(times[-1] / TICK_S) + 1) * TICK_S
    k = np.minimum(np.searchsorted(times, ticks, "right") - 1, len(pace) - 1)
    length = np.diff(times)
    gone = np.minimum(ticks - times[k], length[k])
    rise = (speeds[k + 1] - speeds[k]) / length[k]
    return np.minimum(grid[k] + speeds[k] * gone + rise * gone**2 / 2, grid[-1])


def _fastest(angles: np.ndarray, along: np.ndarray, limits: Limits, slow: Any) -> np.ndarray:
    """The largest speed of the place on the path at each place."""
    small = 1e-9
    by_joint = np.min(limits.rates / np.maximum(np.abs(along), small), axis=1)
    by_flow = limits.flow / np.maximum(pumped(angles, along), small)
    by_grab = slow(angles) / np.maximum(np.sqrt(squared_speed(angles.T, along.T)), small)
    return np.minimum(np.minimum(by_joint, by_flow), by_grab)


def pumped(angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """What motor and cylinders take from the pump at joint `rates`, m3/s."""
    p = _machine()
    total = p.slew_displacement * np.abs(rates[:, 0])
    for k, joint in enumerate(arm_hydraulics.JOINTS, 1):
        c = arm_hydraulics.parameters(p, joint)
        speed = np.array([float(cylinder.lever(float(q), c)) for q in angles[:, k]]) * rates[:, k]
        total = total + np.where(speed > 0, c.area_bore * speed, -c.area_rod * speed)
    return total


def squared_speed(pose: Any, rates: Any) -> Any:
    """Of the grab as it hangs straight, m2/s2: slew, boom and stick, and their rates; numbers or symbols."""
    p, (_, boom, stick), (qd_slew, qd_boom, qd_stick) = kinematics.geometry(), pose, rates
    radius, _ = kinematics.arm_tip(boom, stick, p)
    out, up = kinematics.arm_tip_rate(boom, stick, qd_boom, qd_stick, p)
    return (radius * qd_slew) ** 2 + out**2 + up**2


def _bound(constraint: Any, fastest: Any) -> Any:
    """toppra's constraint of a speed on the path that depends on the place."""

    class Bound(constraint.LinearConstraint):
        def __init__(self) -> None:
            super().__init__()
            self.dof = 3

        def compute_constraint_params(self, path: Any, gridpoints: np.ndarray) -> Any:
            squares = np.minimum(fastest(gridpoints), 1e3) ** 2
            return None, None, None, None, None, None, np.stack([np.zeros_like(squares), squares], axis=1)

    return Bound()


def _machine() -> SimpleNamespace:
    """Nominal parameters of the machine's hydraulics."""
    return SimpleNamespace(**{name: p.value for name, p in parameters.load("slew", "machine").items()})
