"""What limits the estimate: kilograms that one standard deviation of each unknown moves it by.

At rest, empty, at a pose: the least squares weights g = C^-1 h / (h' C^-1 h) turn an error d of an unknown
into -g' S d kilograms.  Uncalibrated, this says which figure of the machine is worth knowing; calibrated,
what is left of it (errors of different unknowns then cancel in part: `total` is less than their sum).
"""

from collections.abc import Sequence

import numpy as np

from baselines.load.balance import Seen, unknowns
from baselines.load.calibration import Calibration
from baselines.load.windows import Window, slopes, terms

POSE = (1.1, -1.2)  # rad, boom and stick: middle of the pose range


def window(pose: Sequence[float] = POSE) -> Window:
    """A machine that stands in `pose` (boom, stick: rad), last moved upwards, tool hanging."""
    q = np.array([[0.0], [pose[0]], [pose[1]], [0.0], [0.0]])
    none, pair = np.zeros((5, 1)), np.zeros((2, 1))
    seen = Seen(q, none, none, np.zeros((4, 1)), pair, pair, np.ones((2, 1)))
    return Window(0.0, seen, np.array([True, True]), False, None)


def influence(calibration: Calibration, pose: Sequence[float] = POSE) -> dict[str, float]:
    """Standard deviation (kg) that each unknown, all together and the residual scatter put on an estimate."""
    at = window(pose)
    slope, h = slopes(at, calibration.values, 0.0), terms(at, calibration.values).h
    noise = calibration.scatter(at, 0.0)
    inverse = np.linalg.inv(slope @ calibration.covariance @ slope.T + np.diag(noise**2))
    weights = inverse @ h / (h @ inverse @ h)
    shares = weights @ slope
    found = np.abs(shares) * np.sqrt(np.diag(calibration.covariance))
    single = dict(zip((u.name for u in unknowns()), found.tolist(), strict=True))
    total = float(np.sqrt(shares @ calibration.covariance @ shares))
    return {**single, "total": total, "scatter": float(np.sqrt(np.sum((weights * noise) ** 2)))}
