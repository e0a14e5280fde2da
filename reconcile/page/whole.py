"""A whole recording as the model by itself has it: what anybody would draw first."""

from collections.abc import Mapping

import numpy as np

from reconcile.errors.ahead import horizon_s
from reconcile.filter.kalman import Filtered
from reconcile.filter.point import Point
from reconcile.page.drawn import Course, Stretch
from reconcile.recordings.data import Run
from reconcile.reporting.findings import Findings
from reconcile.search.alone import alone, fit
from reconcile.search.core import Core

MOST = 1500  # samples of a signal that are drawn
BEGUN = 0.1  # of the recording, after which hidden states count as known at the latest


def whole(found: Findings) -> list[Stretch]:
    """The longest recording and what the model by itself makes of it; nothing where it runs away.

    It runs freely once its hidden states are known, with parameters that are fitted so: as it came, without
    effects, and with those of the answer.
    """
    core = found.core
    at = max(range(len(core.records)), key=lambda k: float(np.ptp(core.records[k].time)))
    record = core.records[at]
    time, length = record.time, float(np.ptp(record.time))
    begun = int(np.searchsorted(time, time[0] + min(horizon_s(core), BEGUN * length)))
    windows = [((r.time >= time[begun]) & (r is record)).astype(int) for r in core.records]
    free: dict[str, Filtered] = {}
    for stage, p in _points(found).items():
        if run := core.kalman.run(p.values, p.present, windows=windows, own=True):
            free[stage] = run[at]
    if not free:
        return []
    drawn = slice(begun, None, 1 + (len(time) - begun) // MOST)
    outputs = [_course(found, n, time[drawn], drawn, free) for n in found.outputs if n in record.run.outputs]
    span = float(time[begun]), float(time[-1])
    return [Stretch(record.run.name, *span, span[0], outputs, inputs(core, record.run, *span))]


def _points(found: Findings) -> dict[str, Point]:
    """By stage the model by itself."""
    core, answer = found.core, found.answer
    if not alone(core):
        return {}
    plain = alone(core)[0]
    points = {"nominal": core.nominal(plain), "reestimated": plain}
    if not answer.present:
        return points
    own = answer.point if answer.by_itself else fit(core, [answer.point.values], answer.present)
    return points | ({"after": own} if own else {})


def _course(
    found: Findings, name: str, time: np.ndarray, drawn: slice, free: Mapping[str, Filtered]
) -> Course:
    units = {v.name: v.unit for v in found.core.model.outputs}
    k = found.core.kalman.outputs.index(name)
    measured = next(iter(free.values())).y[drawn, k]
    seen = ~np.isnan(measured)
    predicted = {s: f.free[drawn, k][seen] for s, f in free.items()}
    return Course(name, units[name], found.floors[name].level, time[seen], measured[seen], predicted)


def inputs(core: Core, run: Run, start_s: float, end_s: float) -> list[Course]:
    """What drives the model in a stretch of a run."""
    units, found = {v.name: v.unit for v in core.model.inputs}, []
    for n in core.folder.ports.controls:
        signal = run.inputs.get(n)
        if signal is not None:
            inside = (signal.time >= start_s) & (signal.time <= end_s)
            found.append(Course(n, units[n], 0.0, signal.time[inside], signal.values[inside], {}))
    return found
