"""Predictions of a closed FMU's held-out part, block by block: for scores and for the page."""

from collections.abc import Iterator, Mapping

import numpy as np

from reconcile.closed.problem import ClosedProblem
from reconcile.closed.search import ClosedAnswer
from reconcile.closed.starts import within
from reconcile.page.drawn import Course, Shown, Stretch
from reconcile.recordings.data import Block
from records.scores import scores

STRETCHES = 2  # drawn
LONGEST_S = 20.0  # of a stretch drawn

Errors = Mapping[str, Mapping[str, Mapping[tuple[str, str], np.ndarray]]]  # by stage, part, run and output


def stages(problem: ClosedProblem, answer: ClosedAnswer) -> Errors:
    """Errors in units of the noise, by stage: as it came, re-estimated (if a parameter was fitted), after."""
    before = {"nominal": problem.errors((), problem.prior())}
    reestimated = {"reestimated": answer.base.errors} if problem.base else {}
    return {**before, **reestimated, "after": answer.fitted.errors}


def courses(problem: ClosedProblem, errors: Errors) -> Iterator[tuple[Block, list[Course]]]:
    """Every held-out block with its outputs: measured, and predicted by stage."""
    units = {v.name: v.unit for v in problem.box.model.outputs}
    taken: dict[tuple[str, str], int] = {}
    for block in sorted(problem.parts.holdout, key=lambda b: (b.run.name, b.start_s)):
        found = []
        for n in problem.outputs:
            signal, key = block.run.outputs[n], (block.run.name, n)
            inside = within(signal.time, [problem.starts.span(block)])
            measured, first = signal.values[inside], taken.get(key, 0)
            last = taken[key] = first + len(measured)
            level = problem.sigma[n]
            predicted = {s: measured - level * e["holdout"][key][first:last] for s, e in errors.items()}
            found.append(Course(n, units[n], level, signal.time[inside], measured, predicted))
        yield block, found


def scored(problem: ClosedProblem, errors: Errors) -> dict[str, dict]:
    """RMSE, FIT and rating of every output."""
    units = {v.name: v.unit for v in problem.box.model.outputs}
    by_block = [c for _, found in courses(problem, errors) for c in found]
    return {
        n: scores(
            {s: [(c.measured, c.predicted[s]) for c in by_block if c.name == n] for s in errors}, units[n]
        )
        for n in problem.outputs
    }


def shown(problem: ClosedProblem, answer: ClosedAnswer) -> Shown:
    """What the page draws: the held-out blocks in which the answer gains most."""
    known = list(courses(problem, stages(problem, answer)))
    known.sort(key=lambda k: -sum(_gained(c) for c in k[1]))
    return Shown([_stretch(problem, block, found) for block, found in known[:STRETCHES]])


def _gained(c: Course) -> float:
    best = c.predicted.get("reestimated", c.predicted["nominal"])
    before, after = c.measured - best, c.measured - c.predicted["after"]
    return float(before @ before - after @ after) / c.floor**2


def _stretch(problem: ClosedProblem, block: Block, found: list[Course]) -> Stretch:
    end = min(block.end_s, block.start_s + LONGEST_S)
    units = {v.name: v.unit for v in problem.box.model.inputs}
    inputs = [
        _cut(Course(n, units[n], 0.0, s.time, s.values, {}), block.start_s, end)
        for n, s in block.run.inputs.items()
        if n in problem.box.ports.controls
    ]
    outputs = [_cut(c, block.start_s, end) for c in found]
    return Stretch(block.run.name, block.start_s, end, block.start_s, outputs, inputs)


def _cut(c: Course, start: float, end: float) -> Course:
    inside = (c.time >= start) & (c.time <= end)
    predicted = {s: v[inside] for s, v in c.predicted.items()}
    return Course(c.name, c.unit, c.floor, c.time[inside], c.measured[inside], predicted)
