"""Other readings of recordings: channels turned round, in other units or exchanged; another clock."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeVar

import casadi as ca
import numpy as np

from reconcile.recordings.data import Block, Run, Signal
from reconcile.recordings.ends import held
from reconcile.search.core import Core
from reconcile.start.units import THOUSAND, bare, both_ways, known_ratios, other_units, turned_line, turns
from records.formats.units import seconds

Span = TypeVar("Span", Run, Block)
ZERO = 273.15  # K, of degC
FAHRENHEIT = 5.0 / 9.0  # K in a degree of it
MANY = 4  # channels, beyond which only those of one unit may have been exchanged
NEAR = 2.0  # times that a signal may be from another unit
CLOCKS = ("us", "ms", "s", "min")  # units in which a time may be
SECONDS = {u: float(seconds(np.ones(1), u, "")[0]) for u in (*CLOCKS, "h", "d")}


@dataclass(frozen=True)
class Reading:
    """What channels are multiplied by (`ratios`); two that are exchanged; the time's unit, and that stated.

    `added`: to some channels, for a zero that is elsewhere.  `signed`: an input that takes an output's sign.
    """

    ratios: tuple[tuple[str, float], ...] = ()
    exchanged: tuple[str, ...] = ()
    unit: str = ""
    stated: str = "s"
    added: tuple[tuple[str, float], ...] = ()
    signed: tuple[str, ...] = ()

    @property
    def clock(self) -> float:
        """What the time is multiplied by."""
        return SECONDS[self.unit] / SECONDS[self.stated] if self.unit else 1.0

    @property
    def further(self) -> list["Reading"]:
        """The same ratios once more, or other clocks that are longer or shorter too.

        Where one of them leaves as little error, no unit is told.
        """
        again = replace(self, ratios=tuple((n, r**2) for n, r in self.ratios))
        others = [replace(self, unit=u) for u in CLOCKS if u != self.stated] if self.unit else [again]
        return [r for r in others if r != self and (r.clock < 1.0) == (self.clock < 1.0)]

    def nearer(self, other: "Reading") -> bool:
        """Whether this clock is nearer to the one stated."""
        return abs(np.log(self.clock)) < abs(np.log(other.clock))

    def of(self, run: Run) -> Run:
        """The run as it is read so."""
        ratios, added, both = dict(self.ratios), dict(self.added), {**run.inputs, **run.outputs}
        other = dict(zip(self.exchanged, reversed(self.exchanged), strict=True))
        if not set(other) <= set(both):
            other = {}
        if set(self.signed) <= set(both) and self.signed:
            both |= {self.signed[0]: _signed_as(*(both[n] for n in self.signed))}

        def read(names: Mapping[str, Signal]) -> dict[str, Signal]:
            taken = {n: both[other.get(n, n)] for n in names}
            return {
                n: Signal(self.clock * s.time, ratios.get(n, 1.0) * s.values + added.get(n, 0.0))
                for n, s in taken.items()
            }

        before = self.clock * run.before_s
        return replace(self._timed(run), before_s=before, inputs=read(run.inputs), outputs=read(run.outputs))

    def block(self, of: Block, run: Run) -> Block:
        """A block of a `run` that is read so."""
        return replace(self._timed(of), run=run)

    def _timed(self, span: Span) -> Span:
        return replace(span, start_s=self.clock * span.start_s, end_s=self.clock * span.end_s)


def multiplied(ratio: float, *names: str) -> Reading:
    """Channels times a ratio."""
    return Reading(tuple((n, ratio) for n in names))


def turned(core: Core) -> list[Reading]:
    """Every input turned round, and every axis with all that is its rate."""
    groups = [[n] for n in inputs(core)] + turns(core.model, core.outputs)
    return [multiplied(-1.0, *group) for group in groups]


def rescaled(core: Core) -> list[Reading]:
    """Every position or speed of an axis in another unit, where no recorded rate of it says which it is.

    Of a model without axes, every state that is recorded.  Other outputs where they are a thousand times what
    the model starts with, or a thousandth.
    """
    units = {v.name: v.unit for v in core.model.outputs}
    axes, states = core.folder.ports.axes, [v.name for v in core.model.states]
    moving = {n for a in axes for n in (a.position, a.velocity)} if axes else {*states}
    shown = {n for i, n, _ in core.kalman.shown if core.model.states[i].name in moving}
    alone = [group[0] for group in turns(core.model, core.outputs) if len(group) == 1]
    usual = [multiplied(ratio, n) for n in alone if n in shown for ratio in other_units(units[n])]
    others = {n: level for n, level in _levels(core).items() if n not in alone or n not in shown}
    ratios = both_ways(THOUSAND)
    far = [multiplied(r, n) for n, level in others.items() for r in ratios if 1.0 / NEAR < level * r < NEAR]
    return usual + far


def driven(core: Core) -> list[Reading]:
    """Every input in another unit: a gain takes that up, unless it would lie beyond limits in model.py."""
    units = {v.name: v.unit for v in core.model.inputs}
    return [multiplied(ratio, n) for n in inputs(core) for ratio in other_units(units[n])]


def _levels(core: Core) -> dict[str, float]:
    """How many times the size an output has that it has at the model's start; none where that is nothing."""
    model = core.model
    if model.symbolic == "MX":
        return {}
    p = model.start_parameters()
    u, m = ca.DM([v.start for v in model.inputs]), ca.DM([v.start for v in model.modes])
    begun = np.abs(np.asarray(ca.DM(model.h(model.x0(p), u, m, p))).ravel())
    each = zip((v.name for v in model.outputs), begun, strict=True)
    return {n: float(np.median(np.abs(_values(core, n)))) / y for n, y in each if y and n in core.outputs}


