"""The speed of a joint over its joystick in one direction, from segments of all poses and loads.

    speed = f(command) (1 + a (q - q0) + b (q - q0)² + c (p - p0)) + d ṗ_A + e ṗ_B + noise

f is monotone, smooth over SMOOTH of the joystick and otherwise free.  a and b are the linkage, c what the
load takes from the flow, d and e the oil that gives way while pressures change (a swinging grab does that
all the time).  f and the coefficients are found in turn: local lines and isotonic regression of the corrected
speeds, then least squares with Huber's, later Tukey's weights: where the pump ran short, a segment counts
nothing.  q0 is the median angle of all moving segments; p0 the usual inlet pressure at that command, a
straight line in it: the reference condition of f.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import isotonic_regression

from baselines.arm_velocity.segments import STILL, Segments

BIN = 0.01  # joystick: segments closer than this are taken together
SMOOTH = 0.08  # joystick: half width of the local lines; valves have no finer features but their edge
ROUNDS = 15
HUBER = 1.345  # scaled residual from which a segment counts less, to begin with
TUKEY = 4.685  # and from which it counts nothing; both 95 % efficient for normal noise
RELATIVE, FLOOR = 0.03, 7e-4  # of the speed and rad/s: what a segment's standard error leaves out
ENOUGH = 12  # moving segments a coefficient of the correction is worth asking of
EDGE_SPEED = 0.05  # rad/s: slower knots tell where motion begins
EDGE_KNOTS = 4
PRESSURE = 1e7  # Pa: scale of the pressures' coefficients


@dataclass(frozen=True)
class Samples:
    """Segments of one direction, seen along it: command and speed positive."""

    command: np.ndarray  # [n]
    speed: np.ndarray  # rad/s [n]
    error: np.ndarray  # rad/s [n]
    hold: np.ndarray  # [n], from 0
    bin: np.ndarray  # [n], from 0
    centre: np.ndarray  # [bins], mean command of each bin
    factors: np.ndarray  # [n, k]: columns that scale the speed, 0 at the reference
    terms: np.ndarray  # [n, m]: columns that add to it
    reference: dict[str, float]


@dataclass(frozen=True)
class Curve:
    """`command` [k] over `speed` [k] rad/s at the reference condition, ascending; the first is the edge."""

    speed: np.ndarray
    command: np.ndarray
    bracket: tuple[float, float]  # largest joystick without motion, smallest with
    coefficients: np.ndarray  # of factors, then of terms
    corrected: np.ndarray  # rad/s [n]: each sample's speed, were it at the reference
    residual: np.ndarray  # rad/s [n]
    weight: np.ndarray  # [n], 0 for what does not fit

    @property
    def dead_band(self) -> float:
        """Joystick at which motion begins."""
        return float(self.command[0])

    def at(self, speed: np.ndarray) -> np.ndarray:
        """Joystick for speeds [m] from 0 rad/s; beyond the fastest along the last stretch, at most 1."""
        inside = np.interp(speed, self.speed, self.command)
        rise = np.diff(self.command[-2:]) / np.diff(self.speed[-2:])
        beyond = self.command[-1] + rise * np.maximum(speed - self.speed[-1], 0.0)
        return np.minimum(np.where(speed > self.speed[-1], beyond, inside), 1.0)


def samples(segments: Segments, direction: int, angle: float) -> Samples:
    """The segments driven in `direction` (1, -1); `angle` is the reference q0 [rad]."""
    s = segments[np.sign(segments.command) == direction]
    command, speed = direction * s.command, direction * s.speed
    moving = speed > STILL
    off = s.angle - angle
    columns, reference = [off, off**2], {"angle_rad": angle}
    known = np.isfinite(s.inlet)
    if np.count_nonzero(known & moving) >= ENOUGH:
        line = np.polyfit(command[known & moving], s.inlet[known & moving], 1)
        columns.append(np.where(known, s.inlet - np.polyval(line, command), 0.0) / PRESSURE)
        reference["inlet_pressure_at_half_pa"] = float(np.polyval(line, 0.5))
        reference["inlet_pressure_per_joystick_pa"] = float(line[0])
    factors = _varying(columns, moving, int(np.count_nonzero(moving)) // ENOUGH)
    rates = [np.where(np.isfinite(r), direction * r, 0.0) / PRESSURE for r in (s.rate_a, s.rate_b)]
    terms = _varying(rates, np.ones(len(s), dtype=bool), len(s) // ENOUGH)
    holds = np.unique(s.hold, return_inverse=True)[1]
    bins = np.unique(np.round(command / BIN), return_inverse=True)[1]
    centre = np.bincount(bins, command) / np.maximum(np.bincount(bins), 1)
    return Samples(command, speed, s.error, holds, bins, centre, factors, terms, reference)


def _varying(columns: list[np.ndarray], where: np.ndarray, most: int) -> np.ndarray:
    """The first `most` of those columns that are not constant, as [n, k]."""
    useful = [c for c in columns if where.any() and np.ptp(c[where]) > 1e-9][: max(most, 0)]
    return np.column_stack(useful) if useful else np.zeros((len(where), 0))


def fit(data: Samples, counts: np.ndarray | None = None, start: Curve | None = None) -> Curve:
    """Find curve and correction; `counts` [n] says how often each sample is taken (default: once).

    `start` gives coefficients and weights to go on from, which takes fewer rounds.
    """
    counts = np.ones(len(data.speed)) if counts is None else counts
    k = data.factors.shape[1]
    coefficients = start.coefficients if start else np.zeros(k + data.terms.shape[1])
    weight = start.weight if start else np.ones(len(data.speed))
    monotone = np.zeros(len(data.speed))
    rounds = range(ROUNDS - 4 if start else 0, ROUNDS)
    for number in rounds:
        corrected = _corrected(data, coefficients)
        expected = np.hypot(data.error, np.hypot(FLOOR, RELATIVE * monotone))
        share = counts * weight / expected**2
        means, mass = bin_means(data, corrected, share)
        lines = _local_lines(data.centre, mass, means > STILL)
        means = lines @ means
        monotone = np.maximum(_isotonic(means, mass), 0.0)[data.bin]
        design = np.hstack([data.factors * monotone[:, None], data.terms])
        coefficients = _coefficients(data, design, share, lines)
        residual = data.speed - monotone - design @ coefficients
        weight = _weights(residual / expected, counts, number < ROUNDS / 2)
    speed, command, still = _knots(data.centre, means, mass)
    bracket = (min(still, command[0]), float(command[min(1, len(command) - 1)]))
    speeds = _corrected(data, coefficients)
    return Curve(speed, command, bracket, coefficients, speeds, residual, weight)


def _corrected(data: Samples, coefficients: np.ndarray) -> np.ndarray:
    """Speeds [n] at the reference condition, rad/s."""
    k = data.factors.shape[1]
    factor = np.clip(1.0 + data.factors @ coefficients[:k], 0.3, 3.0)
    return (data.speed - data.terms @ coefficients[k:]) / factor


def bin_means(data: Samples, speed: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of `speed` and sum of `share` of each bin; a bin without share has mean 0."""
    mass = np.bincount(data.bin, share)
    return np.bincount(data.bin, share * speed) / np.maximum(mass, 1e-300), mass


