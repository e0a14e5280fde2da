"""Within what an experiment has to stay: the ranges of inputs and of outputs, and where each is from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fmus.definition import Variable
from reconcile.recordings.data import Run, Signal
from reconcile.search.core import Core
from specs.errors import InputError
from specs.signals import signals

WIDER = 0.25  # of the recorded span of a signal, to either side, where nothing is stated
ROOM = 0.05  # of a stated range that a predicted motion keeps off its ends, but no more than
HALF = 0.5  # of the way there: an oil at rest has a pressure near the lower end
FIRST = 10  # samples of a recording, whose mean is where the machine starts
RATE = 0.5  # share of an input that is not the slope of another, if it is said to be its rate
Range = tuple[float, float]


@dataclass(frozen=True)
class Limit:
    """A range and its source: "stated", "recorded" or "none"."""

    low: float
    high: float
    source: str

    def excess(self, values: np.ndarray) -> float:
        """By what factor values leave it, seen from the first of them (<= 1: they do not)."""
        first = float(values[0])
        room = ROOM * (self.high - self.low) if self.source == "stated" else 0.0
        up, down = (side - min(room, HALF * side) for side in (self.high - first, first - self.low))
        if up <= 0.0 or down <= 0.0:
            return np.inf
        return float(max((np.max(values) - first) / up, (first - np.min(values)) / down))


@dataclass(frozen=True)
class Limits:
    """Ranges of the inputs that may be driven and of all that moves, and where it starts.

    `held`: inputs that are not driven and what they are; `followers`: inputs that are the integral of a
    driven one (rate -> position), as a suspension's place is of its speed.  `places`: outputs that show the
    position of an axis, which may start elsewhere.
    """

    inputs: dict[str, Range]
    outputs: dict[str, Limit]
    start: dict[str, float]
    places: tuple[str, ...] = ()
    held: dict[str, float] = field(default_factory=dict)
    followers: dict[str, str] = field(default_factory=dict)


def limits_of(core: Core, wide: bool = False, kept: Mapping[str, Range] | None = None) -> Limits:
    """Limits of a machine, `kept` before what its model states.

    `wide`: where outputs have none stated, what was recorded is none either.
    Raises InputError where no input has a range, stated or recorded.
    """
    runs, axes, names = core.runs, core.folder.ports.axes, core.outputs
    shown = {n: core.model.states[i].name for i, n, _ in core.kalman.shown}
    model = {v.name: v for v in (*core.model.inputs, *core.model.outputs)}
    followers = _followers(model, runs)
    inputs = _inputs(core, model, runs, set(followers.values()))
    followers = {rate: place for rate, place in followers.items() if rate in inputs}
    moving = {n: [r.outputs[n].values for r in runs] for n in names}
    outputs = {n: _output(model[n], values, wide, kept or {}) for n, values in moving.items()}
    for place in followers.values():
        outputs[place] = _output(model[place], [r.inputs[place].values for r in runs], False, {})
    rates = {a.velocity for a in axes}
    start = {n: 0.0 if shown.get(n) in rates else _first(runs[0].outputs[n]) for n in names}
    places = tuple(n for n in names if n in shown and shown[n] in {a.position for a in axes})
    held = {n: float(np.median(s.values)) for n, s in runs[0].inputs.items() if n not in inputs}
    held |= {n: 0.0 for n in _followers(model, runs) if n in held}
    return Limits(inputs, outputs, start, places, held, followers)


def _inputs(
    core: Core, model: Mapping[str, Variable], runs: Sequence[Run], led: set[str]
) -> dict[str, Range]:
    """Ranges of the inputs that may be driven: as stated for commands and own rigs, else as recorded."""
    found = {}
    for name in core.folder.ports.controls:
        recorded = [r.inputs[name].values for r in runs if name in r.inputs]
        if name not in led and (span := _range(model[name], recorded)):
            found[name] = span
    if not found:
        names = ", ".join(core.folder.ports.controls)
        raise InputError(f"no input has a range ({names}): state min and max in model.py")
    return found


def _range(v: Variable, recorded: Sequence[np.ndarray]) -> Range | None:
    known = signals()
    commanded = v.name not in known or known[v.name].kind == "command"
    low, high = (
        min((float(np.min(r)) for r in recorded), default=0.0),
        max((float(np.max(r)) for r in recorded), default=0.0),
    )
    if commanded and v.min is not None and v.max is not None:
        low, high = v.min, v.max
    return (float(low), float(high)) if high > low else None


def _output(v: Variable, recorded: Sequence[np.ndarray], wide: bool, kept: Mapping[str, Range]) -> Limit:
    low, high = (min(float(np.min(r)) for r in recorded), max(float(np.max(r)) for r in recorded))
    if v.name in kept:
        return Limit(*kept[v.name], "stated")
    if v.min is not None and v.max is not None:
        return Limit(min(v.min, low), max(v.max, high), "stated")
    if wide:
        return Limit(-np.inf, np.inf, "none")
    more = WIDER * (high - low)
    return Limit(low - more, high + more, "recorded")


def _followers(model: Mapping[str, Variable], runs: Sequence[Run]) -> dict[str, str]:
    """Inputs that are the rate of another: rate -> position."""
    names = [n for n in runs[0].inputs if n in model]
    return {
        rate: place
        for place in names
        for rate in names
        if model[rate].unit == model[place].unit + "/s" and any(_rate_of(r, rate, place) for r in runs)
    }


def _rate_of(run: Run, rate: str, place: str) -> bool:
    if rate not in run.inputs or place not in run.inputs:
        return False
    value, signal = run.inputs[rate].values, run.inputs[place]
    if len(value) != len(signal.values) or not np.any(value):
        return False
    off = np.gradient(signal.values, signal.time) - value
    return bool(np.linalg.norm(off) < RATE * np.linalg.norm(value))


def _first(signal: Signal) -> float:
    return float(np.mean(signal.values[:FIRST]))
