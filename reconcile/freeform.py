"""Terms of no particular form: whether a force or command that depends on what is seen would explain more.

Where the catalogue's effects leave something, or explain it less well than a few free terms would, the answer
must say so (`unexplained`).  A term is a force at an axis, or a change of a command, in proportion to a plain
function of speed, place, command or time along the fitted trajectory.  Terms are chosen in the linearised,
whitened problem (sets grown side by side, by BIC with the price of choosing among many).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from reconcile import evidence
from reconcile.fit.solve import Fitted
from reconcile.fit.windows import Window
from reconcile.score import RunsAway
from reconcile.study import Study

MOST = 4  # terms
BEAM = 12  # sets of one size that are grown
BIN_S = 0.1  # a term's force is constant over so long

Shape = Callable[[np.ndarray], np.ndarray]


def _wave(halves: int, q: np.ndarray) -> np.ndarray:
    """Cosine of so many half waves over the way from -1 to 1."""
    return np.cos(0.5 * np.pi * halves * (q + 1.0))


OF_SPEED: dict[str, Shape] = {
    "sgn v": lambda v: np.tanh(v / 0.02),
    "v": lambda v: v,
    "v²": lambda v: v**2,
    "v³": lambda v: v**3,
    "slow": lambda v: np.tanh(v / 0.02) * np.exp(-((v / 0.15) ** 2)),
}
OF_PLACE: dict[str, Shape] = {
    "1": np.ones_like,
    "q": lambda q: q,
    "q²": lambda q: q**2,
    "q³": lambda q: q**3,
    "q⁴": lambda q: q**4,
}
WAVES = {f"wave{n}(q)": partial(_wave, n) for n in range(2, 7)}
OF_COMMAND: dict[str, Shape] = {
    "u": lambda u: u,
    "|u|": np.abs,
    "u²": lambda u: u**2,
    "u³": lambda u: u**3,
    "u|u|": lambda u: u * np.abs(u),
    "small u": lambda u: np.clip(u, -0.1, 0.1),
    "large u": lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.6, 0.0),
    "small |u|": lambda u: np.minimum(np.abs(u), 0.3),
}


@dataclass(frozen=True)
class FreeForm:
    """Chosen `terms` ("port: function"), what they gain in twice the log-likelihood, and their price."""

    terms: tuple[str, ...]
    gain: float
    price: float  # a parameter each, and the choice among all terms
    closed: float  # share of the squared error above the noise that they take away

    def figures(self) -> dict[str, Any]:
        """As the report shows it."""
        return {"terms": list(self.terms), "gain": self.gain, "gap_closed": self.closed}


NONE = FreeForm((), 0.0, 0.0, 0.0)


def examine(study: Study, fitted: Fitted) -> FreeForm:
    """The best free-form terms beside what is in a fit; RunsAway if it cannot be simulated."""
    labels, errors, columns = _problem(study, fitted)
    count = evidence.count_of(fitted)
    price = np.log(count) + 2.0 * np.log(max(len(labels), 1))
    gained, chosen = _best(columns.T @ columns, columns.T @ errors, price)
    above = max(float(errors @ errors) - count, gained, 1e-9)
    terms = tuple(labels[i] for i in chosen)
    return FreeForm(terms, gained, price * len(chosen), gained / above)


def _best(gram: np.ndarray, pull: np.ndarray, price: float) -> tuple[float, tuple[int, ...]]:
    """What the best set of columns takes off the squared error, less its price, and the set.

    `gram` [M, M]: of the columns; `pull` [M]: their products with the errors.
    """
    best: tuple[float, tuple[int, ...]] = (0.0, ())
    beam = [best]
    for _ in range(min(MOST, len(pull))):
        grown = {tuple(sorted((*s, j))): g for _, s in beam for j, g in _grown(gram, pull, s)}
        beam = sorted(((g, s) for s, g in grown.items()), reverse=True)[:BEAM]
        best = max([best, *beam[:1]], key=lambda x: x[0] - price * len(x[1]))
    return best


def _grown(gram: np.ndarray, pull: np.ndarray, chosen: tuple[int, ...]) -> list[tuple[int, float]]:
    """The best further columns, with what the set then takes off."""
    inside = np.linalg.solve(
        gram[np.ix_(chosen, chosen)], np.column_stack([gram[chosen, :], pull[list(chosen)]])
    )
    own = np.diag(gram) - np.sum(gram[:, chosen].T * inside[:, :-1], axis=0)
    rest = pull - gram[:, chosen] @ inside[:, -1]
    seen = own > 1e-6 * np.maximum(np.diag(gram), 1e-300)
    gains = np.where(seen, rest**2 / np.where(seen, own, 1.0), 0.0)
    taken = float(pull[list(chosen)] @ inside[:, -1])
    return [(int(j), taken + float(gains[j])) for j in np.argsort(-gains)[:BEAM] if gains[j] > 0.0]


def slopes(study: Study, fitted: Fitted, only: Sequence[str] | None = None) -> np.ndarray:
    """Slopes [N, terms], not whitened, by all terms or some: what may be missing, and is no noise."""
    problem, columns = study.fit_problem, [study.extended.index[f.name] for f in fitted.free]
    known = 1 + len(problem.common(fitted.point).active) + len(columns)
    found = [_window(study, fitted, k, columns) for k in range(len(problem.windows))]
    labels = found[0][0]
    chosen = [known + i for i, label in enumerate(labels) if only is None or label in only]
    return np.vstack([window[:, chosen] for _, window in found])


def _problem(study: Study, fitted: Fitted) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Labels of the terms, errors [N] and slopes [N, terms], whitened, freed of what is fitted anyway."""
    problem, point = study.fit_problem, fitted.point
    columns = [study.extended.index[f.name] for f in fitted.free]
    parts, labels = [], []
    states = len(problem.common(point).active)
    for k in range(len(problem.windows)):
        labels, found = _window(study, fitted, k, columns)
        if problem.whiteners is not None:
            found = problem.whiteners[k](found)
        q = np.linalg.qr(found[:, 1 : 1 + states])[0]
        parts.append(found - q @ (q.T @ found))
    whole = np.vstack(parts)
    known = whole[:, 1 + states : 1 + states + len(columns)]
    rest = whole[:, [0, *range(1 + states + len(columns), whole.shape[1])]]
    u, s, _ = np.linalg.svd(known / np.maximum(np.linalg.norm(known, axis=0), 1e-300), full_matrices=False)
    u = u[:, s > 1e-8]
    rest = rest - u @ (u.T @ rest)
    return labels, rest[:, 0], rest[:, 1:]


