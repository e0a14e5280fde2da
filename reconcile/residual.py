"""What a fit leaves over time: as a force at each axis that would make it good, else as the outputs' errors.

A force that is constant over short bins is estimated at each axis, with a random walk's smoothness as prior
whose size maximises the likelihood (the fixed-interval smoother for an unknown input).  Where such forces
account for an output's errors, the disagreement arises in the motion and the force shows where; where no
force can (the sensors contradict each other), the output's own error is looked at.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconcile.fit.point import Point
from reconcile.fit.problem import Problem
from reconcile.fit.solve import Fitted, Free, fit
from reconcile.fit.windows import Window, cut
from reconcile.study import Study

WINDOW_S = 2.0
BIN_S = 0.05
MOST_WINDOWS = 60  # of long recordings, evenly chosen
SIZES = tuple(
    np.logspace(-2.0, 3.0, 16)
)  # of the walk's steps, in forces that move the outputs by their noise
ACCOUNTED = 0.7  # share of an output's squared errors that forces must explain


@dataclass(frozen=True)
class Residual:
    """A quantity that should be zero, in bins of time.

    `values`, `noise` [N] in `unit`: the quantity and what the sensors' noise makes of it; `moments`: windows
    with the times [n] of their bins, in order; `states` [N, NX]: at those times.  `columns` [N, K]: what
    a change of each base parameter by its prior spread would make of it.  `signals`: the outputs whose
    errors it accounts for; `axis` is None for an output's own error.
    """

    name: str
    unit: str
    axis: str | None
    signals: tuple[str, ...]
    values: np.ndarray
    noise: np.ndarray
    moments: tuple[tuple[Window, np.ndarray], ...]
    states: np.ndarray
    columns: np.ndarray

    @property
    def window(self) -> np.ndarray:
        """Number of the window of each value [N]."""
        return np.repeat(np.arange(len(self.moments)), [len(t) for _, t in self.moments])


@dataclass(frozen=True)
class _Piece:
    """One window, freed of its initial state: errors [N], slopes [N, K], responses to forces."""

    errors: np.ndarray
    slopes: np.ndarray
    responses: np.ndarray
    states: np.ndarray  # [steps + 1, NX]
    edges: np.ndarray
    by_output: dict[str, slice]


def residuals(study: Study, fitted: Fitted, errors: Sequence[str] = ()) -> list[Residual]:
    """What a fit leaves on fit and confirm: forces at axes, then errors of outputs.

    `errors`: outputs whose errors are looked at whatever accounts for them.
    """
    problem, point = _on_short_windows(study, fitted)
    if problem is None or point is None:
        return []
    axes = study.folder.ports.axes
    free = [f for f in fitted.free if f.prior]
    pieces = [_piece(problem, point, k, len(axes), free) for k in range(len(problem.windows))]
    kept = [(w, p) for w, p in zip(problem.windows, pieces, strict=True) if p is not None]
    if not kept:
        return []
    windows, pieces = [w for w, _ in kept], [p for _, p in kept]
    sizes = _prior(pieces, axes) if axes else []
    forces = [_forces(p, sizes) for p in pieces] if axes else []
    accounted = _accounted(problem.outputs, pieces, [f[0] for f in forces]) if axes else {}
    found = []
    for i, axis in enumerate(axes):
        signals = tuple(n for n, a in accounted.items() if a > ACCOUNTED and _axis_of(study, pieces, n) == i)
        if signals:
            found.append(_force_residual(axis, i, signals, windows, pieces, forces))
    rest = [n for n in problem.outputs if n in errors or accounted.get(n, 0.0) <= ACCOUNTED]
    units = {v.name: v.unit for v in study.model.outputs}
    return found + [_error_residual(problem, n, units[n], windows, pieces) for n in rest]


def _on_short_windows(study: Study, fitted: Fitted) -> tuple[Problem | None, Point | None]:
    windows = cut([*study.parts.fit, *study.parts.confirm], WINDOW_S, study.step_s)
    chosen = np.unique(np.linspace(0, len(windows) - 1, min(len(windows), MOST_WINDOWS)).round().astype(int))
    problem = Problem(
        study.compiled, [windows[i] for i in chosen], {n: f.level for n, f in study.floors.items()}
    )
    problem.set_scale(study.fit_problem.scale)
    start = problem.with_present(problem.start(study.named(fitted.point.p)), fitted.point.present)
    found = fit(problem, start, [], iterations=0)
    return (None, None) if found is None else (problem, found.point)


def _piece(problem: Problem, point: Point, k: int, axes: int, free: Sequence[Free]) -> _Piece | None:
    window = problem.windows[k]
    bins = int(np.clip(round(window.steps * window.step_s / BIN_S), 4, window.steps))
    edges = np.round(np.linspace(0, window.steps, bins + 1)).astype(int)
    inputs = [problem.extended.clock + 1 + i for i in range(axes)]
    columns = [problem.parameter(f.name) for f in free]
    found, run = problem.responses(point, k, inputs, edges, columns), problem.simulate(point, k)
    if found is None or run is None:
        return None
    e, known, pushed = found
    states = known.shape[1] - len(free)
    q = np.linalg.qr(known[:, :states])[0]
    slopes = known[:, states:] * np.array([f.prior[1] if f.prior else 1.0 for f in free])
    slopes, pushed = slopes - q @ (q.T @ slopes), pushed - q @ (q.T @ pushed)
    ends = np.cumsum([0, *(len(window.times[n]) for n in problem.outputs)])
    by_output = {n: slice(a, b) for n, a, b in zip(problem.outputs, ends[:-1], ends[1:], strict=True)}
    return _Piece(e - q @ (q.T @ e), slopes, pushed.reshape(len(e), axes, bins), run[0], edges, by_output)


# -------------------------------------------------------------------------------- forces


def _walk(bins: int) -> np.ndarray:
    """A random walk with unit steps, its level all but free: [bins, bins] from steps to values."""
    root = np.tril(np.ones((bins, bins)))
    root[:, 0] *= 300.0
    return root


def _reach(pieces: Sequence[_Piece], axis: int) -> float:
    """Force that moves the outputs by their noise (root mean square) if it acts in one bin."""
    total = sum(float(np.sum(p.responses[:, axis] ** 2)) / p.responses.shape[2] for p in pieces)
    count = sum(len(p.errors) for p in pieces)
    return float(np.sqrt(count / total)) if total > 0 else 0.0


def _prior(pieces: Sequence[_Piece], axes: Sequence) -> list[float]:
    """Size of the walk's steps at each axis, of greatest likelihood together."""
    reach = [_reach(pieces, i) for i in range(len(axes))]
    gains = np.zeros(len(SIZES))
    for p in pieces:
        a = np.concatenate(
            [p.responses[:, i] @ _walk(p.responses.shape[2]) * r for i, r in enumerate(reach)], 1
        )
        values, vectors = np.linalg.eigh(a.T @ a)
        values = np.maximum(values, 0.0)
        pull = (vectors.T @ (a.T @ p.errors)) ** 2
        s2 = np.square(SIZES)[:, None]
        gains += np.sum(s2 / (1.0 + s2 * values) * pull - np.log1p(s2 * values), axis=1)
    return [float(SIZES[int(np.argmax(gains))]) * r for r in reach]


