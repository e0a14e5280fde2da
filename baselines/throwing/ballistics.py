"""Where a load lands that leaves the grab: free flight without drag from the grab point."""

import math
from dataclasses import dataclass

import numpy as np

from fmus.equations import kinematics
from specs import pose

STEP_S = 0.02
SMALL_S = 1e-3  # over which a speed is taken
Vector = np.ndarray  # (3)


@dataclass(frozen=True)
class Flight:
    """Where (x, y) [m] and after how long [s] it lands."""

    place: Vector
    seconds: float


def flight(place: Vector, speed: Vector, ground: float = 0.0) -> Flight:
    """The flight from a place [m] with a speed [m/s] to the height of the `ground` [m]."""
    gravity = kinematics.geometry().gravity
    drop = max(place[2] - ground, 0.0)
    seconds = (speed[2] + math.sqrt(speed[2] ** 2 + 2.0 * gravity * drop)) / gravity
    return Flight(place[:2] + seconds * speed[:2], seconds)


def ahead(angles: Vector, rates: Vector, seconds: float, sizes: dict[str, float]) -> tuple[Vector, Vector]:
    """Place and speed of the grab point after some time, from angles and rates (as pose.ANGLES) now.

    The joints keep their rates; the tool swings as a pendulum below the moving arm tip.
    """
    gravity, length = kinematics.geometry().gravity, sizes["tool_length"]
    steps = max(1, round(seconds / STEP_S))
    step = seconds / steps
    times = np.arange(steps + 2) * step - step / 2  # of the tips: at the middle of each step, and one beyond
    joints = angles[:3] + times[:, None] * rates[:3]
    p = kinematics.geometry()
    radius, height = kinematics.arm_tip(joints[:, 1], joints[:, 2], p)
    tips = np.stack([radius * np.cos(joints[:, 0]), radius * np.sin(joints[:, 0]), height], axis=1)
    now = pose.grab(np.stack([angles - SMALL_S * rates, angles + SMALL_S * rates]), sizes)
    place, speed = now.mean(axis=0), (now[1] - now[0]) / (2.0 * SMALL_S)
    flat, moves = place[:2].copy(), speed[:2].copy()
    for tip in tips[1:-1]:
        flat = flat + step / 2 * moves
        below = tip[2] - _hangs(tip, flat, length)
        moves = moves + step * gravity / below * (tip[:2] - flat)
        flat = flat + step / 2 * moves
    heights = [_hangs(tips[k], flat + (k - steps - 0.5) * step * moves, length) for k in (steps, steps + 1)]
    return np.array([*flat, np.mean(heights)]), np.array([*moves, (heights[1] - heights[0]) / step])


def _hangs(tip: Vector, flat: Vector, length: float) -> float:
    """Height of a point of the pendulum that is at `flat` from above."""
    away = min(float(np.hypot(*(flat - tip[:2]))), 0.9 * length)
    return float(tip[2]) - math.sqrt(length**2 - away**2)