def relabelled(core: Core) -> list[Reading]:
    """The time in another unit, every two channels exchanged, temperatures from another zero.

    Of many channels those of one unit: each reading costs a fit.  An input that is held is no output's
    reading.  A model in steps has its own clock.
    """
    units = {v.name: v.unit for v in (*core.model.inputs, *core.model.outputs)}
    channels = [*inputs(core), *core.outputs]
    pairs = [(a, b) for a, b in combinations(channels, 2) if units[a] == units[b] or len(channels) <= MANY]
    commands = [n for n in inputs(core) if held(_values(core, n))]
    pairs = [(a, b) for a, b in pairs if a not in commands or held(_values(core, b))]
    warm = [n for n in core.outputs if units[n] in ("K", "degC")]
    cold = [
        (1.0, ZERO),
        (1.0, -ZERO),
        *((FAHRENHEIT, -32.0 * FAHRENHEIT) for n in warm[:1] if units[n] == "degC"),
    ]
    stated = {r.clock_unit for r in core.runs} if core.model.kind != "discrete" else set()
    clocks = [Reading(unit=u, stated=s) for s in stated & {*SECONDS} for u in CLOCKS if u != s]
    zeros = [
        Reading(tuple((n, r) for n in warm if r != 1.0), added=tuple((n, zero) for n in warm))
        for r, zero in cold
        if warm
    ]
    others = [Reading(exchanged=pair) for pair in pairs] + zeros
    return (clocks if len(stated) == 1 else []) + others


def unsigned(core: Core) -> list[Reading]:
    """Inputs that never are negative, as duties that a driver logs, beside outputs that turn round."""
    both_signs = [n for n in core.outputs if (y := _values(core, n)).min() < 0.0 < y.max()]
    may = {v.name for v in core.model.inputs if v.min is None or v.min < 0.0}
    one = [n for n in inputs(core) if n in may and _values(core, n).min() >= 0.0]
    return [Reading(signed=(u, y)) for u in one for y in both_signs]


def _values(core: Core, name: str) -> np.ndarray:
    """All that was recorded of a channel."""
    each = ({**r.inputs, **r.outputs}.get(name) for r in core.runs)
    return np.concatenate([s.values for s in each if s is not None])


def _signed_as(signal: Signal, other: Signal) -> Signal:
    return replace(signal, values=signal.values * np.sign(np.interp(signal.time, other.time, other.values)))


def inputs(core: Core) -> list[str]:
    """Inputs that are recorded."""
    return [n for n in core.folder.ports.controls if any(n in r.inputs for r in core.runs)]


def asked(reading: Reading, core: Core, gains: str, names: Mapping[str, str]) -> str:
    """The question whether the recordings are to be read so; `gains`: what that does.

    `names`: the map, {their column: ours}.
    """
    theirs = {bare(ours): column for column, ours in names.items()}
    if reading.exchanged:
        return _exchanged(reading.exchanged, gains, theirs)
    if reading.unit:
        return _clocked(reading, gains, theirs)
    if reading.signed:
        u, y = (theirs.get(n, n) for n in reading.signed)
        return f"column {u}: with the sign of {y}, {gains}; it has no negative values: write its sign into it"
    channels = [n for n, _ in reading.ratios or reading.added]
    both = " and ".join(theirs.get(n, n) for n in channels)
    stated = ", ".join(f"'{theirs.get(n, n)}' = '{n} [unit]'" for n in channels)
    state = f"state its unit in [names] of --map, as in {stated}, or correct model.py"
    if reading.added:
        if reading.ratios:
            return f"column {both}: as degrees Fahrenheit, {gains}; {state}"
        return f"column {both}: with {reading.added[0][1]:+g}, {gains}: degC against K; {state}"
    ratio = reading.ratios[0][1]
    if ratio != -1.0:
        return f"column {both}: {ratio:.4g} times as large, {gains}: {known_ratios()[ratio]}; {state}"
    lines = "; ".join(turned_line(n, names) for n in channels)
    may_fall = core.folder.ports.axes and not set(channels) & {v.name for v in core.model.inputs}
    direction = ", or gravity in model.py" if may_fall else ""
    return (
        f"column {both}: with the sign turned, {gains}; write {lines} in [names] of --map, or turn the sign "
        f"of what depends on it{direction}"
    )


def _exchanged(pair: tuple[str, ...], gains: str, theirs: Mapping[str, str]) -> str:
    a, b = pair
    one, other = theirs.get(a, a), theirs.get(b, b)
    return (
        f"columns {one} and {other}: with one taken for the other, {gains}; if they were exchanged, write "
        f"'{one}' = '{b}' and '{other}' = '{a}' in [names] of --map, or correct model.py"
    )


def _clocked(reading: Reading, gains: str, theirs: Mapping[str, str]) -> str:
    column, unit = theirs.get("time", "time"), reading.unit
    return (
        f"column {column}: {reading.clock:.4g} times as long, {gains}; if its times are in {unit}, write "
        f"'{column}' = 'time [{unit}]' in [names] of --map, or correct model.py"
    )
