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
    if evidence.lost(found.fitted):
        return None
    fitted = _carried(study, found.fitted, one.named(found.fitted.point.p))
    return None if fitted is None else replace(answer, present=found.present, fitted=fitted)


def _carried(study: Study, fitted: Fitted, values: dict[str, float]) -> Fitted | None:
    """The parameters of a fit in another study, with initial states of their own."""
    problem, present = study.fit_problem, fitted.point.present
    if any(a not in study.candidates for a in present):
        return None
    start = problem.start({n: values.get(n, v) for n, v in study.values.items()})
    return fit(problem, problem.with_present(start, present), fitted.free, iterations=0)


def _shifted(study: Study, alone: Answer) -> dict[str, Clock]:
    """Clocks by recording in whole samples; {} where they do not differ, or leave too much still."""
    period = study.parts.fit[0].run.period_s
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
    for which in ("short", "holdout"):
        there = study.elsewhere(fitted, which)
        if delay is None or there is None:
            continue
        for at, shift in enumerate(shifts):
            p = there.point.p.copy()
            p[delay] += shift
            moved = fit(study.problems[which], replace(there.point, p=p), (), iterations=0)
            for k, window in enumerate(study.problems[which].windows):
                row = found.setdefault(window.run.name, np.zeros(len(shifts)))
                row[at] += np.inf if moved is None else _squares(moved.linear.pieces[k].errors)
    return found


def _squares(errors: np.ndarray) -> float:
    return float(errors @ errors)