def _window(study: Study, fitted: Fitted, k: int, columns: Sequence[int]) -> tuple[list[str], np.ndarray]:
    """Errors, slopes by initial states and parameters, and by the terms, side by side [N, ...]."""
    problem, point, window = study.fit_problem, fitted.point, study.fit_problem.windows[k]
    axes, controls = study.folder.ports.axes, study.folder.ports.controls
    bins = int(np.clip(round(window.steps * window.step_s / BIN_S), 2, window.steps))
    edges = np.round(np.linspace(0, window.steps, bins + 1)).astype(int)
    at = [study.extended.clock + 1 + i for i in range(len(axes))]
    at += [study.model.index("inputs", n) for n in controls]
    run = problem.simulate(point, k)
    found = problem.responses(point, k, at, edges, columns)
    if run is None or found is None:
        raise RunsAway("a fit that cannot be simulated")
    errors, free, pushed = found
    lasts = max(window.run.end_s - window.run.start_s, 1e-9)
    seconds = (window.start_s - window.run.start_s + window.step_s * np.arange(window.steps)) / lasts
    labels, slopes = [], []
    for i, (port, shapes) in enumerate(_terms(study, run[0][: window.steps], window, seconds)):
        for label, values in shapes.items():
            labels.append(f"{port}: {label}")
            mean = np.add.reduceat(values, edges[:-1]) / np.diff(edges)
            slopes.append(pushed[:, i * bins : (i + 1) * bins] @ mean)
    return labels, np.column_stack([errors, free, *slopes])


def _terms(study: Study, states: np.ndarray, window: Window, seconds: np.ndarray):
    """(port, {label: values at each step}) for every axis, then every control."""
    for axis in study.folder.ports.axes:
        s = study.scales[axis.name]
        v = states[:, study.model.index("states", axis.velocity)] / s.v
        shapes = {n: f(v) for n, f in OF_SPEED.items()} | {"t": seconds, "v t": v * seconds}
        if axis.position:
            half = 0.5 * (s.q_high - s.q_low) or 1.0
            q = (states[:, study.model.index("states", axis.position)] - 0.5 * (s.q_high + s.q_low)) / half
            shapes |= {n: f(q) for n, f in OF_PLACE.items()}
            sign = OF_SPEED["sgn v"](v)
            shapes |= {f"{n} sgn v": f(q) * sign for n, f in OF_PLACE.items() if n != "1"}
            shapes |= {f"{n} v": f(q) * v for n, f in OF_PLACE.items() if n != "1"}
            shapes |= {n: f(q) for n, f in WAVES.items()}
            shapes |= {f"{n} sgn v": f(q) * sign for n, f in WAVES.items()}
        yield axis.name, shapes
    inputs = [v.name for v in study.model.inputs]
    for name in study.folder.ports.controls:
        table = study.fit_problem.tables[id(window.run)]
        u = table.rows(window, {})[0][: window.steps, inputs.index(name)] / study.scales[name].u
        shapes = {n: f(u) for n, f in OF_COMMAND.items()} | {"u t": u * seconds, "1": np.ones_like(u)}
        yield name, shapes
