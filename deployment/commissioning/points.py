"""Known points that the grab's centre is brought to, and what their touching says of the encoders.

The grab hangs at rest, so its centre is where forward kinematics (fmus/equations/kinematics.py) puts it.  Of
the encoders' angles at each point, least squares find the offset of each that puts the centre nearest to all
points; what is left is the residual.  An offset is what an encoder shows too much, as a zero is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from scipy import optimize, stats

from fmus.equations import kinematics
from specs.errors import InputError
from specs.schema import STRICT, read_toml, validate

JOINTS = ("q_slew", "q_boom", "q_stick")
FEWEST, MOST = 3, 20
WIDE_M = 1.0  # that points must be apart across the line through them
CONFIDENCE = 0.95


@dataclass(frozen=True, kw_only=True)
class Point:
    """A place in the machine's frame, m: x forward at slew angle 0, y left, z up from the ground."""

    __pydantic_config__: ClassVar[Any] = STRICT

    name: str
    x: float
    y: float
    z: float

    @property
    def xyz(self) -> tuple[float, float, float]:
        """x, y, z."""
        return self.x, self.y, self.z

    def __str__(self) -> str:
        return f"{self.name} (x {self.x:.2f}, y {self.y:.2f}, z {self.z:.2f} m)"


@dataclass(frozen=True)
class Fit:
    """By joint: offset and half of its 95 % interval [rad]; distance left at each point [m]."""

    offsets: dict[str, float]
    intervals: dict[str, float]
    residuals: tuple[float, ...]


def read(path: Path) -> tuple[Point, ...]:
    """The `[[point]]` tables of a file; InputError for a wrong file, and for what `check` refuses."""
    data = read_toml(path)
    rows = data.get("point")
    if data.keys() - {"point"} or not isinstance(rows, list):
        raise InputError(f"{path}: needs tables [[point]] with name, x, y, z, and nothing else")
    found = tuple(validate(Point, row, f"{path}: point {k}") for k, row in enumerate(rows, 1))
    check(found, str(path))
    return found


def check(points: Sequence[Point], where: str) -> None:
    """Raise InputError, `where` first, for points that are too few, alike, on one line or out of reach."""
    if not FEWEST <= len(points) <= MOST:
        raise InputError(f"{where}: {len(points)} points; {FEWEST} to {MOST} are needed")
    names = [point.name for point in points]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"{where}: two points called '{twice[0]}'")
    for point in points:
        if reason := kinematics.reachable(*point.xyz, _by_hand()):
            raise InputError(f"{where}: {point}: {reason.removeprefix('target ')}")
    if across(points) < WIDE_M:
        raise InputError(
            f"{where}: the points lie on one line, or nearly: {across(points):.2f} m across it, at least "
            f"{WIDE_M:g} m are needed; take one that is elsewhere"
        )


def across(points: Sequence[Point]) -> float:
    """The largest distance of a point to the line that fits all best, m."""
    places = np.array([point.xyz for point in points])
    centred = places - places.mean(axis=0)
    along = np.linalg.svd(centred)[2][0]
    return float(np.linalg.norm(centred - np.outer(centred @ along, along), axis=1).max())


def fit(points: Sequence[Point], angles: np.ndarray) -> Fit:
    """Offsets of the encoders that showed `angles` (n, 3: slew, boom, stick, rad) at the points."""
    places = np.array([point.xyz for point in points])

    def off(offsets: np.ndarray) -> np.ndarray:
        return (centre(angles - offsets) - places).ravel()

    found = optimize.least_squares(off, np.zeros(3))
    left = off(found.x).reshape(-1, 3)
    free = left.size - 3
    covariance = np.linalg.pinv(found.jac.T @ found.jac) * float(np.sum(left**2)) / free
    half = stats.t.ppf(0.5 + CONFIDENCE / 2, free) * np.sqrt(np.diag(covariance))
    residuals = tuple(np.linalg.norm(left, axis=1).tolist())
    return Fit(_named(found.x), _named(half), residuals)


def odd_one(points: Sequence[Point], angles: np.ndarray, limit_m: float) -> Point | None:
    """The only point without which all others are within `limit_m`; None where there is none, or several."""
    found = []
    for k in range(len(points)):
        others = [point for i, point in enumerate(points) if i != k]
        if max(fit(others, np.delete(angles, k, axis=0)).residuals) <= limit_m:
            found.append(points[k])
    return found[0] if len(found) == 1 else None


def centre(angles: np.ndarray) -> np.ndarray:
    """Where the grab's centre hangs (n, 3) at true angles (n, 3), m."""
    p, (slew, boom, stick) = kinematics.geometry(), angles.T
    return np.stack(kinematics.grab_point(slew, *kinematics.arm_tip(boom, stick, p), p), axis=1)


def _named(values: np.ndarray) -> dict[str, float]:
    return dict(zip(JOINTS, values.tolist(), strict=True))


def _by_hand() -> SimpleNamespace:
    """The geometry without the controller's keep-out: an operator reaches down to the ground."""
    return SimpleNamespace(**{**vars(kinematics.geometry()), "keepout_height": 0.0})
