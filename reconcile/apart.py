"""Clocks of recordings that together no set explains: what one shows alone tells how late the others are.

A search on recordings whose clocks differ may end in effects that take up a part of what the clocks do, and
leave so much that slopes tell no clock (nuisance.py).  One recording has one clock: what it shows alone is
held against the others, shifted in whole samples.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from reconcile import evidence, nuisance
from reconcile.data import Run, split
from reconcile.fit.point import Point
from reconcile.fit.problem import Problem
from reconcile.fit.solve import Fitted, fit
from reconcile.model import Folder
from reconcile.nuisance import MOST_S, Clock
from reconcile.search import Answer, Search
from reconcile.study import Study
from specs.errors import InputError

Report = Callable[..., None]
TRIED = 3  # recordings, the longest first
LEFT = 0.5  # of what is left without clocks that they may leave: shifts are in whole samples still


def differing(
    folder: Folder, given: Sequence[Sequence[Run]], study: Study, answer: Answer, said: Report
) -> tuple[dict[str, Clock], Answer]:
    """Clocks by recording, {} where they do not differ, and the answer that tells them.

    `given`: recordings to fit, to confirm, held out; `study` and `answer` are of all together.
    """
    found = nuisance.differing(study, answer)
    if found or not evidence.lost(answer.fitted):
        return found, answer
    for run in _longest(given[0]):
        said("recordings apart")
        alone = _alone(folder, run, study, answer)
        if alone and (found := _shifted(study, alone)):
            return found, alone
    return {}, answer


def _longest(runs: Sequence[Run]) -> list[Run]:
    """The longest stretches of different recordings; none where there is but one."""
    by_name = {r.name: r for r in sorted(runs, key=_length)}
    return sorted(by_name.values(), key=_length, reverse=True)[:TRIED] if len(by_name) > 1 else []


def _length(run: Run) -> float:
    return run.end_s - run.start_s


def _alone(folder: Folder, run: Run, study: Study, answer: Answer) -> Answer | None:
    """What a recording shows alone, carried over to all; None where that is nothing to rely on."""
    try:
        one = Study(folder, split([run], (), ()))
        found = Search(one).run()
    except InputError:  # too short, or it shows too little
        return None
    if evidence.lost(found.fitted) or any(a not in study.candidates for a in found.present):
        return None
    fitted = study.carried(found.fitted, one.named(found.fitted.point.p))
    return None if fitted is None else replace(answer, present=found.present, fitted=fitted)


def _shifted(study: Study, alone: Answer) -> dict[str, Clock]:
    """Clocks by recording in whole samples; {} where they do not differ, or leave too much still."""
    period = nuisance.period(study)
    count = int(MOST_S / period)
    shifts = period * np.arange(-count, count + 1)
    left = _left(study, alone.fitted, shifts)
    if not left:
        return {}
    table = np.array(list(left.values()))
    if table.min(axis=1).sum() > LEFT * table.sum(axis=0).min():
        return {}
    late = dict(zip(left, shifts[np.argmin(table, axis=1)], strict=True))
    own = nuisance.delay(study, alone)
    least = min(late.values(), key=lambda s: abs(s + own))
    return {n: Clock(float(s - least)) for n, s in late.items()}


def _left(study: Study, fitted: Fitted, shifts: np.ndarray) -> dict[str, np.ndarray]:
    """By recording what a fit leaves [shifts] with its outputs late by shifts [s]; {} if it gets nowhere."""
    delay, found = nuisance.column(study, "sensor_delay"), {}
    if delay is None:
        return {}
    for which in ("short", "holdout"):
        problem, there = study.problems[which], study.elsewhere(fitted, which)
        if there is None:
            continue
        for at, shift in enumerate(shifts):
            p = there.point.p.copy()
            p[delay] += shift
            squares = _squares(problem, replace(there.point, p=p))
            for window, left in zip(problem.windows, squares, strict=True):
                found.setdefault(window.run.name, np.zeros(len(shifts)))[at] += left
    return found


def _squares(problem: Problem, point: Point) -> list[float]:
    """What a point leaves by window, with initial states that have found their place."""
    moved = fit(problem, point, (), iterations=0)
    if moved is None:
        return [np.inf] * len(problem.windows)
    return [float(piece.errors @ piece.errors) for piece in moved.linear.pieces]
