"""Which experiment to drive next: the one that tells best what is worst told.

A spread of excitations is played with every candidate; what leaves the limits is made smaller until it does
not.  The best are varied at random.  Times are shares of the bench's duration.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from reconcile.experiment.excitation import SHAPES, TICKS, Excitation
from reconcile.experiment.predict import Bench, Played
from reconcile.filter.point import Point

AMPLITUDES = (1.0, 0.25)
PERIODS = (0.03, 0.1, 0.3, 0.75)
OFFSETS = (0.0, 0.0, 0.25, -0.25)  # of the amplitude
LONGEST = 3.0  # of the best
SHORTER = (0.6, 1.5)  # that do, if they tell by PLENTY
NEEDED = 2.0 * float(np.log(10.0))  # of twice the log-likelihood: so much an experiment is to tell
HOPELESS = 0.02  # times what is needed: nothing near an excitation that tells so little tells enough
PLENTY = 10.0  # times what is needed: beyond it an experiment had better be gentle and short
PLACES = (0.5, 0.15, 0.85)  # of a position's range, where an experiment may start
TRIES = 3  # of making an excitation smaller until it stays within the limits
TIGHTER, LEAST_SHARE = 0.9, 0.2
CHECKED = 4  # of the best, whose motion is checked with uncertain parameters
SMALLEST = 0.01  # of an input's range: less is no excitation
VARIED, ROUNDS = 3, 4  # of the best excitations, of different kinds, and how often each
FEW_STATES = 6  # beyond which fewer excitations are tried, for the time that each takes
SEED = 1

# The margins of an excitation, one for each thing to be told (a pair, a parameter).
Judge = Callable[[Bench, Sequence[Played]], np.ndarray]


@dataclass(frozen=True)
class Rated:
    """An excitation with its margins, and its plays by candidate."""

    excitation: Excitation
    margins: np.ndarray
    played: tuple[Played, ...]


def best(bench: Bench, points: Sequence[Point], judge: Judge, enough: float, report=None) -> list[Rated]:
    """Excitations that stay within the limits with every one of `points`, best first.

    What no excitation tells by `enough` does not count: the rest is told as well as can be.
    """
    said = report or (lambda *_: None)
    first, rated = spread(bench), []
    total = len(first) + VARIED * ROUNDS
    for done, e in enumerate(first):
        said("next experiment", done, total)
        rated += _rate(bench, e, points, judge)
        if rated and np.min(rated[-1].margins) >= PLENTY * enough:
            break
    rng = np.random.default_rng(SEED)
    most = float(np.max([r.margins for r in rated], initial=-np.inf))
    least = max((float(np.min(r.margins)) for r in rated), default=np.inf)
    worthwhile = most > HOPELESS * enough and least < PLENTY * enough
    for turn in range(ROUNDS if worthwhile else 0):
        kinds: dict[str, Rated] = {}
        for r in ranked(rated, enough):
            kinds.setdefault(r.excitation.kind, r)
        for i, r in enumerate(list(kinds.values())[:VARIED]):
            said("next experiment", len(first) + turn * VARIED + i, total)
            rated += _rate(bench, _varied(bench, r.excitation, rng), points, judge)
    found = ranked([_kept(bench, r, points, judge) for r in ranked(rated, enough)[:CHECKED]], enough)
    return [_short(bench, found[0], points, judge, enough), *found[1:]] if found else []


def _short(bench: Bench, r: Rated, points: Sequence[Point], judge: Judge, enough: float) -> Rated:
    """The excitation, as short as tells all of that by PLENTY, and no shorter than its period."""
    told = tellable([r], enough)
    for seconds in (share * bench.duration_s for share in SHORTER):
        if r.excitation.period_s <= seconds < r.excitation.duration_s:
            for shorter in _rate(bench, replace(r.excitation, duration_s=seconds), points, judge):
                if np.min(shorter.margins[told]) >= PLENTY * enough:
                    return shorter
    return r


def _kept(bench: Bench, r: Rated, points: Sequence[Point], judge: Judge) -> Rated:
    """The excitation, made smaller until it keeps the limits with parameters as uncertain as they are."""
    for _ in range(TRIES):
        excess = bench.doubtful(r.excitation, points)
        if excess <= 1.0:
            return r
        smaller = _rate(bench, _shrunk(r.excitation, excess), points, judge)
        if not smaller:
            break
        r = smaller[0]
    return r


def ranked(rated: Sequence[Rated], enough: float) -> list[Rated]:
    """Best first, by the smallest margin of what can be told at all; with PLENTY the gentlest first."""
    if not rated:
        return []
    told = tellable(rated, enough)

    def order(r: Rated) -> tuple[float, float, float]:
        least = float(np.min(r.margins[told]))
        return -min(least, PLENTY * enough), rough(r.excitation), -least

    return sorted(rated, key=order)


def tellable(rated: Sequence[Rated], enough: float) -> np.ndarray:
    """Which margins any excitation brings above `enough`; all, if none."""
    told = np.max([r.margins for r in rated], axis=0) >= enough
    return told if told.any() else np.ones_like(told)


def spread(bench: Bench) -> list[Excitation]:
    """Excitations of all shapes to begin with, for each input alone and for all together, gentle ones first.

    Every shape comes slow and fast, large and small; offset and start are drawn.
    """
    rng = np.random.default_rng(SEED)
    inputs = list(bench.limits.inputs)
    driven = [(n,) for n in inputs] + ([tuple(inputs)] if len(inputs) > 1 else [])
    starts = [(), (), *_starts(bench)]
    found = [
        Excitation(
            kind,
            chosen,
            amplitude,
            max(PERIODS[(2 * i + k) % len(PERIODS)] * bench.duration_s, shortest_s(bench)),
            float(rng.choice(OFFSETS)) * amplitude,
            bench.duration_s,
            int(rng.integers(1, 1000)),
            starts[int(rng.integers(len(starts)))],
            shortest_s(bench),
        )
        for chosen in driven
        for k, kind in enumerate(SHAPES)
        for amplitude in AMPLITUDES
        for i in range(2)
    ]
    # a stride without a factor in common with the numbers of amplitudes and periods, so that all are left
    few = len(bench.core.model.states) <= FEW_STATES and len(driven) == 1
    kept = found if few else found[:: 3 if len(driven) == 1 else 2 * len(driven) - 1]
    return sorted(kept, key=rough)


def rough(e: Excitation) -> float:
    """How hard an excitation is on a machine, and how far from what a model knows: all its inputs' slopes."""
    return len(e.inputs) * e.amplitude / e.fastest_s


