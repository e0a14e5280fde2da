"""Within what an experiment has to stay: the ranges of inputs and of outputs, and where each is from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fmus.definition import Variable
from reconcile.study import Study, unique
from specs.errors import InputError

WIDER = 0.25  # of the recorded span of an output, to either side, where nothing is stated
ROOM = 0.05  # of an output's range that a predicted motion keeps off its ends
FIRST_S = 0.2  # of a recording, whose mean is where the machine starts
Range = tuple[float, float]


@dataclass(frozen=True)
class Limit:
    """A range and its source: "stated" in the model, "recorded" or "none"."""

    low: float
    high: float
    source: str


@dataclass(frozen=True)
class Limits:
    """Ranges of the inputs that may be driven and of the outputs, and where the outputs start."""

    inputs: dict[str, Range]
    outputs: dict[str, Limit]
    start: dict[str, float]
    places: tuple[str, ...]  # outputs that show the position of an axis, which may start elsewhere

    def excess(self, name: str, values: np.ndarray) -> float:
        """By what factor a predicted output leaves its range, seen from its start (<= 1: it does not)."""
        limit, first = self.outputs[name], float(values[0])
        room = ROOM * (limit.high - limit.low) if limit.source == "stated" else 0.0
        up, down = limit.high - room - first, first - limit.low - room
        if up <= 0.0 or down <= 0.0:
            return np.inf
        return float(max((np.max(values) - first) / up, (first - np.min(values)) / down))


def limits_of(study: Study, wide: bool = False) -> Limits:
    """Limits of a study's machine; `wide`: where outputs have none stated, what was recorded is none.

    Raises InputError where an input has no range: neither stated nor recorded.
    """
    runs = unique([b.run for b in (*study.parts.fit, *study.parts.confirm, *study.parts.holdout)])
    model = {v.name: v for v in (*study.model.inputs, *study.model.outputs)}
    inputs = {}
    for name in study.folder.ports.controls:
        recorded = [r.inputs[name].values for r in runs if name in r.inputs]
        inputs[name] = _input(model[name], recorded)
    rates = {a.velocity for a in study.folder.ports.axes}
    positions = {a.position for a in study.folder.ports.axes}
    outputs, start = {}, {}
    for name in study.floors:
        signals = [r.outputs[name] for r in runs]
        outputs[name] = _output(model[name], [s.values for s in signals], wide)
        first = signals[0].values[signals[0].time <= signals[0].time[0] + FIRST_S]
        start[name] = 0.0 if _shows(study, name) in rates else float(np.mean(first))
    places = tuple(n for n in study.floors if _shows(study, n) in positions)
    return Limits(inputs, outputs, start, places)


def _input(v: Variable, recorded: Sequence[np.ndarray]) -> Range:
    size = max((float(np.max(np.abs(r))) for r in recorded), default=0.0)
    low = v.min if v.min is not None else min((float(np.min(r)) for r in recorded), default=0.0)
    high = v.max if v.max is not None else size
    if not high > low:
        raise InputError(f"input {v.name} has no range: state its min and max in model.py")
    return float(low), float(high)


def _output(v: Variable, recorded: Sequence[np.ndarray], wide: bool) -> Limit:
    low, high = (min(float(np.min(r)) for r in recorded), max(float(np.max(r)) for r in recorded))
    if v.min is not None and v.max is not None:
        return Limit(min(v.min, low), max(v.max, high), "stated")
    if wide:
        return Limit(-np.inf, np.inf, "none")
    more = WIDER * (high - low)
    return Limit(low - more, high + more, "recorded")


def _shows(study: Study, output: str) -> str:
    """The state that an output shows, or an empty name."""
    shown = study.fit_problem._shown_states()
    return next(
        (study.model.states[i].name for i, (n, order) in shown.items() if n == output and not order), ""
    )
