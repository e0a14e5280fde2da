"""The motion of a part as its neighbours feel it: recorded, without what its sensors add, and smoothed.

A recording has the noise, delay and errors of its sensors; a neighbour feels the true motion.  The fitted
part knows its sensors' own effects: they are taken off.  What is left is a motion with random jerk and noise.
"""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np
from scipy.interpolate import CubicSpline

from reconcile.filter.point import Point
from reconcile.recordings.data import Run
from reconcile.recordings.noise import high_pass_level
from reconcile.search.core import Core

HALF_WIDTH = 5  # samples each side that smoothing looks at
LEAST = 1e-6  # rad, rad/s: noise of a recording without any
JERKS = tuple(0.003 * 3.0**k for k in range(9))  # rad/s3 times root of s, tried
GYROS = {"qd_slew": "imu_cabin_rate_z"}  # a rate, and the gyroscope that sees it too
PAIRS = {"q_slew": "qd_slew", "q_boom": "qd_boom", "q_stick": "qd_stick"}  # angle and its rate


def of_part(core: Core, point: Point, run: Run, wanted: Sequence[str]) -> dict[str, np.ndarray] | None:
    """Angles and rates among `wanted` at the angles' sample times, each [n]; None if it runs away.

    `run` is one of the recordings of `core`, by its name.
    """
    record = next(r for r in core.records if r.run.name == run.name)
    each = [np.arange(len(record.time))]  # one step of the model from every filtered state
    found = core.kalman.over([record]).run(point.values, point.present, windows=each, own=True)
    one = found[0] if found else None
    if one is None or one.y is None or one.free is None or one.zfree is None:
        return None
    moved = dict(zip(core.outputs, (one.y - one.free).T, strict=True))
    shown = _outputs(core, one.zfree, point)

    def true(name: str) -> np.ndarray:
        if name not in moved:
            return np.interp(record.time, run.outputs[name].time, run.outputs[name].values)
        values = moved[name] + shown[name]
        good = ~np.isnan(values)
        return np.interp(record.time, record.time[good], values[good])

    motion: dict[str, np.ndarray] = {}
    for q, v in PAIRS.items():
        if q in wanted and q in run.outputs:
            rate = true(v) if v in run.outputs else None
            times = np.clip(run.outputs[q].time, record.time[0], record.time[-1])
            both = joined(true(q), rate, float(np.median(record.steps)))
            motion |= {n: CubicSpline(record.time, x)(times) for n, x in zip((q, v), both, strict=True)}
    return motion


def _outputs(core: Core, states: np.ndarray, point: Point) -> Mapping[str, np.ndarray]:
    """The base model's outputs [n] at states [n, NX]: what moves, without what its sensors add."""
    model = core.model
    x, u, m, parameters = model.symbols
    shown = ca.Function("shown", [x, u, m, parameters], [model.h(x, u, m, parameters)])
    n, p = len(states), np.array([point.values[v.name] for v in model.parameters])
    zeros = [np.zeros((s.numel(), n)) for s in (u, m)]
    values = shown.map(n)(states[:, : x.numel()].T, *zeros, np.repeat(p[:, None], n, 1))
    return {v.name: row for v, row in zip(model.outputs, np.asarray(values), strict=True)}


def recorded(
    run: Run, wanted: Sequence[str], gyros: Mapping[str, np.ndarray] | None = None
) -> dict[str, np.ndarray]:
    """The same of a part that cannot be fitted: recorded angles and rates, smoothed.

    `gyros`: by the rate's name, what a gyroscope sees of it [n], at the angle's times; its zero is taken off.
    """
    motion: dict[str, np.ndarray] = {}
    for q, v in PAIRS.items():
        if q in wanted and q in run.outputs:
            angle = run.outputs[q]
            rate = run.outputs.get(v)
            seen = None if rate is None else np.interp(angle.time, rate.time, rate.values)
            seen = None if seen is None else in_time(angle.values, seen, run.period_s)
            motion[q], motion[v] = joined(angle.values, _both(seen, (gyros or {}).get(v)), run.period_s)
    return motion


