"""`slewright calibrate lut`: 25-point tables, velocity to joystick, from recorded sweeps of any machine.

Steady segments (segments.py) give a monotone curve for each direction (valve_curve.py); read at the 25 even
velocities of -0.2..0.2 rad/s it is the table.  Uncertainties are bootstrapped over holds: what one hold of
the joystick gave is taken together, since its segments share pose, load and swing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import isotonic_regression

from baselines.arm_velocity import sensor_checks
from baselines.arm_velocity.calibrate import LIMIT
from baselines.arm_velocity.model import POINTS
from baselines.arm_velocity.segments import STILL, Segments, find
from baselines.arm_velocity.valve_curve import Curve, Samples, fit, samples
from records.measurement import Measurement
from specs.errors import InputError

DIRECTIONS = {1: "positive", -1: "negative"}
BOOTSTRAPS = 200
QUANTILES = (0.025, 0.975)
FULL = 0.99  # joystick: a machine driven this far has shown its fastest
WIDEST = 0.1  # joystick, width of the 95 % interval from which a point lacks data
REVERSAL = 0.01  # rad/s that a bin may lie off the monotone curve, and
REVERSAL_ERRORS = 5.0  # as many standard errors
REPAIRED = 0.1  # share of the segments that may lie further off
GRID = np.linspace(-LIMIT, LIMIT, POINTS)  # rad/s


@dataclass(frozen=True)
class Lacking:
    """A point of the table that the recordings say too little of."""

    velocity: float  # rad/s
    why: str
    drive: str  # what to record for it


@dataclass(frozen=True)
class DeadBand:
    """Joystick at which motion begins in one direction, always positive, with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Table:
    """What the recordings say of a joint."""

    joint: str
    command: np.ndarray  # [25] at GRID; NaN on a side that was never driven
    low: np.ndarray  # [25] 95 % interval
    high: np.ndarray
    error: np.ndarray  # [25] standard error
    dead_band: dict[str, DeadBand]  # by direction
    reference: dict[str, dict[str, float]]  # condition that the table is for, by direction
    spread: dict[str, float]  # standard deviation of the speed over recorded poses and loads, relative
    lacking: tuple[Lacking, ...]
    out_of_reach: tuple[float, ...]  # rad/s: the machine was at full joystick and did not go that fast
    segments: Segments
    curves: dict[str, tuple[Samples, Curve]]
    unsteady: int
    notes: tuple[str, ...]


def calibrate(
    recordings: Sequence[Measurement], joints: Sequence[str], seed: int = 1, bootstraps: int = BOOTSTRAPS
) -> dict[str, Table]:
    """A table for each of `joints` from all recordings that have its channels.

    Raises InputError naming what is missing or unusable, and where.
    """
    usable = sensor_checks.channels(recordings, joints)
    return {joint: make_table(usable[joint], joint, seed, bootstraps) for joint in joints}


def make_table(
    recordings: Sequence[Measurement], joint: str, seed: int = 1, bootstraps: int = BOOTSTRAPS
) -> Table:
    """The table of one joint; `seed` is of the bootstrap."""
    found = find(recordings, joint)
    _check_sign(recordings, joint, found.segments)
    moving = np.abs(found.segments.speed) > STILL
    angle = float(np.median(found.segments.angle[moving]))
    sides = {}
    for direction in DIRECTIONS:
        data = samples(found.segments, direction, angle)
        if np.count_nonzero(data.speed > STILL) > 1:
            curve = fit(data)
            _check_monotone(recordings, found.segments, joint, direction, data, curve)
            sides[direction] = (data, curve, _bootstrap(data, curve, seed, bootstraps))
    return _assemble(joint, found.segments, sides, found.unsteady, found.notes)


Side = tuple[Samples, Curve, np.ndarray]  # bootstrap: [bootstraps, 1 + points], dead band first


DRAWS = 5  # tries for each bootstrap draw: one without motion says nothing


