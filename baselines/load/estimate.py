"""The load from windows: generalised least squares over both joints, with its 95 % interval.

Per window, with the unknowns' covariance P, slopes S = d(y - h m)/d(unknowns) and residual scatter s:

    C = S P S' + diag(s^2),    m = h' C^-1 y / (h' C^-1 h),    variance = 1 / (h' C^-1 h)

Boom and stick are weighed by how far each can be trusted in this pose and motion.  Where they disagree by
more than C allows (something else pulls on the tool), the interval is widened until they agree.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from baselines.load.balance import JOINTS
from baselines.load.calibration import Calibration
from baselines.load.windows import Window, slopes, terms, windows
from records.measurement import Measurement
from specs.errors import InputError

PASSES = 3  # slopes and scatter depend on the load itself


@dataclass(frozen=True)
class Estimate:
    """Load of the window around `time_s` and the half width of its 95 % interval, kg.

    moving     boom, stick or slew move
    sliding    boom or stick move
    joints     whose balance it comes from
    agreement  1 or less: boom and stick agree as well as they should
    """

    time_s: float
    load_kg: float
    half_kg: float
    moving: bool
    sliding: bool
    joints: tuple[str, ...]
    agreement: float

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end of the 95 % interval, kg."""
        return self.load_kg - self.half_kg, self.load_kg + self.half_kg

    def as_dict(self) -> dict[str, Any]:
        """In JSON's own types."""
        low, high = self.interval
        return {
            "time_s": round(self.time_s, 3), "load_kg": self.load_kg, "low_kg": low, "high_kg": high,
            "motion": "moving" if self.moving else "still", "from": list(self.joints),
            "agreement": self.agreement,
        }  # fmt: skip


@dataclass(frozen=True)
class Result:
    """Estimates of a recording's windows, the share of windows and why the others were left out."""

    estimates: tuple[Estimate, ...]
    left_out: dict[str, int]
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """In JSON's own types: `still` and `moving` are of all windows together, `estimates` one by one."""
        found: dict[str, Any] = {}
        for name, moving in (("still", False), ("moving", True)):
            if chosen := [e for e in self.estimates if e.moving is moving]:
                load, low, high = whole(chosen)
                found[name] = {"windows": len(chosen), "load_kg": load, "low_kg": low, "high_kg": high}
        estimates = [e.as_dict() for e in self.estimates]
        return {**found, "left_out": self.left_out, "notes": list(self.notes), "estimates": estimates}


def estimate(recording: Measurement, calibration: Calibration) -> Result:
    """Estimate the load wherever a moment counts.

    Raises InputError where channels are missing that no estimate can do without, or no moment counts.
    """
    found, use = windows(recording)
    left_out: dict[str, int] = {}
    for window in found:
        if window.reason:
            left_out[window.reason.value] = left_out.get(window.reason.value, 0) + 1
    estimates = tuple(of_window(w, calibration) for w in found if w.reason is None)
    if not estimates:
        where = recording.source or "the recording"
        why = "; ".join(f"{r} ({n} windows)" for r, n in sorted(left_out.items(), key=lambda i: -i[1]))
        raise InputError(f"{where}: no moment counts: {why or 'no stretch is long enough'}")
    return Result(estimates, left_out, use.notes)


def of_window(window: Window, calibration: Calibration) -> Estimate:
    """The least squares load of one window."""
    rows = np.flatnonzero(window.joints)
    now, load = terms(window, calibration.values), 0.0
    y, h = now.y[rows], now.h[rows]
    inverse = np.eye(len(rows))
    for _ in range(PASSES):
        slope = slopes(window, calibration.values, load)[rows]
        noise = np.diag(calibration.scatter(window, load)[rows] ** 2)
        inverse = np.linalg.inv(slope @ calibration.covariance @ slope.T + noise)
        load = float(h @ inverse @ y / (h @ inverse @ h))
    rest = y - h * load
    quantile = calibration.quantile(window.moving)
    agreement = float(np.sqrt(rest @ inverse @ rest)) / quantile
    half = quantile * float((h @ inverse @ h) ** -0.5) * max(1.0, agreement)
    names = tuple(JOINTS[i] for i in rows)
    return Estimate(window.time_s, load, half, window.moving, bool(np.any(window.sliding)), names, agreement)


def whole(estimates: Sequence[Estimate]) -> tuple[float, float, float]:
    """(load, low, high) of windows with one and the same load: their median, the median interval around it.

    The interval does not shrink with the number of windows: what they get wrong, they share.
    """
    load = float(np.median([e.load_kg for e in estimates]))
    half = float(np.median([e.half_kg for e in estimates]))
    return load, load - half, load + half
