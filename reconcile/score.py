"""Which effects could explain what a fit leaves, told from one linearisation: no candidate is fitted for it.

Every candidate has a column for each amplitude (or its gate) at each start of its shape.  The columns and the
errors are freed of initial states and of the parameters that are free anyway; what a set of effects would
gain is then a small least-squares problem on their Gram matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from reconcile.fit.solve import Fitted
from reconcile.model import Attached
from reconcile.study import Study

ROUGH = 500.0  # times the tolerance of steps: slopes need only rank
MORE_SHAPES, ABOUT = (
    1,
    0.7,
)  # further shapes of an effect that are fitted, and what they gain of the first's gain
OWN = 1e-3  # of a column's square: what others leave of it is no parameter of its own
LEAST = 10.0  # squared errors that a variant must save in a pursuit


@dataclass(frozen=True)
class Variant:
    """A candidate at one start of its parameters; `columns`: where it stands in the Gram matrix."""

    attached: Attached
    shape: dict[str, float]
    columns: tuple[int, ...]


@dataclass(frozen=True)
class Scored:
    """A set of variants, the cost it would save and the amplitudes at which it does."""

    variants: tuple[Variant, ...]
    gain: float
    values: dict[str, float]


class RunsAway(ArithmeticError):
    """A fit that cannot be simulated: nothing is told there by slopes."""


class Score:
    """The linear problem at a fit, for all candidates that are not in it; RunsAway if it has none."""

    def __init__(self, study: Study, fitted: Fitted, others: Sequence[Attached]):
        self.study = study
        study.fit_problem.patience = ROUGH
        base = study.fit_problem.linear(fitted.point, [study.extended.index[f.name] for f in fitted.free])
        if base is None:
            study.fit_problem.patience = 1.0
            raise RunsAway("a fit that cannot be simulated")
        self.variants: list[Variant] = []
        blocks = []
        plain, hidden = ([a for a in others if bool(a.effect.hidden) == h] for h in (False, True))
        for group in (plain, hidden):  # apart: without hidden states a pass is quick
            for k in range(max((a.effect.grid(study.port_scales(a)) for a in group), default=0)):
                blocks.append(self._pass(fitted, group, k, sum(b.shape[1] for b in blocks)))
        columns = np.hstack(blocks) if blocks else np.zeros((len(base.errors), 0))
        ridge = np.array([1.0 / f.prior[1] ** 2 if f.prior else 0.0 for f in fitted.free])
        known = base.slopes.T @ base.slopes + np.diag(ridge + 1e-30)
        across = base.slopes.T @ columns
        held = np.linalg.lstsq(known, np.column_stack([base.slopes.T @ base.errors, across]), rcond=1e-13)[0]
        self.cost = base.cost
        errors = base.errors - base.slopes @ held[:, 0]
        free = columns - base.slopes @ held[:, 1:]
        self.slopes = columns
        self.gram = free.T @ columns
        self.pull = columns.T @ errors
        self.sizes = np.sum(columns**2, axis=0)
        study.fit_problem.patience = 1.0

    def _pass(self, fitted: Fitted, others: Sequence[Attached], k: int, first: int) -> np.ndarray:
        study = self.study
        chosen = [a for a in others if k < a.effect.grid(study.port_scales(a))]
        for a in chosen:
            start = a.effect.start(study.port_scales(a), k)
            amplitudes = {q.name for q in a.effect.amplitudes}
            shape = {a.name(n): v for n, v in start.items() if n not in amplitudes}
            self.variants.append(Variant(a, shape, tuple(range(first, first + len(a.columns)))))
            first += len(a.columns)
        return study.slopes.of(fitted, chosen, k)

    def singles(self, variants: Sequence[Variant]) -> list[Scored]:
        """Those of some variants that gain anything, each by itself, the best first."""
        found = (self.scored((v,)) for v in variants)
        return sorted((s for s in found if s.gain > 0), key=lambda s: -s.gain)

    def best(self, count: int, size: int) -> list[Scored]:
        """The best sets of `size` effects by gain, one variant each."""
        singles = self.singles(self.variants)
        if size == 1:
            return _distinct(singles, count)
        pool = [s.variants[0] for s in _distinct(singles, 45, by_shape=2)]
        sets = [
            self.scored(pair) for pair in combinations(pool, size) if len({v.attached for v in pair}) == size
        ]
        return _distinct(sorted(sets, key=lambda s: -s.gain), count)

    def shaped(self, scored: Scored) -> list[Scored]:
        """The same single effect in other shapes that gain about as much: fits from them may end elsewhere.

        Where an effect turns into another one many shapes look alike: a wind is a load while it is fast, and
        a fit from there may never slow it down.  What has a gate tells no shape at first (starting.best).
        """
        own, *more = scored.variants
        if more or own.attached.effect.gated or not own.attached.effect.becomes:
            return []
        others = self.singles([v for v in self.variants if v.attached is own.attached and v is not own])
        return [s for s in others if s.gain > ABOUT * scored.gain][:MORE_SHAPES]

    def pursuit(self, count: int) -> list[Variant]:
        """Variants that together gain most, found one after the other (orthogonal matching pursuit)."""
        chosen: list[Variant] = []
        gained = 0.0
        for _ in range(count):
            taken = {v.attached for v in chosen}
            found = [self.scored((*chosen, v)) for v in self.variants if v.attached not in taken]
            best = max(found, key=lambda s: s.gain, default=None)
            if best is None or best.gain < gained + LEAST:
                break
            chosen, gained = list(best.variants), best.gain
        return chosen

    def of(self, variants: Sequence[Variant]) -> np.ndarray:
        """Slopes [N, columns] of some variants."""
        return self.slopes[:, [c for v in variants for c in v.columns]]

    def scored(self, variants: Sequence[Variant]) -> Scored:
        """Gain of a set; amplitudes of the wrong sign are left out."""
        columns = [c for v in variants for c in v.columns]
        names = [n for v in variants for n in v.attached.columns]
        lows = [self._low(v, n) for v in variants for n in v.attached.columns]
        # nearly nothing left of a column once what is free anyway is taken out: it cannot be told
        seen = [i for i, c in enumerate(columns) if self.gram[c, c] > 1e-7 * self.sizes[c] > 0.0]
        for _ in range(len(columns) + 1):
            if not seen:
                break
            index = np.array([columns[i] for i in seen])
            gram = self.gram[np.ix_(index, index)]
            gram = 0.5 * (gram + gram.T) + np.diag(1e-9 * np.diag(gram))
            values = np.linalg.solve(gram, self.pull[index])
            wrong = [
                (value * np.sqrt(self.gram[columns[i], columns[i]]), i)
                for i, value in zip(seen, values, strict=True)
                if value < lows[i]
            ]
            if not wrong:
                gain = float(self.pull[index] @ values)
                found = {names[i]: float(x) for i, x in zip(seen, values, strict=True)}
                complete = all(any(n in found for n in v.attached.columns) for v in variants)
                return Scored(tuple(variants), gain if complete else 0.0, found)
            seen.remove(min(wrong)[1])  # one by one: without it others may be of the right sign
        return Scored(tuple(variants), 0.0, {})

    def parameters(self, variants: Sequence[Variant]) -> int:
        """How many parameters a set has that what is free anyway does not have as well."""
        columns = [c for v in variants for c in v.columns]
        own = np.sqrt(np.maximum(self.sizes[columns], 1e-300))
        values = np.linalg.eigvalsh(self.gram[np.ix_(columns, columns)] / np.outer(own, own))
        return sum(len(v.attached.free) for v in variants) - int(np.sum(values < OWN))

    def _low(self, v: Variant, name: str) -> float:
        if v.attached.effect.gated:
            return 0.0
        return next(q.low for q in v.attached.effect.amplitudes if v.attached.name(q.name) == name)


def starts(scored: Scored) -> dict[str, float]:
    """Parameters to start a fit of a scored set from."""
    found: dict[str, float] = {}
    for v in scored.variants:
        found |= v.shape
        if not v.attached.effect.gated:
            for q in v.attached.effect.amplitudes:
                name = v.attached.name(q.name)
                found[name] = min(max(scored.values.get(name, 0.0), q.low), q.high)
    return found


def stripped(study: Study, fitted: Fitted, gone: Sequence[Attached]) -> Fitted:
    """A fit with some effects switched off and nothing fitted again."""
    p = fitted.point.p.copy()
    for n in (n for a in gone for n in a.columns):
        p[study.extended.index[n]] = 0.0
    present = tuple(x for x in fitted.point.present if x not in gone)
    point = replace(fitted.point, p=p, present=present)
    free = tuple(f for f in fitted.free if not any(f.name in a.free for a in gone))
    return replace(fitted, point=point, free=free, cost=np.inf)


def _distinct(scored: Sequence[Scored], count: int, by_shape: int = 1) -> list[Scored]:
    """The first `count` with different effects, at most `by_shape` of the same."""
    seen: dict[frozenset, int] = {}
    kept = []
    for s in scored:
        key = frozenset(v.attached.key for v in s.variants)
        if seen.get(key, 0) < by_shape:
            seen[key] = seen.get(key, 0) + 1
            kept.append(s)
        if len(kept) == count:
            break
    return kept
