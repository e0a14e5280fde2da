"""Offsets in time between inputs and outputs, or between outputs, that are a matter of how they are recorded.

The model holds an input's sample until the next one.  An input that varies in between acts half a sample
earlier than that; so does the position of a simulation by the semi-implicit Euler method.  One that is logged
a cycle late acts a whole sample earlier.  Outputs of the explicit Euler method are half a sample late, and so
are speeds by backward differences.  None of this is the machine's, and no effect of the catalogue is early: a
hidden shaft would have to stand for it.  So the search may take an offset as it takes an effect.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

from reconcile import words
from reconcile.catalogue.inputs import SHORTEST
from reconcile.catalogue.offset import NAME
from reconcile.equations.model import Attached, Folder
from reconcile.filter.point import Point, standard_errors
from reconcile.judging.answer import Answer
from reconcile.recordings import offsets as recorded
from reconcile.recordings.data import Run, split
from reconcile.recordings.offsets import input_period
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.search.sets import LONG, effects
from reconcile.tolerances import INPUT_GAIN, LEAST_FLOOR, WORTH

SURE = 3.0  # standard errors by which an offset may be beside a multiple of half a sample …
NEAR, FAR = 0.05, 0.2  # … but at least, and at most, so much of half a sample
OF_STEPS = 0.1  # samples: steps within a sample, as simulations have them, make delays as short
DEGREES, PARTS = (1, 3, 0), (1, 2)  # of inputs that vary between their samples, or are held; of a step
DELAYS = "input_delay", "sensor_delay"


def found(beam: Beam) -> dict[Attached, float]:
    """Offsets of the best set: by how much (s) what is there is late, or early where that is negative."""
    _beside_shafts(beam)
    best = beam.ranked()[0]
    if any(_is_offset(beam, best, a) for a in best):
        point = beam.points[best]
        beam.fit(best, point.present, [point.values], LONG, near=point)
        less = tuple(a for a in best if not _is_offset(beam, best, a))
        beam.refit(best, less, iterations=LONG)
        without = frozenset(less)
        if without in beam.points and beam.evidence(best) < beam.evidence(without) + INPUT_GAIN:
            return {}  # a lag and an early output, which undo each other
        best = beam.ranked()[0]
    every = {a: _rounded(beam, best, a) for a in best if _is_offset(beam, best, a)}
    return {a: late for a, late in every.items() if late}


def _beside_shafts(beam: Beam) -> None:
    """Fit the best set with an offset in place of a shaft: a stiff one shows as that does."""
    best = beam.ranked()[0]
    own = beam.core.offset
    if own is None:
        return
    for shaft in [a for a in best if a.effect.shaft]:
        beam.refit(best, tuple(a for a in best if a != shaft), False)
        less = best - {shaft}
        if less in beam.points and own not in less:
            point = beam.points[less]
            start = point.values | {own.name("delay"): -0.5 * input_period(beam.core.runs)}
            beam.fit(less | {own}, (*point.present, own), [start], LONG, fresh=effects(start, point.present))


def _rounded(beam: Beam, key: frozenset[Attached], a: Attached) -> float:
    """An offset, or the multiple of half a sample that it may be: for these there are reasons."""
    late, half = _late(beam, key, a), 0.5 * input_period(beam.core.runs)
    error = standard_errors(beam.points[key])[a.name(a.effect.parameters[0].name)]
    nearest = half * round(late / half)
    beside = min(max(SURE * error, NEAR * half), FAR * half)
    return nearest if abs(late - nearest) < beside else late


def _delays(a: Attached) -> bool:
    """Whether an effect is a delay, or a lag that looks like one where it is short."""
    late = a.effect.delays or any(n in DELAYS for n in a.effect.becomes)
    return late and not a.effect.clock and len(a.effect.parameters) == 1


def _is_offset(beam: Beam, key: frozenset[Attached], a: Attached) -> bool:
    """Whether it is an offset, or a delay or lag as an offset would be, of an output or of the only input."""
    if a.effect.name == NAME:
        return True
    several = a.effect.place == "input" and len(beam.core.folder.ports.controls) > 1
    if several or not _delays(a):
        return False
    period = input_period(beam.core.runs)
    return _late(beam, key, a) <= SHORTEST * period or _rounded(beam, key, a) == 0.5 * period


def short(answer: Answer) -> str:
    """A sentence on named delays and lags that a simulation's own steps look like; "" without."""
    period, values = input_period(answer.core.runs), answer.point.values
    late = {a: values[a.name(a.effect.parameters[0].name)] / period for a in answer.named if _delays(a)}
    found = [f"{a.effect.name} is {x:.2f} samples long" for a, x in late.items() if x < OF_STEPS]
    return f"{words.listed(found)}: the finer steps of a simulation would look the same." if found else ""


def everywhere(answer: Answer) -> str:
    """A sentence on a delay of all outputs that is named, where several inputs may be late instead."""
    core = answer.core
    several = sum(any(n in r.inputs for r in core.runs) for n in core.folder.ports.controls) > 1
    late = [a for a in answer.named if a.effect.name == "sensor_delay"]
    if not several or not any(core.folder.ports.holds(a.port, core.outputs) for a in late):
        return ""
    return "Inputs that are all late by as much would look the same."


def _late(beam: Beam, key: frozenset[Attached], a: Attached) -> float:
    return beam.points[key].values[a.name(a.effect.parameters[0].name)]


def without(points: Sequence[Point], offsets: Sequence[Attached]) -> list[Point]:
    """Points without these offsets, and any of outputs: a delay in the values acts, present or not."""
    found = []
    for p in points:
        left = [a for a in p.present if a in offsets or a.effect.name == NAME]
        absent = {a.name(q.name): 0.0 for a in left for q in a.effect.amplitudes}
        present = tuple(a for a in p.present if a not in left)
        found.append(replace(p, present=present, values=p.values | absent))
    return found


def drop(beam: Beam) -> None:
    """Leave offsets out of a search from here on, and the sets that have one."""
    core = beam.core
    core.candidates = [a for a in core.candidates if a.effect.name != NAME]
    beam.pool &= set(core.candidates)
    beam.points = {k: p for k, p in beam.points.items() if all(a.effect.name != NAME for a in k)}


def set_right(
    folder: Folder, given: Sequence[Sequence[Run]], late_s: Mapping[Attached, float]
) -> Sequence[Sequence[Run]]:
    """Runs of each purpose without offsets in time: by how much what is there is late (s).

    Where all outputs are early by half a sample, inputs may vary between their samples.  Whether they do, on
    straight lines or curves, and whether their mean over a step is enough, the model without effects says.
    """
    runs = [r for own in given for r in own]
    shown = {n for r in runs for n in r.outputs}
    apart = [a for a in late_s if a.effect.place == "output" and not folder.ports.holds(a.port, shown)]
    outputs = {n: late_s[a] for a in apart for n in folder.ports.members(a.port)}
    given = [recorded.with_outputs(own, outputs) for own in given]
    whole = sum(s for a, s in late_s.items() if a not in apart)
    if not whole:
        return given
    period = input_period(runs)

    def tried(degree: int, parts: int) -> Sequence[Sequence[Run]]:
        return [recorded.with_inputs(own, whole, period, degree, parts) for own in given]

    @lru_cache
    def total(degree: int, parts: int) -> float:
        return Core(folder, split(*tried(degree, parts)), (), LEAST_FLOOR).base.total

    degree = min(DEGREES, key=lambda d: total(d, 1) + (WORTH if d != DEGREES[0] else 0.0))
    return tried(degree, min(PARTS, key=lambda n: total(degree, n) + (WORTH if n > 1 else 0.0)))
