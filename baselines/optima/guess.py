"""Where a search begins that has no neighbour: quintic angles, the tool hanging."""

from collections.abc import Sequence

import numpy as np

from baselines.optima.case import Case
from baselines.optima.collocation import POINTS, TAU
from baselines.optima.plant import PRESSURE, Plant

INERTIA = 4e5  # kg m2, roughly
ARM_PEAK = 0.14  # rad/s, of a joint
States = list[np.ndarray]


def smooth(
    case: Case, plant: Plant, names: Sequence[str], intervals: Sequence[int], lengths: Sequence[float]
) -> tuple[States, States]:
    """States [nx, 3 N] and inputs [nu, N] of both phases: the move in the first `lengths`, then rest.

    Pressures and spool go with the slew's angle roughly.
    """
    states, inputs, begin = [], [], 0.0
    for n, span in zip(intervals, lengths, strict=True):
        h = span / n
        points = (begin + h * (np.arange(n)[:, None] + TAU[None, 1:])).ravel()
        x = np.zeros((len(names), POINTS * n))
        slew = _slew(np.radians(case.travel_deg), lengths[0], points, plant)
        for name, value in (slew | _arm(case, lengths[0], points)).items():
            if name in names:
                x[names.index(name)] = value
        states.append(x)
        middles = begin + h * (np.arange(n) + 0.5)
        channels = ("spool", "boom_rate", "stick_rate") if case.moving else ("spool",)
        inputs.append(np.array([np.interp(middles, points, x[names.index(c)]) for c in channels]))
        begin += span
    if case.moving:
        inputs[0][1:, 0] = 0.0
    return states, inputs


def _slew(travel: float, length: float, points: np.ndarray, plant: Plant) -> dict[str, np.ndarray]:
    p = plant.p
    angle, speed, slope = _quintic(travel, length, points)
    drive = (INERTIA * slope + p.slew_friction_viscous * speed) / p.slew_displacement / PRESSURE
    boost = p.slew_boost_pressure / PRESSURE
    going = points < length
    spool = 0.12 + 0.6 * np.interp(points, [0, length, 99], [1, 0, 0]) * going * (slope > 0)
    return {
        "slew": angle,
        "slew_rate": speed,
        "relief": drive,
        "spool": spool * going,
        "p_a": boost + np.maximum(drive, 0),
        "p_b": boost + np.maximum(-drive, 0),
    }


def _arm(case: Case, length: float, points: np.ndarray) -> dict[str, np.ndarray]:
    found = {}
    for joint, begin, end in zip(("boom", "stick"), *case.arm, strict=True):
        angle, speed, _ = _quintic(end - begin, max(length, abs(end - begin) * 1.875 / ARM_PEAK), points)
        found |= {joint: begin + angle, f"{joint}_rate": speed}
    return found


def _quintic(travel: float, length: float, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle, speed and acceleration of a rest-to-rest move."""
    share = np.clip(points / length, 0, 1)
    angle = travel * share**3 * (10 - 15 * share + 6 * share**2)
    speed = travel / length * 30 * share**2 * (1 - share) ** 2
    slope = travel / length**2 * (60 * share - 180 * share**2 + 120 * share**3)
    return angle, speed, slope
