"""What every candidate would gain, from one fit: score tests of amplitudes, finite probes of other shapes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from reconcile.equations.model import Attached
from reconcile.filter.kalman import Values
from reconcile.filter.point import Free, Point
from reconcile.search.core import Core
from reconcile.search.shapes import Shapes
from reconcile.tolerances import PLAIN, SEPARABLE, WORTH

PROBE = 0.1  # of an amplitude's size: dry friction does not show when it is much smaller
SMOOTH = 1e-3  # of that of an effect without a kink: beside a parameter much like it, only exact slopes tell
TRUSTED = 3.0  # times what a step really gains, that slopes may promise
SIZES = (0.3, 0.1, 0.03, 0.01, 0.003, 3.0, 10.0)  # of a start, tried where it is too strong
STRAINED = 10.0  # nats of parameters beside what the model states of them
MOST_PROBES = 24  # starts of one effect that are tried


@dataclass(frozen=True)
class Scored:
    """A candidate at its best start: nats that it would gain, and the values that a fit starts from."""

    attached: Attached
    gain: float
    values: Values
    separable: bool = True
    start: int = 0  # which of the effect's starts it is
    whole: float = 0.0  # nats that these values gain, all else as it is; below nothing they are far too much

    @property
    def own(self) -> Values:
        """What they say of the effect itself."""
        return {n: v for n, v in self.values.items() if n.startswith(self.attached.key + ".")}


class Screen:
    """Scores at a fitted point."""

    def __init__(self, core: Core, point: Point, shapes: Shapes):
        self.core, self.point, self.fitter, self.shapes = core, point, core.fitter, shapes
        self.e, self.s = point.e, point.s
        self.loss = float(self.fitter.loss(self.e, self.s).sum())
        de, ds = point.slopes
        moving = ~point.held
        self.de, self.ds = de[:, moving], ds[:, moving]
        _, information = self.fitter.score(self.e, self.s, self.de, self.ds)
        self.known = np.linalg.inv(information + np.eye(int(moving.sum())))

    def all(
        self, candidates: Sequence[Attached], starts: Mapping[Attached, int] | None = None
    ) -> list[Scored]:
        """Candidates at their best start, or that of `starts`, best first, without those that run away."""
        known = starts or {}
        found = [s for a in candidates if (s := self.one(a, known.get(a))) is not None]
        return sorted(found, key=lambda s: -s.gain)

    def one(self, a: Attached, start: int | None = None) -> Scored | None:
        """A candidate at its best start, or at one of them."""
        tried, every = [], self._starts(a)
        for k in range(len(every)) if start is None else (start,):
            found = self._gated(a, every[k]) if a.effect.gated else self._linear(a, every[k])
            if found is not None:
                tried.append(replace(found, start=k))
        best = max(tried, key=lambda s: s.gain, default=None)
        if best is None or best.whole >= 0.0 or best.gain < WORTH:
            return best
        # slopes far from what is there promise anything: of the starts that promise enough the least wrong
        nearest = max((s for s in tried if s.gain >= WORTH), key=lambda s: s.whole)
        return self._at_its_size(nearest)

    def _starts(self, a: Attached) -> list[Values]:
        """Starts of an effect's parameters: those of the catalogue, and what the missing force suggests."""
        scales = self.core.scales[a.port]
        grid = a.effect.grid(scales)
        every = np.unique(np.linspace(0, grid - 1, MOST_PROBES).round().astype(int))
        found = [{a.name(n): v for n, v in a.effect.start(scales, int(k)).items()} for k in every]
        return found + [found[0] | s for s in self.shapes.starts(a)]

    def _slopes(
        self, a: Attached, start: Values, free: Sequence[Free]
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Slopes of e and log s by an effect's amplitudes [n, K]; None where the filter runs away."""
        shapes = {n: v for n, v in start.items() if n not in a.columns}
        present = (*self.point.present, a)
        de, ds = np.zeros((2, len(self.e), len(free)))
        # hidden states of an effect are followed at nothing too: the difference is the amplitude's alone
        values = self.point.values | shapes | {f.name: 0.0 for f in free}
        e, s = self.e, self.s
        if a.effect.hidden and a.effect.place != "input":
            other = self.fitter.innovations(values, present)
            if other is None:
                return None
            e, s = other
        size = PROBE if a.effect.width or a.effect.delays else SMOOTH
        for j, f in enumerate(free):
            step = size if f.high > 0.0 else -size
            other = self.fitter.innovations(values | {f.name: step * f.size}, present)
            if other is None:
                return None
            de[:, j], ds[:, j] = (other[0] - e) / step, (np.log(other[1]) - np.log(s)) / step
        return np.nan_to_num(de), np.nan_to_num(ds)

    def _linear(self, a: Attached, start: Values) -> Scored | None:
        free = [f for f in self.core.free_of(a) if f.name in a.columns]
        shapes = {n: v for n, v in start.items() if n not in a.columns}
        present = (*self.point.present, a)
        columns = self._slopes(a, start, free)
        if columns is None:
            return None
        de, ds = columns
        g, c, own, beside = self._schur(de, ds)
        separable = bool(np.all(np.diag(c) > SEPARABLE * np.maximum(np.diag(own), 1e-300)))
        at = _bounded(c + np.eye(len(g)), -g, free)
        gain = float(-g @ at - 0.5 * at @ (c + np.eye(len(g))) @ at)
        gain -= 0.5 * float(np.linalg.slogdet(c + np.eye(len(g)))[1])
        # what takes over the part of a strained parameter moves nothing of its own: the strain is its gain
        if not separable and self.core.strain(self.point) < STRAINED:
            return Scored(a, -np.inf, shapes, False)
        at = np.clip(at, -3.0, 3.0)
        reached, found = self._walked(present, shapes, free, at, beside)
        return Scored(a, min(gain, max(TRUSTED * reached, 2.0 * WORTH)), found)

    def least(self, a: Attached) -> float | None:
        """The amplitude that shows at two deviations, in its size; None where it is not separable."""
        values = self._starts(a)[0]
        free = [f for f in self.core.free_of(a) if f.name in a.columns]
        columns = self._slopes(a, values, free)
        if columns is None:
            return None
        _, c, own, _ = self._schur(*columns)
        if np.any(np.diag(c) <= SEPARABLE * np.maximum(np.diag(own), 1e-300)):
            return None
        return float(2.0 / np.sqrt(np.max(np.diag(c))))

    def _walked(
        self, present, shapes: Values, free, at: np.ndarray, beside: np.ndarray
    ) -> tuple[float, Values]:
        """The best of some lengths of the step that the slopes ask for: nats, values."""
        moved = [f for f, h in zip(self.point.free, self.point.held, strict=True) if not h]
        best, found = -np.inf, shapes | {f.name: f.value(at[j]) for j, f in enumerate(free)}
        for length in (1.0, 0.3):
            others = {
                f.name: f.moved(self.point.values[f.name], -length * float(d))
                for f, d in zip(moved, np.clip(beside @ at, -1.0, 1.0), strict=True)
            }
            values = shapes | {f.name: f.value(length * at[j]) for j, f in enumerate(free)} | others
            there = self.fitter.innovations(self.point.values | values, present)
            gained = -np.inf if there is None else self._gained(there)
            if gained > best:
                best, found = gained, values
            if gained > 0.0:
                break
        return best, found

    def _gated(self, a: Attached, start: Values) -> Scored | None:
        on = start | {a.name("gate"): 1.0}
        other = self.fitter.innovations(self.point.values | on, (*self.point.present, a))
        if other is None:
            return None
        de = np.nan_to_num(other[0] - self.e)[:, None]
        ds = np.nan_to_num(np.log(other[1]) - np.log(self.s))[:, None]
        g, c, own, _ = self._schur(de, ds, far=True)
        whole = self._gained(other)
        share = float(np.clip(-g[0] / max(c[0, 0], 1e-300), 0.0, 1.0))
        linear = float(-g[0] * share - 0.5 * c[0, 0] * share**2)
        gain = max(whole, linear) - len(a.effect.parameters)
        if c[0, 0] <= SEPARABLE * own[0, 0] or own[0, 0] < 1e-9:
            return Scored(a, -np.inf, on, False)
        return Scored(a, gain, on, whole=whole)

    def _gained(self, there: tuple[np.ndarray, np.ndarray]) -> float:
        """Nats by which innovations elsewhere are likelier than the point's."""
        return self.loss - float(self.fitter.loss(*there).sum())

    def _at_its_size(self, best: Scored) -> Scored:
        """The start of the size that gains most: some effects vanish as they grow small, some as they grow.

        Slopes tell that there is some of it, but not as much as the start says: a fit would not come back.
        """
        a = best.attached
        shapes = [f.name for f in self.core.free_of(a) if f.log and f.name in best.values]
        least, found = PLAIN, best.values  # where nothing is left of it, nothing is gained either
        for factor in SIZES:
            values = best.values | {n: factor * best.values[n] for n in shapes}
            there = self.fitter.innovations(self.point.values | values, (*self.point.present, a))
            gained = -np.inf if there is None else self._gained(there)
            if gained > least:
                least, found = gained, values
            elif least > PLAIN:
                break
        return replace(best, values=found)

    def _schur(self, de: np.ndarray, ds: np.ndarray, far: bool = False) -> tuple[np.ndarray, ...]:
        """Gradient, information beside what is fitted, own; how what is fitted gives way [F, K].

        `far`: what is seen in a few samples alone, as an end stop, is told by those that are far off.
        """
        n = de.shape[1]
        de, ds = np.hstack([self.de, de]), np.hstack([self.ds, ds])
        g, whole = self.fitter.score(self.e, self.s, de, ds, far)
        between, own = whole[-n:, :-n], whole[-n:, -n:]
        return g[-n:], own - between @ self.known @ between.T, own, self.known @ between.T


def _bounded(h: np.ndarray, b: np.ndarray, free) -> np.ndarray:
    """Minimum of ½ x'hx − b'x with x within the bounds, coordinate by coordinate (few of them)."""
    x = np.linalg.solve(h, b)
    low = np.array([f.low / f.size for f in free])
    high = np.array([f.high / f.size for f in free])
    for _ in range(50):
        before = x.copy()
        for j in range(len(x)):
            rest = b[j] - h[j] @ x + h[j, j] * x[j]
            x[j] = min(max(rest / h[j, j], low[j]), high[j])
        if np.allclose(before, x, rtol=1e-6, atol=1e-9):
            break
    return x