def _forces(p: _Piece, sizes: Sequence[float]) -> tuple[np.ndarray, ...]:
    """Errors left [N], forces [axes, bins], the noise in them, and the slopes as forces [axes, bins, K]."""
    bins = p.responses.shape[2]
    root = np.kron(np.diag(sizes), _walk(bins))
    a = p.responses.reshape(len(p.errors), -1) @ root
    gain = root @ np.linalg.solve(a.T @ a + np.eye(a.shape[1]), a.T)
    force = gain @ np.column_stack([p.errors, p.slopes])
    spread = np.sqrt(np.sum(gain**2, axis=1))  # what the sensors' noise makes of it
    left = p.errors - p.responses.reshape(len(p.errors), -1) @ force[:, 0]
    by_axis = force.reshape(len(sizes), bins, -1)
    return left, by_axis[:, :, 0], spread.reshape(-1, bins), by_axis[:, :, 1:]


def _accounted(
    outputs: Sequence[str], pieces: Sequence[_Piece], left: Sequence[np.ndarray]
) -> dict[str, float]:
    """Share of each output's squared errors above its noise that forces take away."""
    found = {}
    for n in outputs:
        parts = [(p.errors[p.by_output[n]], e[p.by_output[n]]) for p, e in zip(pieces, left, strict=True)]
        count = sum(len(a) for a, _ in parts)
        before = sum(float(a @ a) for a, _ in parts) - count
        after = sum(float(b @ b) for _, b in parts) - count
        found[n] = 1.0 - max(after, 0.0) / before if before > 0.1 * count else 1.0
    return found


def _axis_of(study: Study, pieces: Sequence[_Piece], output: str) -> int:
    """The axis at which a force moves this output most, for its own size."""
    axes = range(len(study.folder.ports.axes))
    reach = [_reach(pieces, i) for i in axes]
    moved = [sum(float(np.sum(p.responses[p.by_output[output], i] ** 2)) for p in pieces) for i in axes]
    return int(np.argmax([m * r**2 for m, r in zip(moved, reach, strict=True)]))


def _force_residual(axis, i: int, signals, windows, pieces, forces) -> Residual:
    moments, states = [], []
    for window, p in zip(windows, pieces, strict=True):
        middle = 0.5 * (p.edges[:-1] + p.edges[1:])
        moments.append((window, window.start_s + window.step_s * middle))
        states.append(p.states[np.round(middle).astype(int)])
    values = np.concatenate([f[1][i] for f in forces])
    noise = np.concatenate([f[2][i] for f in forces])
    columns = np.vstack([f[3][i] for f in forces])
    name, where = f"residual force at {axis.name}", (tuple(moments), np.vstack(states))
    return Residual(name, axis.unit, axis.name, signals, values, noise, *where, columns)


def _error_residual(problem: Problem, name: str, unit: str, windows, pieces) -> Residual:
    moments, states, values, columns = [], [], [], []
    for window, p in zip(windows, pieces, strict=True):
        times = window.times[name]
        rows = np.round((times - window.start_s) / window.step_s).astype(int)
        moments.append((window, times))
        states.append(p.states[np.clip(rows, 0, len(p.states) - 1)])
        values.append(problem.sigma[name] * p.errors[p.by_output[name]])
        columns.append(problem.sigma[name] * p.slopes[p.by_output[name]])
    sizes = np.concatenate(values)
    noise = np.full(len(sizes), problem.sigma[name])
    where = (tuple(moments), np.vstack(states))
    return Residual(f"error of {name}", unit, None, (name,), sizes, noise, *where, np.vstack(columns))
