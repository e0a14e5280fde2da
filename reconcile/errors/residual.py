"""What a fit leaves over time: the missing force at each axis, and the outputs' errors ahead.

The missing force is the filter's disturbance: what has to push there for the model to follow the recording.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reconcile.errors import holdout
from reconcile.errors.holdout import Stretch
from reconcile.filter.kalman import NOISE
from reconcile.filter.point import Point
from reconcile.search.core import Core

PIECES = 30  # of the missing force over all recordings
LARGE = 2.0  # times its noise (root mean square): else there is nothing to localise


@dataclass(frozen=True)
class Residual:
    """A quantity that should be zero, over time.

    `values`, `noise` [N] in `unit`: the quantity and its standard deviation; `moments`: stretches with their
    times [n], in order; `states` [N, NX]: at those times.  `columns` [N, K]: what other base parameters would
    make of it.  `signals`: the outputs that it moves; `axis` is None for an output's own error.
    """

    name: str
    unit: str
    axis: str | None
    signals: tuple[str, ...]
    values: np.ndarray
    noise: np.ndarray
    moments: tuple[tuple[Any, np.ndarray], ...]
    states: np.ndarray
    columns: np.ndarray

    @property
    def window(self) -> np.ndarray:
        """Number of the stretch of each value [N]."""
        return np.repeat(np.arange(len(self.moments)), [len(t) for _, t in self.moments])

    @property
    def size(self) -> float:
        """Root mean square in units of its noise."""
        noise = float(np.mean(self.noise**2))
        return float(np.sqrt(np.mean(self.values**2) / noise)) if noise > 0.0 else 0.0


def residuals(core: Core, point: Point, errors: Sequence[str] = ()) -> list[Residual]:
    """What a point leaves on fit and confirm: missing forces, and errors of outputs that none accounts for.

    `errors`: outputs whose errors are looked at in any case.
    """
    forces = missing_forces(core, point)
    traces = holdout.predict(core, point, ("fit", "confirm"))
    units = {v.name: v.unit for v in core.model.outputs}
    shown = [f for f in forces if f.signals]
    accounted = {n for f in shown if f.size > LARGE for n in f.signals}
    # noise above what the recording shows at high frequency is no noise
    accounted = {n for n in accounted if point.values[NOISE + n] < LARGE * _noise_level(core, n)}
    rest = [n for n in core.outputs if n in errors or n not in accounted]
    return shown + ([_error(core, n, units[n], traces) for n in rest] if traces else [])


def missing_forces(core: Core, point: Point) -> list[Residual]:
    """The filter's disturbance at every place it pushes, in the steps of fit and confirm."""
    run = core.kalman.run(point.values, point.present, smooth=True, own=True)
    if run is None:
        return []
    nx, found = len(core.model.states), []
    whole = sum(int((r.fit | r.confirm).sum()) for r in core.records)
    names = core.kalman.state_names(point.present, own=True)
    for k, place in enumerate(core.kalman.places):
        column = len(names) + k
        values, noise, states, moments = [], [], [], []
        for record, f in zip(core.records, run, strict=True):
            inside = record.fit | record.confirm
            if not inside.any():
                continue
            values.append(f.z[inside, column])
            noise.append(np.sqrt(np.maximum(f.v[inside, column], 0.0)))
            states.append(f.z[inside, :nx])
            time = record.time[inside]
            # in pieces, whose scatter tells what is chance
            for piece in np.array_split(time, max(1, round(PIECES * len(time) / whole))):
                moments.append((Stretch(record.run, float(piece[0]), float(piece[-1]), {}, {}), piece))
        every = np.concatenate(values)
        axis = next((a for a in core.folder.ports.axes if a.name == place), None)
        unit = axis.unit if axis else _per_second(core, place)
        found.append(
            Residual(
                f"missing force at {place}" if axis else f"missing rate of {place}",
                unit,
                place if axis else None,
                _moved(core, place, axis),
                every,
                np.concatenate(noise),
                tuple(moments),
                np.vstack(states),
                np.zeros((len(every), 0)),
            )
        )
    return found


def _noise_level(core: Core, name: str) -> float:
    return max(core.floors[name].level, core.floor[name])


def _per_second(core: Core, state: str) -> str:
    unit = next(v.unit for v in core.model.states if v.name == state)
    return f"{unit}/s" if unit not in ("", "1") else "1/s"


def _moved(core: Core, place: str, axis) -> tuple[str, ...]:
    """Outputs that show the states which a place moves."""
    own = {axis.velocity, axis.position} if axis else {place}
    names = [v.name for v in core.model.states]
    shown = tuple(o for i, o, _ in core.kalman.shown if names[i] in own)
    return shown or tuple(core.outputs[:1])


def _error(core: Core, name: str, unit: str, traces) -> Residual:
    moments = tuple((t.window, t.window.times[name]) for t in traces)
    values = np.concatenate([t.error(name) for t in traces])
    states = np.vstack([t.state_at(t.window.times[name]) for t in traces])
    # not the fitted noise: that is as large as the error, whatever the error is
    noise = np.full(len(values), _noise_level(core, name))
    return Residual(
        f"error of {name}", unit, None, (name,), values, noise, moments, states, np.zeros((len(values), 0))
    )