def _speeds() -> np.ndarray:
    """Speeds of the table in one direction, rad/s [12]."""
    return GRID[POINTS // 2 + 1 :]


def _bootstrap(data: Samples, curve: Curve, seed: int, count: int) -> np.ndarray:
    """[count, 1 + 12]: dead band and commands, from holds drawn with replacement."""
    random = np.random.default_rng(seed)
    holds = int(data.hold.max()) + 1
    found = []
    for _ in range(DRAWS * count):
        if len(found) == count:
            break
        counts = np.bincount(random.integers(holds, size=holds), minlength=holds)[data.hold].astype(float)
        if np.count_nonzero((data.speed > STILL) & (counts > 0)) < 2:
            continue
        again = fit(data, counts, curve)
        if len(again.speed) >= 2:
            found.append(np.concatenate([[again.dead_band], again.at(_speeds())]))
    if len(found) < count:
        raise InputError(
            f"{holds} holds move the joint too seldom for an interval: hold more joystick values, each way"
        )
    return np.array(found)


def _assemble(
    joint: str, segments: Segments, sides: dict[int, Side], unsteady: int, notes: tuple[str, ...]
) -> Table:
    values = {name: np.full(POINTS, np.nan) for name in ("command", "low", "high", "error")}
    for side in values.values():
        side[POINTS // 2] = 0.0
    lacking: list[Lacking] = []
    beyond: list[float] = []
    for direction in (-1, 1):
        at = slice(POINTS // 2 + 1, None) if direction > 0 else slice(POINTS // 2 - 1, None, -1)
        if direction not in sides:
            lacking += [_never_driven(joint, direction, v) for v in _speeds()]
            continue
        data, curve, repeats = sides[direction]
        low, high = np.quantile(repeats[:, 1:], QUANTILES, axis=0)
        values["command"][at] = direction * curve.at(_speeds())
        values["low"][at], values["high"][at] = (low, high) if direction > 0 else (-high, -low)
        values["error"][at] = repeats[:, 1:].std(axis=0)
        few, far = _gaps(joint, direction, data, curve, high - low)
        lacking += few
        beyond += far
    return Table(
        joint=joint,
        **values,
        dead_band={DIRECTIONS[d]: _dead_band(side) for d, side in sides.items()},
        reference={DIRECTIONS[d]: side[0].reference for d, side in sides.items()},
        spread={DIRECTIONS[d]: _spread(side[0], side[1]) for d, side in sides.items()},
        lacking=tuple(sorted(lacking, key=lambda point: point.velocity)),
        out_of_reach=tuple(sorted(beyond)),
        segments=segments,
        curves={DIRECTIONS[d]: side[:2] for d, side in sides.items()},
        unsteady=unsteady,
        notes=notes,
    )


def _dead_band(side: Side) -> DeadBand:
    """With an interval no narrower than the levels between which motion was seen to begin."""
    curve = side[1]
    low, high = np.quantile(side[2][:, 0], QUANTILES)
    return DeadBand(curve.dead_band, min(float(low), curve.bracket[0]), max(float(high), curve.bracket[1]))


def _spread(data: Samples, curve: Curve) -> float:
    """How much pose and load move the speed at the same joystick: a standard deviation, relative."""
    k = data.factors.shape[1]
    return float(np.std((data.factors @ curve.coefficients[:k])[data.speed > STILL]))


def _never_driven(joint: str, direction: int, speed: float) -> Lacking:
    way = DIRECTIONS[direction]
    return Lacking(
        direction * float(speed),
        f"no motion in the {way} direction was recorded",
        f"hold u_{joint} at {direction * 0.1:+.2f}, {direction * 0.15:+.2f} … {direction:+.2f}, 3 s each",
    )


def _gaps(
    joint: str, direction: int, data: Samples, curve: Curve, width: np.ndarray
) -> tuple[list[Lacking], list[float]]:
    """Points without segments between their neighbours or with a wide interval; and those out of reach."""
    step = GRID[1] - GRID[0]
    few, far = [], []
    usual, fastest = curve.corrected[curve.weight > 0.2], curve.speed[-1]
    for speed, command, wide in zip(_speeds(), curve.at(_speeds()), width, strict=True):
        near = np.count_nonzero(np.abs(usual - speed) < step)
        if speed > fastest and data.command.max() >= FULL:
            far.append(direction * float(speed))
        elif near < 2 or wide > WIDEST or speed > fastest + step / 2:
            why = f"{near} segments near it" if near < 2 else f"95 % interval {wide:.2f} wide"
            low, high = max(command - 0.05, 0.0), min(command + 0.05, 1.0)
            levels = f"{direction * low:+.2f} … {direction * high:+.2f}"
            drive = f"hold u_{joint} at {levels}, 3 s each, in several poses"
            few.append(Lacking(direction * float(speed), why, drive))
    return few, far


def _check_monotone(
    recordings: Sequence[Measurement],
    segments: Segments,
    joint: str,
    direction: int,
    data: Samples,
    curve: Curve,
) -> None:
    """InputError where more corrected speeds fall with the joystick than a repair may hide."""
    count = np.bincount(data.bin)
    weight = curve.weight + 1e-6  # a bin in which nothing fits has a level, too
    levels = np.bincount(data.bin, weight * curve.corrected) / np.bincount(data.bin, weight)
    repaired = isotonic_regression(levels, weights=count).x
    scatter = 1.4826 * float(np.median(np.abs(curve.residual)))
    excess = np.abs(levels - repaired) - np.maximum(REVERSAL, REVERSAL_ERRORS * scatter / np.sqrt(count))
    if np.sum(count[excess > 0]) <= REPAIRED * len(data.speed):
        return
    here = data.bin == int(np.argmax(excess))
    chosen = segments[np.sign(segments.command) == direction]
    where = recordings[int(chosen.recording[here][0])].source
    raise InputError(
        f"{where}: the sweep of the {joint} is not monotone even after repair: at u_{joint} = "
        f"{direction * data.command[here][0]:+.2f} ({chosen.start_s[here][0]:.1f} s) it goes "
        f"{levels[data.bin[here][0]]:.3f} rad/s where the others say {repaired[data.bin[here][0]]:.3f}; "
        "look for another function in use or a blocked joint"
    )


def _check_sign(recordings: Sequence[Measurement], joint: str, segments: Segments) -> None:
    """InputError when the joint goes against its joystick."""
    moving = np.abs(segments.speed) > STILL
    with_it = float(np.mean(np.sign(segments.command) == np.sign(segments.speed), where=moving))
    if with_it < 0.5:
        raise InputError(
            f"{recordings[0].source}: q_{joint} goes against u_{joint} in {1 - with_it:.0%} of its motion; "
            "turn the sign of one of them"
        )