def joined(angle: np.ndarray, rate: np.ndarray | None, period_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Angle and rate [n] of a motion with random jerk (Kalman filter and Rauch-Tung-Striebel smoother).

    The size of the jerk is the one that makes the recording likeliest: an arm that stands is smoothed long,
    a slew that brakes is not.
    """
    found = max((_tracked(angle, rate, period_s, size) for size in JERKS), key=lambda f: f[0])
    _, states, predicted, covariances, foretold = found
    step = _transition(period_s)
    smoothed = states.copy()
    for k in range(len(angle) - 2, -1, -1):
        gain = covariances[k] @ step.T @ np.linalg.inv(foretold[k + 1])
        smoothed[k] = states[k] + gain @ (smoothed[k + 1] - predicted[k + 1])
    return smoothed[:, 0], smoothed[:, 1]


def _transition(h: float) -> np.ndarray:
    return np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])


def _tracked(angle: np.ndarray, rate: np.ndarray | None, h: float, size: float):
    """(log-likelihood, states, predicted states, their covariances) of angle, rate, acceleration."""
    step, shape = _transition(h), np.array([h**3 / 6.0, h * h / 2.0, h])
    pushed = size**2 * np.outer(shape, shape) / h  # jerk of `size` (rad/s3) times root of s, white
    seen = np.eye(3)[: 1 if rate is None else 2]
    values = angle[:, None] if rate is None else np.column_stack([angle, rate])
    noise = np.diag([max(high_pass_level(v), LEAST) ** 2 for v in values.T])
    x = np.array([angle[0], 0.0 if rate is None else rate[0], 0.0])
    p = np.diag([noise[0, 0], 1.0, 1.0])
    n, likely = len(angle), 0.0
    states, predicted = np.zeros((n, 3)), np.zeros((n, 3))
    covariances, foretold = np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    for k in range(n):
        if k:
            x, p = step @ x, step @ p @ step.T + pushed
        predicted[k], foretold[k] = x, p
        spread = seen @ p @ seen.T + noise
        inverse = np.linalg.inv(spread)
        error = values[k] - seen @ x
        likely -= 0.5 * float(error @ inverse @ error + np.linalg.slogdet(spread)[1])
        gain = p @ seen.T @ inverse
        x, p = x + gain @ error, p - gain @ seen @ p
        states[k], covariances[k] = x, p
    return likely, states, predicted, covariances, foretold


def in_time(angle: np.ndarray, rate: np.ndarray, period_s: float) -> np.ndarray:
    """The rate [n] moved to where it is not late against its angle, its end by the angle's slope."""
    late = round(_lateness(angle, rate, period_s))
    if not late:
        return rate
    (_, slope), _ = _parabolas(angle, None, period_s, HALF_WIDTH)
    return np.concatenate([rate[late:], slope[-late:]])


def _both(rate: np.ndarray | None, gyro: np.ndarray | None) -> np.ndarray | None:
    """A rate [n] and that of a gyroscope without its zero, each by its noise."""
    if rate is None or gyro is None:
        return rate
    gyro = gyro - np.mean(gyro - rate)
    weights = [1.0 / max(high_pass_level(values), 1e-12) ** 2 for values in (rate, gyro)]
    return np.average([rate, gyro], axis=0, weights=weights)


def _parabolas(angle: np.ndarray, rate: np.ndarray | None, period_s: float, half_width: int):
    """((angle, rate) [n], their noise levels) of q + v t + a t²/2 fitted around every sample."""
    t = period_s * np.arange(-half_width, half_width + 1)
    one, zero = np.ones_like(t), np.zeros_like(t)
    sigma = max(high_pass_level(angle), 1e-12)
    rows, weights = np.column_stack([one, t, 0.5 * t**2]), np.full(len(t), 1.0 / sigma)
    series = [angle]
    if rate is not None:
        level = max(high_pass_level(rate), 1e-12)
        rows = np.vstack([rows, np.column_stack([zero, one, t])])
        weights = np.concatenate([weights, np.full(len(t), 1.0 / level)])
        series.append(rate)
    filters = np.linalg.pinv(rows * weights[:, None]) * weights
    found = []
    for k in (0, 1):
        parts = np.split(filters[k], len(series))
        found.append(sum(_filtered(s, f, half_width) for s, f in zip(series, parts, strict=True)))
    noise = [float(np.sqrt(np.sum((filters[k] / weights) ** 2))) for k in (0, 1)]
    return found, noise


def _filtered(values: np.ndarray, weights: np.ndarray, half_width: int) -> np.ndarray:
    """Weighted sums around every sample; beyond the ends the signal goes on as a mirrored one does."""
    before = 2.0 * values[0] - values[half_width:0:-1]
    after = 2.0 * values[-1] - values[-2 : -half_width - 2 : -1]
    return np.correlate(np.concatenate([before, values, after]), weights, mode="valid")


def _lateness(angle: np.ndarray, rate: np.ndarray, period_s: float, most: int = 25) -> float:
    """Samples by which a rate comes after the slope of its angle, where that is plain to see; else 0."""
    slope = np.gradient(angle, period_s)
    if np.std(slope) < 1e-9 or np.std(rate) < 1e-9 or len(rate) < 4 * most:
        return 0.0
    errors = [
        np.mean((rate[most + k : len(rate) - most + k] - slope[most:-most]) ** 2) for k in range(most + 1)
    ]
    return float(np.argmin(errors))
