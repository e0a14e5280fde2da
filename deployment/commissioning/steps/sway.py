"""The tool's sway: period of pitch and roll, and with it the pendulum's length; its angle against its rate.

A short motion sets it swinging, then everything stands and the swing is looked at until it has decayed.
"""

import math

import numpy as np
from scipy.signal import savgol_filter

from deployment.commissioning import drive
from deployment.commissioning.bench import Bench
from deployment.commissioning.steps.safety import hold, release
from runtime.image import TICK_S

MOVED_BY = {"roll": "slew", "pitch": "stick"}
AXIS = {"roll": "x", "pitch": "y"}
WAYS = {"slew": "right", "stick": "in"}


def run(bench: Bench) -> None:
    """Roll by the slew, pitch by the stick."""
    for angle, axis in MOVED_BY.items():
        _swing(bench, angle, axis)
    bench.verdict()


def _swing(bench: Bench, angle: str, axis: str) -> None:
    f, rig = bench.f, bench.rig
    hold(bench)
    level = bench.before[axis][f"breakaway {WAYS[axis]}"] + f.commissioning_sway_above
    drive.alone(bench, axis, level)
    rig.watch = drive.Guard(bench, axis, f.commissioning_furthest)
    drive.begin(bench, axis, -1.0)
    rig.wanted = drive.command(axis, -level)
    bench.wait(f.commissioning_sway_push)
    drive.stop(bench, f.commissioning_coast)
    bench.neutral()
    release(bench)
    free = bench.wait(f.commissioning_sway)
    swing = free[f"imu_tool_{angle}"] - np.mean(free[f"imu_tool_{angle}"])
    size = float(np.sqrt(2.0) * np.std(swing))
    look = "the tool was held or stood still; more room for a stronger push"
    bench.between(f"{angle}: amplitude", size, f.commissioning_sway_least, 0.8, "rad", look)
    period = _period(np.asarray(savgol_filter(swing, 15, 2)))
    low, high = f.commissioning_period_low, f.commissioning_period_high
    bench.between(
        f"{angle}: period", period, low, high, "s", "what hangs on the arm; the tool IMU's rate in Hz"
    )
    rate = float(np.sqrt(2.0) * np.std(free[f"imu_tool_rate_{AXIS[angle]}"]))
    ratio, share = rate * period / (2 * math.pi * size), f.commissioning_agreement
    bench.between(
        f"{angle}: rate over angle", ratio, 1 - share, 1 + share, "", "scale of the tool IMU's angles"
    )
    bench.found |= {f"period of the {angle}": period, f"length of the {angle}": _length(bench, period)}


def _period(swing: np.ndarray) -> float:
    """Mean time between two upward passages, s; NaN with less than three."""
    ups = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
    exact = ups + swing[ups] / (swing[ups] - swing[ups + 1])
    return float((exact[-1] - exact[0]) / (len(exact) - 1) * TICK_S) if len(exact) > 2 else float("nan")


def _length(bench: Bench, period: float) -> float:
    """Of a mathematical pendulum with this period, m."""
    return float(bench.f.gravity * (period / (2 * math.pi)) ** 2)
