"""What the page draws beside the figures of the report: held-out stretches, missing forces and residuals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reconcile.errors import regimes
from reconcile.errors.localise import Located
from reconcile.errors.regimes import Regime
from reconcile.errors.residual import missing_forces, residuals
from reconcile.filter.kalman import NOISES
from reconcile.filter.point import Point
from reconcile.page.drawn import Course, Gathered, Missing, Shown, Stretch
from reconcile.page.whole import inputs, whole
from reconcile.reporting.findings import STAGES, Findings
from reconcile.search.core import Core

WINDOWS = 2  # drawn
RESIDUALS = 3
MISSING = 2  # places


def shown(found: Findings) -> Shown:
    """What to draw of what was found: the windows that tell most first."""
    order = sorted(range(_count(found)), key=lambda k: -_telling(found, k))
    located = [x for x in found.located if x.accounts][:RESIDUALS]
    forces = missing(found.core, found.core.shown, _disturbed(found))
    stretches = [_stretch(found, k) for k in order[:WINDOWS]]
    return Shown(stretches, whole(found), _gathered(found, located), forces)


def _disturbed(found: Findings) -> Point:
    """The answer with a disturbance: without any, as the model by itself is fitted, no force is left over."""
    point = found.answer.point
    if not found.answer.by_itself:
        return point
    noise = {n: v for n, v in found.core.base.values.items() if n.startswith(NOISES)}
    return replace(point, values=point.values | noise)


def missing(core: Core, base: Point, point: Point) -> list[Missing]:
    """The missing force of the model without effects and of an answer, where it is largest beside the forces.

    Where a named effect pushes, it is that of the answer without its effects: what is left of it after them,
    and they.  Else the base model's own parameters would have taken over a part of it.
    """
    before = missing_forces(core, base)
    after = missing_forces(core, point) if point.present else []
    effects = _effects(core, point) if after else None
    if effects is not None:
        pushed = [np.any(f) for f in effects.T]
        before = [
            replace(left, values=left.values + f) if p else r
            for r, left, f, p in zip(before, after, effects.T, pushed, strict=True)
        ]
    sizes = [
        float(np.std(r.values)) / core.force_size(p) for r, p in zip(before, core.kalman.places, strict=True)
    ]
    order = sorted(range(len(before)), key=lambda k: -sizes[k])[:MISSING]
    return [
        _missing(core, before[k], after[k] if after else None, None if effects is None else effects[:, k])
        for k in order
    ]


def _effects(core: Core, point: Point) -> np.ndarray | None:
    """What an answer's effects do at every place [N, places] in the steps of fit and confirm."""
    run = core.kalman.run(point.values, point.present, smooth=True, own=True)
    if run is None:
        return None
    forces = core.kalman.forces(point.values, point.present, [f.z for f in run])
    return forces[np.concatenate([r.fit | r.confirm for r in core.records])]


def _missing(core: Core, r, after, effect: np.ndarray | None) -> Missing:
    known = [g for g in regimes.regressors(core) if g.kind in ("speed", "pose", "command")]
    ends = np.cumsum([0, *(len(t) for _, t in r.moments)])
    parts = list(zip(r.moments, ends[:-1], ends[1:], strict=True))
    over = [
        (
            g.label,
            g.unit,
            np.concatenate([regimes.values(core, g, w, t, r.states[a:b]) for (w, t), a, b in parts]),
        )
        for g in known
    ]
    own = _nearest(core, r, [o for o in over if np.ptp(o[2])])  # over what stands still nothing shows
    begun, times = 0.0, []
    for _, t in r.moments:  # one recording after the other
        times.append(begun + t - t[0])
        begun = float(times[-1][-1]) + core.period
    time = ("time, one recording after the other", "s", np.concatenate(times))
    seen = effect if effect is not None and np.any(effect) else None
    return Missing(
        r.name, r.unit, [*own[:3], time], r.values, 2.0 * r.noise, after.values if after else None, seen
    )


