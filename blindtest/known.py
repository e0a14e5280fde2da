"""What effects of the catalogue leave of an effect outside of it: sets of up to three in its place.

All sets cannot be fitted.  Each effect's change of the outputs, at one size and every shape, is a column of a
linear problem in which sets are grown side by side; those that leave least there are fitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blindtest.effects.effect import Effect, Values
from blindtest.likelihood import Fit, Problem
from specs.errors import RunError

MOST = 3  # effects of a set
SIZE = 0.02  # of the largest: of the changes that sets are chosen by
BEAM, FITTED = 12, 6  # sets of one size that are grown, and that are fitted
UNSEEN = 1e-9  # of a column's square: what others leave of it is nothing of its own

Chosen = tuple[int, ...]


@dataclass(frozen=True)
class _Column:
    """An effect of some shape, and its change of the whitened residual [N]."""

    effect: Effect
    shape: dict[str, float]
    change: np.ndarray

    @property
    def signed(self) -> bool:
        """Whether the effect may be turned round."""
        return self.effect.either_sign or self.effect.parameters[0].low < 0.0


def least(
    problem: Problem, kept: Sequence[Effect], at: Fit, effects: Sequence[Effect], wanted: float
) -> float:
    """The least lambda of `kept` (fitted: `at`) with up to MOST of `effects`; below `wanted` is enough."""
    tangent, left = problem.tangent(kept, at)
    names = {e.name for e in kept}
    columns = _columns(problem, kept, at, left, [e for e in effects if e.name not in names])
    if not columns:
        return at.value
    changes = np.column_stack([c.change for c in columns])
    changes -= tangent @ (tangent.T @ changes)
    found = at.value
    for chosen, factors in _sets(columns, changes, left - tangent @ (tangent.T @ left)):
        picked = [columns[i] for i in chosen]
        values = [_sized(problem, c, f) for c, f in zip(picked, factors, strict=True)]
        start = Fit(np.inf, at.base, (*at.effects, *values), at.starts)
        found = min(found, problem.fit((*kept, *(c.effect for c in picked)), start, wanted).value)
        if found < wanted:
            break
    return found


def _columns(
    problem: Problem, kept: Sequence[Effect], at: Fit, left: np.ndarray, effects: Sequence[Effect]
) -> list[_Column]:
    """Changes by every effect that runs; one that changes nothing is left out."""
    found = []
    for effect in effects:
        for shape in effect.shapes:
            values = effect.size(SIZE * effect.largest, shape, problem.scale)
            trial = Fit(np.inf, at.base, (*at.effects, values), at.starts)
            try:
                change = problem.residual((*kept, effect), trial) - left
            except RunError:
                continue
            if np.isfinite(change).all() and change @ change > 0.0:
                found.append(_Column(effect, dict(shape), change))
    return found


def _sets(
    columns: Sequence[_Column], changes: np.ndarray, left: np.ndarray
) -> list[tuple[Chosen, np.ndarray]]:
    """Sets of different effects that leave least when their sizes are scaled, and by how much each is."""
    beam: list[Chosen] = [()]
    for _ in range(min(MOST, len({c.effect.name for c in columns}))):
        beam = _grown(beam, columns, changes, left)
    found = [(chosen, np.linalg.lstsq(changes[:, chosen], left, rcond=None)[0]) for chosen in beam]
    return [(chosen, -factors) for chosen, factors in found][:FITTED]


def _grown(
    beam: Sequence[Chosen], columns: Sequence[_Column], changes: np.ndarray, left: np.ndarray
) -> list[Chosen]:
    """The best sets of one effect more."""
    signed = np.array([c.signed for c in columns])
    remaining: dict[frozenset[str], tuple[float, Chosen]] = {}
    for chosen in beam:
        names = {columns[i].effect.name for i in chosen}
        basis = np.linalg.qr(changes[:, chosen])[0]
        free = changes - basis @ (basis.T @ changes)
        rest = left - basis @ (basis.T @ left)
        size = np.sum(free**2, axis=0)
        along = -(free.T @ rest)
        own = (size > UNSEEN * np.sum(changes**2, axis=0)) & (signed | (along > 0.0))
        gains = np.where(own, along**2 / np.where(own, size, 1.0), 0.0)
        for i in np.argsort(-gains)[: 4 * BEAM]:
            key = frozenset(names | {columns[i].effect.name})
            total = float(rest @ rest - gains[i])
            if columns[i].effect.name not in names and total < remaining.get(key, (np.inf, ()))[0]:
                remaining[key] = total, (*chosen, int(i))
    return [chosen for _, chosen in sorted(remaining.values(), key=lambda r: r[0])[:BEAM]]


def _sized(problem: Problem, column: _Column, factor: float) -> Values:
    """Parameters of an effect that is so much larger than its column's."""
    share = float(np.clip(factor * SIZE, -1.0 if column.signed else 0.01, 1.0))
    return column.effect.size(share * column.effect.largest, column.shape, problem.scale)
