"""Where a fit and the recordings disagree, in words: which signal, in which regime, with what share of it.

What a fit leaves (forces at axes, errors of outputs: residual.py) is set against every regressor of
regimes.py.  A regressor accounts for it as far as one value in each of its bins, and other values of the base
parameters, do so together: parameters fitted to a wrong model have hidden part of what is missing, and give
it back here.  Of what is then left, a regime is named where the squares gather beyond what the windows'
scatter would make by chance; a constant has none.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconcile.errors import regimes
from reconcile.errors.regimes import Known, Regime, Regressor
from reconcile.errors.residual import LARGE, Residual, residuals
from reconcile.filter.point import Point
from reconcile.search.core import Core

BINS = 15  # of a regressor
SURE, KNOWN = (
    3.0,
    1.0,
)  # standard errors by which a share must stand out; where the regressor is known already
LIFT = 1.3  # times its part of the time
PART = (0.02, 0.75)  # of the time that a regime takes
MOST = 3  # regimes of a quantity
FLAT = 0.6  # share that one constant accounts for, so that there is no regime
GOES_WITH, AHEAD = 0.3, 1.4  # share that a regressor must account for, and how much more than the next
MINOR = 0.3  # of the largest residual, in units of noise: less is what that one drags along
BEYOND = 0.3  # of what a constant leaves: no more may be left by what it goes with instead
SPANNED = 0.8  # of a regressor that the base parameters' columns make up: its slope is theirs
ALL_OVER = "over the whole range of {0}, with which it goes"
THROUGHOUT = "throughout, whatever the speed, pose or command"


@dataclass(frozen=True)
class Place:
    """A regime in which a quantity gathers: its share of the squares, and of the time; `gathers` ranks it."""

    regime: Regime
    share: float
    time: float
    gathers: float


@dataclass(frozen=True)
class Located:
    """A residual with what it goes with.

    `values` [N]: freed of what other base parameters would make of it.  `against` [N]: regressors' values;
    `accounts`: the share of it that each accounts for; `constant`: the share of one number.
    """

    residual: Residual
    values: np.ndarray
    against: dict[Regressor, np.ndarray]
    accounts: dict[Regressor, float]
    constant: float
    places: tuple[Place, ...]

    @property
    def best(self) -> Regressor | None:
        """What it goes with, if there is one thing."""
        return _best(self.accounts, self.constant)


def _best(accounts: dict[Regressor, float], constant: float) -> Regressor | None:
    """The regressor that accounts for clearly more than any other, and than a constant does."""
    ranked = sorted(accounts, key=lambda r: -accounts[r])
    if not ranked or accounts[ranked[0]] < GOES_WITH:
        return None
    if constant > FLAT and 1.0 - accounts[ranked[0]] > BEYOND * (1.0 - constant):
        return None
    # a command and the acceleration that it makes go together: the nearer cause is told by a smaller lead
    others = [accounts[r] for r in ranked[1:]]
    lead = 1.0 - (1.0 - max(others, default=0.0)) / AHEAD
    return ranked[0] if accounts[ranked[0]] > min(lead, AHEAD * max(others, default=0.0)) else None


def locate(core: Core, point: Point) -> list[Located]:
    """Every quantity that stands above its noise, the largest first."""
    return gathered(core, residuals(core, point))


def gathered(study: Known, left: Sequence[Residual]) -> list[Located]:
    """The same of residuals that are known."""
    known = regimes.regressors(study)
    least = max(LARGE, MINOR * max((r.size for r in left), default=0.0))
    found = [_located(study, r, known) for r in left if r.size > least]
    return sorted(found, key=lambda x: -x.residual.size)


def rows(study: Known, located: Sequence[Located]) -> list[dict]:
    """The report's `where`: signal, subsystem, regime and its share, the quantity that was looked at."""
    found = []
    for x in located:
        port = x.residual.axis or x.residual.signals[0]
        signal = {"signal": x.residual.signals[0], "subsystem": subsystem(study, port)}
        quantity = {"quantity": x.residual.name, "unit": x.residual.unit}
        quantity |= {"goes_with": x.best.label if x.best else None}
        if not x.places:
            regime = ALL_OVER.format(x.best.label) if x.best else THROUGHOUT
            found.append(signal | {"regime": regime, "share": 1.0, "time": 1.0} | quantity)
        for p in x.places:
            shares = {"share": round(p.share, 3), "time": round(p.time, 3)}
            found.append(signal | {"regime": p.regime.words} | shares | quantity)
    return found


def subsystem(study: Known, port: str) -> str:
    """Which part of the machine a port belongs to: what comes before the dot, in a model made of several."""
    head, dot, _ = port.partition(".")
    return head if dot else study.model.name


