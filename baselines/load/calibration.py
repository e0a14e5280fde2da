"""Calibration: the machine's own figures from recordings with a known load (an empty grab: a tare).

Weighted least squares over the windows of all recordings, with what is known before as further equations:

    min  sum |y(x) - h(x) m_known|^2 / s^2  +  sum (x - x_nominal)^2 / sd^2            x: the unknowns

(Gauss-Newton; s is the residual scatter itself, per joint, still and moving, found along the way.)  The
result carries its covariance: an estimate's interval is wider where the machine was not calibrated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import stdtrit

from baselines.load.balance import figures, unknowns
from baselines.load.windows import Window, slopes, terms, windows
from records.measurement import Measurement
from specs.errors import InputError

ITERATIONS = 4
FEWEST = 5  # windows, fewer are no calibration
ALIKE = 4.0  # windows of one pose and motion err alike: so many count as one
PRIOR_WINDOWS = 5  # what is assumed about the scatter before counts as so many windows
GROWTH = (1.0, 0.5)  # powers of the hanging mass with which the scatter grows: still, moving
Known = list[tuple[Window, float]]  # windows and their loads, kg


@dataclass(frozen=True)
class Calibration:
    """Unknowns `values` [n] with `covariance` [n, n], and the balance's residual scatter.

    residual   [2, 2] N m, empty: joint; still, moving
    freedom    [2] degrees of freedom of the scatter: still, moving
    recordings what it comes from
    """

    values: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    freedom: np.ndarray
    recordings: tuple[Mapping[str, Any], ...] = ()

    def scatter(self, window: Window, load: float) -> np.ndarray:
        """Residual standard deviation [2] (N m) of a window's joints with `load` kg in the grab.

        At rest it is the swinging tool that moves the cylinders by less than the encoders see, so that
        friction takes part of what hangs on the arm; in motion it is also the friction itself, which does
        not grow with the load.
        """
        return self.residual[:, int(window.moving)] * _growth(window, load)

    def quantile(self, moving: bool) -> float:
        """Half width of a 95 % interval in standard deviations (Student's t)."""
        return float(stdtrit(self.freedom[int(moving)], 0.975))


def uncalibrated() -> Calibration:
    """Nominal figures with the spreads of the machine draws."""
    g = figures()
    residual = np.tile([g.load_estimate_residual_still, g.load_estimate_residual_moving], (2, 1))
    values = np.array([u.value for u in unknowns()])
    freedom = np.full(2, float(PRIOR_WINDOWS))
    return Calibration(values, np.diag([u.sd**2 for u in unknowns()]), residual, freedom)


def calibrate(recordings: Sequence[Measurement], loads: Sequence[float]) -> Calibration:
    """Find the unknowns from recordings with known loads (kg), one each.

    Raises InputError where a recording lacks channels or too few of its windows count.
    """
    start = found = uncalibrated()
    known: Known = []
    listed = []
    for recording, load in zip(recordings, loads, strict=True):
        used = _used(recording)
        known += [(window, load) for window in used]
        listed.append({"source": recording.source, "load_kg": load, "windows": len(used)})
    for _ in range(ITERATIONS):
        found = _improved(known, found, start)
    return Calibration(found.values, found.covariance, found.residual, found.freedom, tuple(listed))


def _used(recording: Measurement) -> list[Window]:
    used = [w for w in windows(recording, overlap=False)[0] if w.reason is None]
    if len(used) < FEWEST:
        raise InputError(
            f"{recording.source or 'the recording'}: {len(used)} windows of "
            f"{figures().load_estimate_window:g} s count, {FEWEST} are needed; "
            "drive to several poses and rest in each"
        )
    return used


def _improved(known: Known, now: Calibration, start: Calibration) -> Calibration:
    """One Gauss-Newton step."""
    information = np.linalg.inv(start.covariance)
    right = information @ (start.values - now.values)
    errors = np.full((len(known), 2), np.nan)
    for i, (window, load) in enumerate(known):
        found = terms(window, now.values)
        error, slope = found.y - found.h * load, slopes(window, now.values, load)
        weight = np.where(window.joints, now.scatter(window, load) ** -2.0, 0.0) / ALIKE
        information += (slope.T * weight) @ slope
        right -= (slope.T * weight) @ error
        errors[i, window.joints] = error[window.joints] / _growth(window, load)
    covariance = np.linalg.inv(information)
    moving = np.array([window.moving for window, _ in known])
    return Calibration(now.values + covariance @ right, covariance, *_scatter(errors, moving, start))


def _growth(window: Window, load: float) -> float:
    """How much larger the scatter is than with an empty grab."""
    return float((1.0 + max(load, 0.0) / figures().tool_mass) ** GROWTH[int(window.moving)])


def _scatter(errors: np.ndarray, moving: np.ndarray, start: Calibration) -> tuple[np.ndarray, np.ndarray]:
    """(residual [2, 2], freedom [2]) from the `errors` [windows, 2] (NaN: not used) of an empty grab."""
    residual, freedom = np.zeros((2, 2)), np.zeros(2)
    for kind in range(2):
        chosen = errors[moving == bool(kind)]
        n = np.count_nonzero(np.isfinite(chosen), axis=0)
        total = PRIOR_WINDOWS * start.residual[:, kind] ** 2 + np.nansum(chosen**2, axis=0)
        residual[:, kind] = np.sqrt(total / (PRIOR_WINDOWS + n))
        freedom[kind] = PRIOR_WINDOWS + len(chosen) / ALIKE
    return residual, freedom


def known_loads(loads: list[float], count: int) -> list[float]:
    """The load of each of `count` recordings in kg, from one for all or one for each."""
    if len(loads) == 1:
        loads = loads * count
    if len(loads) != count:
        raise InputError(f"{len(loads)} loads for {count} recordings; give --load once, or once a recording")
    for value in loads:
        if not 0.0 <= value <= 20000.0:
            raise InputError(f"--load {value:g}: a load is 0 to 20000 kg")
    return loads
