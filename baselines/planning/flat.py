"""The arm's motion that leads a hanging grab along a path without a swing beside it.

A pendulum of length l at the end of a tip that moves level hangs below a point that is l / g times its own
acceleration away: tip = grab + (l / g) grab''.  So the grab is put on the path, and the arm where the tip is
to be (flatness; sources: baselines/plan/README.md).
"""

import numpy as np

from baselines.planning.path import TICK_S, Path, of_angles
from fmus.equations import kinematics


def flat(angles: np.ndarray, length: float) -> np.ndarray:
    """Slew, boom and stick (n, 3) for which a pendulum of this `length` [m] hangs on the path of `angles`."""
    p = kinematics.geometry()
    slew, boom, stick = angles.T
    radius, height = kinematics.arm_tip(boom, stick, p)
    x, y, z = kinematics.grab_point(slew, radius, height, p)
    x, y = (v + length / p.gravity * _twice(v) for v in (x, y))
    turned, *arm = kinematics.inverse(x, y, z, p)
    return np.stack([slew + np.angle(np.exp(1j * (turned - slew))), *arm], axis=1)


def led(path: Path, length: float) -> Path:
    """The same path for a grab on a pendulum of this `length` [m]."""
    return of_angles(flat(path.angles, length), path.targets, path.tolerance_m, path.there)


def _twice(values: np.ndarray) -> np.ndarray:
    """The second derivative, 0 at both ends, where the path rests."""
    found = np.zeros_like(values)
    found[1:-1] = (values[2:] - 2 * values[1:-1] + values[:-2]) / TICK_S**2
    return found