def _located(study: Known, residual: Residual, known: Sequence[Regressor]) -> Located:
    against = {r: _values(study, residual, r) for r in known}
    bare = _freed(residual, None)
    total = max(float(bare.values @ bare.values) - bare.expected, 1e-300)
    one = _freed(residual, np.zeros(len(bare.values)))
    accounts, freed = {}, {}
    for r, x in against.items():
        freed[r] = _freed(residual, x)
        accounts[r] = float(np.clip(1.0 - (freed[r].left - freed[r].expected) / total, 0.0, 1.0))
    constant = float(np.clip(1.0 - (one.left - one.expected) / total, 0.0, 1.0))
    best = _best(accounts, constant)
    if best is None and constant > FLAT:
        return Located(residual, one.values, against, accounts, constant, ())
    values = bare.values if best is None else _without_slope(residual, freed[best].values, against[best])
    places = _places(residual, values, against if best is None else {best: against[best]}, accounts)
    return Located(residual, values, against, accounts, constant, tuple(places))


def _without_slope(residual: Residual, values: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Values without their part in proportion to a regressor, if the base model can make that part itself."""
    size, made = float(x @ x), residual.columns
    if not made.shape[1] or size == 0.0:
        return values
    left = x - made @ np.linalg.lstsq(made, x, rcond=None)[0]
    return values - x * float(x @ values) / size if left @ left < (1.0 - SPANNED) * size else values


@dataclass(frozen=True)
class _Freed:
    """A residual without the parameters' part [N]; squares that a step function leaves, and noise would."""

    values: np.ndarray
    left: float
    expected: float


def _freed(residual: Residual, x: np.ndarray | None) -> _Freed:
    """Least squares of a residual on the parameters' columns and steps over the bins of a regressor [N]."""
    k, noise = residual.columns.shape[1], float(np.mean(residual.noise**2))
    steps = np.zeros((len(residual.values), 0))
    if x is not None:
        at = np.searchsorted(np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)[1:-1])), x)
        steps = np.eye(BINS + 1)[at]
        steps = steps[:, np.any(steps > 0, axis=0)]
    design = np.hstack([residual.columns, steps])
    ridge = np.diag(np.sqrt([noise] * k + [1e-9 * noise] * steps.shape[1]))
    target = np.concatenate([residual.values, np.zeros(len(ridge))])
    found = np.linalg.lstsq(np.vstack([design, ridge]), target, rcond=None)[0]
    left = residual.values - design @ found
    values = residual.values - residual.columns @ found[:k]
    return _Freed(values, float(left @ left), noise * max(1, len(left) - design.shape[1]))


def _values(study: Known, residual: Residual, r: Regressor) -> np.ndarray:
    ends = np.cumsum([0, *(len(t) for _, t in residual.moments)])
    return np.concatenate(
        [
            regimes.values(study, r, w, t, residual.states[a:b])
            for (w, t), a, b in zip(residual.moments, ends[:-1], ends[1:], strict=True)
        ]
    )


def _places(
    residual: Residual,
    values: np.ndarray,
    against: dict[Regressor, np.ndarray],
    accounts: dict[Regressor, float],
) -> list[Place]:
    """The regimes in which a residual gathers, one of each regressor, those that account for it first."""
    found, energy = [], values**2 - residual.noise**2
    for r, x in against.items():
        sure = KNOWN if len(against) == 1 else SURE
        tried = [_place(residual.window, energy, x, g, sure) for g in regimes.regimes(r, x)]
        tried = [p for p in tried if p is not None]
        if tried:
            found.append(max(tried, key=lambda p: p.gathers))
    found.sort(key=lambda p: -p.gathers * (0.05 + accounts[p.regime.regressor]) ** 2)
    return found[:MOST]


def _place(
    window: np.ndarray, energy: np.ndarray, x: np.ndarray, regime: Regime, sure: float
) -> Place | None:
    """A regime, if the squares gather in it; how much is the divergence of their share from the time's."""
    inside = regime.mask(x)
    time = float(np.mean(inside))
    if not PART[0] < time < PART[1]:
        return None
    share = float(np.clip(np.sum(energy[inside]) / max(np.sum(energy), 1e-300), 0.0, 1.0))
    error = _scatter(window, energy, inside, share)
    if share < LIFT * time or share - time < sure * error:
        return None
    rest = (1.0 - share) * np.log(max(1.0 - share, 1e-9) / (1.0 - time))
    return Place(regime, share, time, float(share * np.log(share / time) + rest))


def _scatter(window: np.ndarray, energy: np.ndarray, inside: np.ndarray, share: float) -> float:
    """Standard error of a share, from how it differs between windows (linearised ratio)."""
    total = np.bincount(window, energy)
    part = np.bincount(window, energy * inside)
    n = len(total)
    if n < 3:
        return 1.0
    return float(np.sqrt(n / (n - 1) * np.sum((part - share * total) ** 2)) / max(np.sum(total), 1e-300))
