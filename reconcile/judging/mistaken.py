"""Recordings that are not what they are taken for: readings of them as rivals of an answer.

An effect may make up for a wrong sign, with nonsense for its size: the sign is asked first.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from reconcile import words
from reconcile.equations.model import Attached
from reconcile.errors.ahead import ahead, beyond_sensors, squares, standing
from reconcile.filter.fit import Fitter
from reconcile.filter.kalman import Values
from reconcile.filter.point import Point, standard_errors
from reconcile.judging.answer import Answer
from reconcile.judging.readings import (
    Reading,
    asked,
    driven,
    inputs,
    multiplied,
    relabelled,
    rescaled,
    turned,
    unsigned,
)
from reconcile.recordings.data import Block, Parts
from reconcile.search.alone import alone
from reconcile.search.core import Core
from reconcile.search.sets import effects, weighed
from reconcile.start.units import known_ratios
from reconcile.tolerances import HALVED, LOST, MOVED, SHORTENED, WORTH, WRONG
from specs.errors import InputError

FAR = 10.0  # times a parameter, or a tenth of it: no value that somebody was unsure of
TOLERATED = 5.0  # tolerances that a parameter may be off
NOTHING = 5e-4  # error beside the sensors' noise, that reads as 0.0 %
STRAINED = 20.0  # nats of parameters beside model.py, which states them wrongly then, or the recording is
STEPS = 15  # of a fit: one that is right gets there soon


def evident(core: Core, names: Mapping[str, str] | None = None) -> str:
    """What to ask before effects are looked for; "" unless a turned channel, or another unit, leaves little.

    `names`: the map, {their column: ours}.
    """
    (errs, nats), beside = _by_itself(core), beyond_sensors(core, core.base)
    if not np.isfinite(errs):
        errs = beside
    if errs < WRONG:
        return _strained(core, names or {}) if nats > STRAINED else ""
    tried = [(*_by_itself(_read(core, reading)), reading) for reading in turned(core)]
    least = min((error for error, _, _ in tried), default=np.inf)
    alike = [row for row in tried if row[0] <= (1.0 + SHORTENED) * least]
    error, _, found = min(alike, key=lambda row: row[1], default=(np.inf, 0.0, Reading()))
    # what errs by as much as the outputs move explains nothing, nor does what a disturbance explains as well
    enough = min(HALVED * errs, LOST, beside)
    is_turned = error < enough and not _undriven(core, error)
    # a turned sign may make up for a part of a wrong unit
    explained = list(_explained(core, HALVED * error if is_turned else enough, errs > LOST))
    if explained:  # of those that leave little, the one with parameters as model.py states them
        little = max(NOTHING, min(r[0] for r in explained)) / HALVED
        error, _, found = min((r for r in explained if r[0] <= little), key=lambda row: row[1])
    return _sentence(core, found, errs, error, names or {}) if is_turned or explained else ""


def _strained(core: Core, names: Mapping[str, str]) -> str:
    """What to ask where parameters far from what model.py states make the model fit; "" without.

    By another reading they are as stated, and it errs as little.
    """
    tried = [row for row in _explained(core, WRONG) if row[1] < _stated(core)]
    if not tried:
        return ""
    error, _, found = min(tried, key=lambda row: row[1])
    gains = f"parameters are as model.py states them, and the model errs by {_left(error)}"
    return asked(found, core, gains, names)


def doubt(answer: Answer, names: Mapping[str, str] | None = None) -> str:
    """What to ask before the answer is believed; "" where the model errs little or nothing explains more.

    A rival has at least one effect less than the answer.  It must be likelier, err less ahead, and err less
    than half of what the model errs as the channels are.
    """
    core, errs = answer.core, ahead(answer.core, answer.base)
    if errs < WRONG:
        return ""
    least, most = min(ahead(core, answer.point), HALVED * errs), answer.beam.evidence(answer.judged.answer)
    found = None
    for reading, present in _rivals(answer, errs):
        start = core.fresh | effects(answer.point.values, present)
        tried = _fitted(core, reading, start, present, errs)
        if tried is None:
            continue
        error, likely = tried[0], weighed(tried[1].evidence, present)
        if error < least and likely > most and not _silent(core, error, start, present):
            found, least, most = reading, error, likely
    return _sentence(core, found, errs, least, names or {}) if found else ""


def turned_parameters(answer: Answer) -> str:
    """A sentence on base parameters that come out with the other sign than in model.py; "" without.

    Of one that may well be twice as large or nothing, by its tolerance, the sign is no more than a guess.
    That of a temperature says nothing: its zero is anywhere.
    """
    errors, point = standard_errors(answer.point), answer.point
    found = [
        f"{v.name} comes out at {point.values[v.name]:.4g} instead of {v.start:g}"
        for v in answer.core.model.parameters
        if v.name in errors
        and v.unit != "degC"
        and (v.tolerance or 0.0) < 1.0
        and v.start * point.values[v.name] < 0.0
        and abs(point.values[v.name]) > errors[v.name]
        and abs(point.values[v.name] - v.start) > MOVED * errors[v.name]
    ]
    return f"{', '.join(found)}: is the sign of a channel turned?" if found else ""


def far_parameters(answer: Answer) -> str:
    """A sentence on base parameters ten times off what may be by model.py, or far beyond their tolerance."""
    errors, point, found = standard_errors(answer.point), answer.point, []
    for v in (v for v in answer.core.model.parameters if v.start and v.name in errors):
        ratio, off = abs(point.values[v.name] / v.start), abs(point.values[v.name] - v.start)
        is_far = ratio and max(ratio, 1.0 / ratio) > FAR * (1.0 + (v.tolerance or 0.0))
        if off > MOVED * errors[v.name] and (is_far or off > _tolerated(v)):
            known = "" if is_far else f" with a tolerance of {v.tolerance:g}"
            found.append(f"{v.name} comes out at {point.values[v.name]:.4g} instead of {v.start:g}{known}")
    return f"{', '.join(found)}: are its unit and those of the columns right?" if found else ""


def _tolerated(v: Any) -> float:
    """How far a parameter may be off: five times its tolerance, which model.py may state."""
    return TOLERATED * v.tolerance * abs(v.start) if v.tolerance else np.inf


def bounded_parameters(answer: Answer) -> str:
    """A sentence on fitted base parameters that lie at limits of model.py; "" without.

    Zero is left out: friction or a load may well be nothing.
    """
    point = answer.point
    fitted = {f.name for f in point.free}
    found = [
        f"{v.name} lies at its limit, {limit:g}"
        for v in answer.core.model.parameters
        for limit in (v.min, v.max)
        if v.name in fitted and limit and np.isclose(point.values[v.name], limit, rtol=1e-3)
    ]
    return f"{', '.join(found)} (in model.py): a wider one may explain more." if found else ""


def bounded_effects(answer: Answer) -> str:
    """A sentence on parameters of named effects that lie at limits of the catalogue; "" without."""
    point = answer.point
    found = [
        f"{q.name} of {a.effect.name} lies at its limit, {point.values[a.name(q.name)]:g}"
        for a in answer.named
        for q in a.effect.parameters
        if a.name(q.name) in point.limited and point.values[a.name(q.name)] != 0.0
    ]
    return f"{words.listed(found)}: it may stand for something else." if found else ""


def _explained(core: Core, enough: float, lost: bool = False) -> Iterator[tuple[float, float, Reading]]:
    """Error ahead, nats of parameters and reading, where the model errs less than `enough`.

    What is taken for noise counts as error.  A parameter takes up much of another clock, and two channels
    may go together either way: of these the parameters may lie no farther from those of model.py.  `lost`:
    whether the model explains nothing as the recordings are; the nearest clock is asked then.
    """
    stated, units = _stated(core), rescaled(core)
    for reading in (*units, *driven(core), *relabelled(core), *unsigned(core)):
        error, whole, nats = _refitted(core, reading)
        near = reading in units or reading.signed or nats < stated
        if whole < enough and near and not _boundless(core, error, reading, lost):
            yield error, nats, reading


def _stated(core: Core) -> float:
    """Nats of parameters beside model.py that are as good as stated."""
    return Fitter.prior(core.base.values, core.base_free) + WORTH


def _rivals(answer: Answer, errs: float) -> Iterator[tuple[Reading, tuple[Attached, ...]]]:
    """Turned channels, beside all but one of the answer's effects or none; then inputs in other units.

    `errs`: error ahead of the model as the channels are.
    """
    less = [tuple(x for x in answer.present if x != a) for a in answer.present]
    yield from ((reading, own) for reading in turned(answer.core) for own in dict.fromkeys([(), *less]))
    if errs > LOST:
        yield from ((multiplied(r, n), ()) for n in inputs(answer.core) for r in known_ratios() if r != -1.0)


def _fitted(
    core: Core, reading: Reading, start: Values, present: tuple[Attached, ...], errs: float = np.inf
) -> tuple[float, Point] | None:
    """Error ahead and fit of the model with some effects, where the recordings are read so.

    None where slow motion, fitted first, errs more than `errs`: a channel that is right by then errs less.
    """
    known = core.turned if not present and start == core.fresh else {}
    if reading not in known:
        known[reading] = _fit(core, reading, start, present, errs)
    return known[reading]


def _read(core: Core, reading: Reading) -> Core:
    """A core whose recordings are read so: by channels turned, or inputs times a ratio."""
    other = copy(core)
    other.records = [replace(r, run=reading.of(r.run)) for r in core.records]
    other.kalman = core.kalman.over(other.records)
    other.fitter = Fitter(other.kalman, core.scored["fit"], core.fitter.noise)
    other.alone = None
    return other


def _by_itself(core: Core) -> tuple[float, float]:
    """How far the model errs by its output error, but the sensors' own noise; no end where it runs away.

    Then by how many nats its parameters are beside what model.py states.
    """
    found = [(beyond_sensors(core, p), Fitter.prior(p.values, core.base_free)) for p in alone(core)]
    return min(found, default=(np.inf, np.inf))


def _fit(
    core: Core, reading: Reading, start: Values, present: tuple[Attached, ...], errs: float
) -> tuple[float, Point] | None:
    other = _read(core, reading)
    free = [*core.base_free, *core.noise_free, *core.free_of(*present)]
    motion = [f for f in free if not f.of_noise]
    slow = other.fitter.fit(start, present, motion, STEPS, own=True, every=2) if motion else None
    if slow is not None and ahead(other, slow) > errs:
        return None
    begun = start if slow is None else slow.values
    point = other.fitter.fit(begun, present, free, STEPS, own=True, every=2)
    return None if point is None else (ahead(other, point), point)


def _refitted(core: Core, reading: Reading) -> tuple[float, float, float]:
    """Error ahead of the base model, fitted anew with all its scales, where the recordings are read so.

    Then noise and all, and by how many nats its parameters are then beside what model.py states.  No end
    where it runs away, or by another clock, in which little may move, does little better than standing still.
    """
    runs = {id(r): reading.of(r) for r in core.runs}

    def moved(blocks: Sequence[Block]) -> tuple[Block, ...]:
        return tuple(reading.block(b, runs[id(b.run)]) for b in blocks)

    parts = Parts(moved(core.parts.fit), moved(core.parts.confirm), moved(core.parts.holdout))
    try:
        other = Core(core.folder, parts, (), core.share)
    except (InputError, np.linalg.LinAlgError):  # the model runs away
        return np.inf, np.inf, np.inf
    most = _disturbance(core, core.base)  # a reading that is right leaves no more to it
    every = [p for p in (other.base, *alone(other)) if _disturbance(other, p) <= most]
    error, point = min(
        ((beyond_sensors(other, p), p) for p in every), default=(np.inf, other.base), key=lambda r: r[0]
    )
    whole = float(np.sqrt(squares(other, point)[0]))
    if reading.unit and whole > HALVED * standing(other):
        return np.inf, np.inf, np.inf
    return error, whole, Fitter.prior(point.values, core.base_free)


def _disturbance(core: Core, point: Point) -> float:
    """Share of the forces at some place that a disturbance takes over at most."""
    return max(core.disturbances(point.values).values(), default=0.0)


def _undriven(core: Core, error: float) -> bool:
    """Whether the model errs nearly as little as `error` without any input: none tells its sign then."""
    recorded = inputs(core)
    return bool(recorded) and error > HALVED * _by_itself(_read(core, multiplied(0.0, *recorded)))[0]


def _silent(core: Core, error: float, start: Values, present: tuple[Attached, ...]) -> bool:
    """Whether the model errs nearly as little as `error` without any input: none tells its sign or unit then.

    A dead zone that takes nearly all of a command leaves a gain at its bound, and turned round it does least.
    """
    recorded = inputs(core)
    tried = _fitted(core, multiplied(0.0, *recorded), start, present) if recorded else None
    return tried is not None and error > HALVED * tried[0]


def _boundless(core: Core, error: float, reading: Reading, lost: bool) -> bool:
    """Whether a ratio or clock further off leaves as little error: no force counts then, and no unit is told.

    Where the model is `lost` as it is, and a longer clock explains, only a nearer one counts.  A small swing
    is the same in any smaller unit, but degrees are what it is in.
    """
    units = {v.name: v.unit for v in core.model.outputs}
    if any(units.get(n) == "rad" and ratio < 1.0 for n, ratio in reading.ratios):
        return False
    longer = lost and reading.clock > 1.0
    others = [r for r in reading.further if not (longer and reading.nearer(r))]
    return any(HALVED * _refitted(core, other)[0] < error for other in others)


def _sentence(core: Core, reading: Reading, errs: float, less: float, names: Mapping[str, str]) -> str:
    gains = f"the model errs by {_left(less)} instead of {words.percent(errs)}"
    return asked(reading, core, gains, names)


def _left(error: float) -> str:
    return f"{words.percent(error)} of the outputs' motion" if error > NOTHING else "no more than the noise"