def shortest_s(bench: Bench) -> float:
    """The shortest period that commands at the bench's ticks can have."""
    return TICKS * bench.tick_s


def _starts(bench: Bench) -> list[tuple[tuple[str, float], ...]]:
    """Each position at some places of its range, where the machine can be put there."""
    if bench.fixed_start:
        return []
    ranges = {n: bench.limits.outputs[n] for n in bench.limits.places}
    if not ranges or not all(np.isfinite([r.low, r.high]).all() for r in ranges.values()):
        return []
    return [tuple((n, float(r.low + at * (r.high - r.low))) for n, r in ranges.items()) for at in PLACES]


def _rate(bench: Bench, e: Excitation, points: Sequence[Point], judge: Judge) -> list[Rated]:
    """The excitation, made smaller until every candidate stays within the limits; none if that fails."""
    for _ in range(TRIES):
        played = [p for point in points if (p := bench.play(e, point)) is not None]
        if len(played) < len(points) or not all(bench.rests(e, p.run) for p in played):
            return []
        excess = max(bench.excess(e, p.run) for p in played)
        if excess <= 1.0:
            return [Rated(e, np.asarray(judge(bench, played)), tuple(played))]
        e = _shrunk(e, excess)
        if e.amplitude < SMALLEST:
            return []
    return []


def _shrunk(e: Excitation, excess: float) -> Excitation:
    share = max(TIGHTER / excess, LEAST_SHARE)
    return replace(e, amplitude=share * e.amplitude, offset=share * e.offset)


def _varied(bench: Bench, e: Excitation, rng: np.random.Generator) -> Excitation:
    """Another one near it, as long as an experiment may be."""
    period = e.period_s * np.exp(0.5 * rng.standard_normal())
    return replace(
        e,
        amplitude=float(min(1.0, e.amplitude * np.exp(0.4 * rng.standard_normal()))),
        period_s=float(np.clip(period, shortest_s(bench), bench.duration_s)),
        offset=float(np.clip(e.offset * np.exp(0.5 * rng.standard_normal()), -0.5, 0.5)),
        duration_s=LONGEST * bench.duration_s,
        seed=int(rng.integers(1, 1000)),
    )