def _nearest(core: Core, r, over: list) -> list:
    """Speed and place of the axis itself first, then a command."""
    axis = next((a for a in core.folder.ports.axes if a.name == r.axis), None)
    names = [axis.velocity, axis.position] if axis else []
    own = [o for n in names for o in over if o[0] == n]
    commands = [o for o in over if o[0] in core.folder.ports.controls]
    return [*own, *commands[:1]] or over


# -------------------------------------------------------------------------------- held-out windows


def _count(found: Findings) -> int:
    return next((len(t) for t in found.traces.values() if t), 0)


def _telling(found: Findings, k: int) -> float:
    """How far the answer closes the gap in a window; where it has no effects, how far new parameters do."""
    before = found.traces["reestimated" if found.answer.present else "nominal"]
    return _squares(found, before, k) - _squares(found, found.traces["after"], k)


def _squares(found: Findings, traces, k: int) -> float:
    if traces is None:
        return 0.0
    return sum(float(np.sum((traces[k].error(n) / found.floors[n].level) ** 2)) for n in found.outputs)


def _stretch(found: Findings, k: int) -> Stretch:
    known = {s: t for s in STAGES if (t := found.traces[s]) is not None}
    one = next(iter(known.values()))[k]
    units = {v.name: v.unit for v in found.core.model.outputs}
    outputs, window = [], one.window
    for n in found.outputs:
        # with a sensor's delay fitted, the stretch has later samples
        predicted = {s: p for s, t in known.items() if (p := t[k].at(n, window.recorded[n])) is not None}
        level = found.floors[n].level
        outputs.append(Course(n, units[n], level, window.recorded[n], window.samples[n], predicted))
    return Stretch(
        window.run.name,
        window.start_s,
        window.end_s,
        window.start_s,
        _first(found, outputs, k),
        inputs(found.core, window.run, window.start_s, window.end_s),
    )


def _first(found: Findings, outputs: list[Course], k: int) -> list[Course]:
    """Signals with the largest gap first."""

    def size(c: Course) -> float:
        worst = c.predicted.get("reestimated", c.predicted.get("nominal", c.measured))
        return -float(np.mean((c.measured - worst) ** 2)) / c.floor**2

    return sorted(outputs, key=size)


# -------------------------------------------------------------------------------- residuals


def _gathered(found: Findings, located: Sequence[Located]) -> list[Gathered]:
    errors = [x.residual.signals[0] for x in located if x.residual.axis is None]
    after = {}
    if located and found.answer.present:
        after = {r.name: r for r in residuals(found.core, found.answer.point, errors)}
    return [_one(x, after.get(x.residual.name)) for x in located]


def _one(x: Located, after) -> Gathered:
    regime = x.places[0].regime if x.places else None
    best = x.best or (regime.regressor if regime else max(x.accounts, key=lambda r: x.accounts[r]))
    left = None
    if after is not None and len(after.values) == len(x.values):  # the same windows: the same regressor
        left = (x.against[best], after.values)
    bounds = _bounds(regime, x.against[best]) if regime is not None and regime.regressor == best else []
    accounts = {r.label: x.accounts[r] for r in sorted(x.accounts, key=lambda r: -x.accounts[r])}
    return Gathered(
        x.residual.name,
        x.residual.unit,
        best.label,
        best.unit,
        (x.against[best], x.values),
        left,
        bounds,
        regime.words if regime is not None and bounds else "",
        {"a constant": x.constant} | accounts,
        x.best is not None,
    )


def _bounds(regime: Regime, x: np.ndarray) -> list[tuple[float, float]]:
    """Stretches of the regressor that a regime covers, within the values met."""
    low, high = float(np.min(x)), float(np.max(x))
    sides = [(regime.low, regime.high)]
    if regime.size:
        sides = [(-regime.high, regime.high)] if regime.low <= 0.0 else [
            (-regime.high, -regime.low),
            (regime.low, regime.high),
        ]  # fmt: skip
    found = [(max(a, low), min(b, high)) for a, b in sides]
    return [(a, b) for a, b in found if b > a]