def _local_lines(centre: np.ndarray, mass: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Matrix [bins, bins] that replaces means of moving bins by lines through their neighbours."""
    matrix = np.eye(len(centre))
    at = np.flatnonzero((mass > 0) & moving)
    off = (centre[at][None, :] - centre[at][:, None]) / SMOOTH
    share = mass[at] * np.maximum(1.0 - np.abs(off) ** 3, 0.0) ** 3
    s0, s1, s2 = (np.sum(share * off**k, axis=1, keepdims=True) for k in range(3))
    determinant = s0 * s2 - s1**2
    alone = determinant <= 1e-9 * s0**2
    lines = np.where(alone, share / s0, share * (s2 - s1 * off) / np.where(alone, 1.0, determinant))
    matrix[np.ix_(at, at)] = lines
    return matrix


def _isotonic(means: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Non-descending values closest to `means` [bins]; a bin without mass takes its neighbours'."""
    filled = np.flatnonzero(mass > 0)
    values = isotonic_regression(means[filled], weights=mass[filled]).x
    return np.interp(np.arange(len(means)), filled, values)


def _coefficients(data: Samples, design: np.ndarray, share: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Coefficients of `design` [n, k], drawn a little towards 0: what the data do not tell stays there.

    Fast motion goes further, so the angle is no stranger to the command.  What all segments of about the same
    command have in common is f's: only what is left of speed and design enters (Robinson, Econometrica 1988).
    """
    if not design.shape[1]:
        return np.zeros(0)
    columns = np.column_stack([data.speed, design])
    common = np.column_stack([bin_means(data, column, share)[0] for column in columns.T])
    left = (columns - (lines @ common)[data.bin]) * np.sqrt(share)[:, None]
    wanted, scaled = left[:, 0], left[:, 1:]
    normal = scaled.T @ scaled
    return np.linalg.solve(normal + 1e-6 * np.diag(np.diag(normal) + 1e-12), scaled.T @ wanted)


def _weights(scaled: np.ndarray, counts: np.ndarray, gentle: bool) -> np.ndarray:
    """Weights [n] for residuals over their expected size: Huber's while `gentle`, then Tukey's."""
    size = max(1.4826 * float(np.median(np.abs(scaled[counts > 0]))), 1e-6)
    far = np.abs(scaled) / size
    if gentle:
        return np.minimum(1.0, HUBER / np.maximum(far, 1e-9))
    return np.maximum(1.0 - (far / TUKEY) ** 2, 0.0) ** 2


def _knots(centre: np.ndarray, means: np.ndarray, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """(speeds, commands) where motion begins, then of each isotonic step; the largest command at rest."""
    filled = mass > 0
    found = isotonic_regression(means[filled], weights=mass[filled])
    commands, level = centre[filled], mass[filled]
    begin, end = found.blocks[:-1], found.blocks[1:]
    command = np.array(
        [np.average(commands[a:b], weights=level[a:b]) for a, b in zip(begin, end, strict=True)]
    )
    speed = found.x[begin]
    moving = speed > STILL
    at_rest = speed <= FLOOR  # between this and STILL it creeps
    still = float(commands[end[at_rest] - 1].max()) if at_rest.any() else 0.0
    return *_with_edge(speed[moving], command[moving], still), still


def _with_edge(speed: np.ndarray, command: np.ndarray, still: float) -> tuple[np.ndarray, np.ndarray]:
    """Knots with the beginning of motion before them: a line through the slowest, not below `still`."""
    if not len(speed):
        return np.zeros(1), np.ones(1)
    edge = command[0]
    if len(speed) > 1:
        slow = slice(0, max(2, min(EDGE_KNOTS, int(np.count_nonzero(speed <= EDGE_SPEED)))))
        edge = np.polyval(np.polyfit(speed[slow], command[slow], 1), 0.0)
    edge = float(np.clip(edge, min(max(still, 0.0), command[0]), command[0]))
    return np.concatenate([[0.0], speed]), np.concatenate([[edge], command])
