"""Recordings from which nothing can be learned are refused, with what is wrong and what to drive instead."""

from collections.abc import Sequence

import numpy as np

from learning.slew.trajectory import Trajectory
from specs.errors import InputError
from specs.signals import signal

LEAST_LEVELS = 3  # different joystick values
MOST_JOYSTICK = 1.02  # beyond it is no share of the full joystick
MOVES = 0.01  # rad/s: less is no motion
LEAST_MOVING = 0.05  # share of the time
MOST_SATURATED = 0.02  # share of samples at the end of a sensor's range
END = 1e-3  # share of the range that counts as its end
CHANNELS = {"omega": "qd_slew", "p_l": "p_slew_b", "p_r": "p_slew_a"}


def check(chosen: Sequence[Trajectory]) -> None:
    """InputError when joystick or machine hardly move, or a sensor stands at the end of its range."""
    for trajectory in chosen:
        _check_joystick(trajectory)
    u = np.concatenate([t.u for t in chosen])
    if len(np.unique(np.round(u, 3))) < LEAST_LEVELS:
        raise InputError(
            f"constant excitation: u_slew has fewer than {LEAST_LEVELS} values ({u.min():g} … {u.max():g}); "
            "drive steps, sines and trapezoids of several sizes, both ways"
        )
    omega = np.concatenate([t.omega for t in chosen])
    if np.mean(np.abs(omega) > MOVES) < LEAST_MOVING:
        raise InputError(
            f"the joystick never leaves the dead band: |u_slew| up to {np.abs(u).max():.2f}, but qd_slew "
            f"moves (> {MOVES} rad/s) in {100 * np.mean(np.abs(omega) > MOVES):.1f} % of the time only"
        )
    for name, channel in CHANNELS.items():
        _check_range(channel, [getattr(t, name) for t in chosen], [t.name for t in chosen])


def _check_joystick(trajectory: Trajectory) -> None:
    most = float(np.abs(trajectory.u).max())
    if most > MOST_JOYSTICK:
        raise InputError(
            f"{trajectory.name}: |u_slew| is up to {most:.3g}; valid is -1 … 1. If it is in %, say so: "
            "slewright convert --map (docs/reference/recordings.md)"
        )


def _check_range(channel: str, values: Sequence[np.ndarray], names: Sequence[str]) -> None:
    known = signal(channel)
    low, high = known.min or 0.0, known.max or 0.0  # both are there: the signal has a place on the bus
    margin = END * (high - low)
    for one, name in zip(values, names, strict=True):
        if not np.isfinite(one).all():
            raise InputError(
                f"{name}: {channel} is not a number at {int(np.argmin(np.isfinite(one))) / 10:g} s"
            )
        share = float(np.mean((one >= high - margin) | (one <= low + margin)))
        stuck = _stuck(one)
        if max(share, stuck) > MOST_SATURATED:
            what = f"at the end of its range {low:g} … {high:g} {known.unit}"
            what = what if share > stuck else f"cut off at {one[np.argmax(np.abs(one))]:g} {known.unit}"
            raise InputError(f"{name}: {channel} is saturated: {100 * max(share, stuck):.0f} % {what}")


def _stuck(values: np.ndarray) -> float:
    """Share of samples in runs of three or more equal to the largest size: a sensor that is cut off."""
    at = np.abs(values) >= np.abs(values).max()
    runs = at[:-2] & at[1:-1] & at[2:]
    return float(runs.mean()) if np.abs(values).max() > 0 else 0.0
