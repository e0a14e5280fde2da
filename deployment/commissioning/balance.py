"""What the cylinders' pressures say is in the grab, by the load estimate's torque balance, joint by joint.

With an empty grab it must be about nothing; a pressure sensor that is swapped or scaled is off by tons.
"""

from collections.abc import Mapping

import numpy as np

from baselines.load.balance import JOINTS
from baselines.load.calibration import uncalibrated
from baselines.load.windows import terms, windows
from deployment.commissioning.rig import Trace
from records.measurement import Channel, Measurement
from runtime.image import INPUT

CHANNELS = (
    *(f"q_{j}" for j in ("slew", *JOINTS)), *(f"qd_{j}" for j in ("slew", *JOINTS)),
    *(f"p_{j}_{s}" for j in JOINTS for s in "ab"),
    "imu_cabin_roll", "imu_cabin_pitch", "imu_tool_roll", "imu_tool_pitch",
)  # fmt: skip


def measurement(trace: Trace, zeros: Mapping[str, float] | None = None) -> Measurement:
    """A trace as a recording of its sensors, less their `zeros`."""
    off = zeros or {}
    channels = {
        n: Channel(n, INPUT.signals[INPUT.index[n]].unit, trace.time, trace[n] - off.get(n, 0.0))
        for n in CHANNELS
    }
    return Measurement(channels, None, {}, "commissioning")


def at_rest(trace: Trace) -> dict[str, float]:
    """kg that each joint's pressures carry beyond the nominal empty machine; NaN where unknown."""
    recording = measurement(trace)
    values = uncalibrated().values
    found: dict[str, list[float]] = {joint: [] for joint in JOINTS}
    for window in windows(recording)[0]:
        if window.reason is not None or window.moving:
            continue
        balance = terms(window, values)
        for i, joint in enumerate(JOINTS):
            if window.joints[i]:
                found[joint].append(float(balance.y[i] / balance.h[i]))
    return {joint: float(np.median(some)) if some else float("nan") for joint, some in found.items()}
