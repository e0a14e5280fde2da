"""Which effects of the catalogue fit which port of a closed FMU, with sizes for their starts."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from reconcile.catalogue import ALL, Effect, Scales
from reconcile.catalogue.effect import Parameter
from reconcile.closed.box import Box, Feedback
from reconcile.closed.least_squares import Free
from reconcile.equations.model import ALL_OUTPUTS, Attached
from reconcile.recordings.data import Run

SPREAD = 0.5  # of a parameter, as a share of its start: how far it may be wrong

WIDTH = 1e-3  # of the largest input: over which a kink is rounded
FLANK = 2e-3  # of the largest speed: over which dry friction turns
BIAS = "sensor_bias"


def candidates(box: Box, recorded: set[str], free: Collection[str] = ()) -> list[Attached]:
    """Every effect at every port of the box that the recorded signals let be told.

    `free`: outputs whose initial value is free, in which a bias is not told from it.
    """
    found = []
    for effect in (e for e in ALL if not (e.port or e.clock)):
        if effect.place == "input":
            found += _crossed(effect, [n for n in box.ports.controls if n in recorded], box)
        elif effect.place == "output":
            hidden = free if effect.name == BIAS else ()
            outputs = [n for n in box.ports.outputs if n in recorded and n not in hidden]
            found += _crossed(effect, outputs, box)
            if effect.delays and len(outputs) > 1:
                found.append(Attached(effect, ALL_OUTPUTS))
        elif effect.place == "force":
            found += [
                Attached(effect, f.input) for f in box.ports.feedbacks if _fits(effect, f, box, recorded)
            ]
    return found


def _crossed(effect: Effect, names: Sequence[str], box: Box) -> list[Attached]:
    if "other" not in effect.needs:
        return [Attached(effect, n) for n in names]
    unit = {v.name: v.unit for v in (*box.model.inputs, *box.model.outputs)}
    return [Attached(effect, n, o) for n in names for o in names if n != o and unit[n] == unit[o]]


def _fits(effect: Effect, feedback: Feedback, box: Box, recorded: set[str]) -> bool:
    units = {v.name: v.unit for v in box.model.outputs}
    there = feedback.velocity in recorded and (not feedback.position or feedback.position in recorded)
    turns = bool(feedback.position) and units[feedback.position or ""] == "rad"
    known = {"q": bool(feedback.position), "rad": turns}
    return there and all(known.get(need, False) for need in effect.needs)


class Sizes:
    """Sizes met in the recordings, by port: for starts, steps and bounds of parameters."""

    def __init__(self, box: Box, runs: Sequence[Run]):
        period = min(r.period_s for r in runs)
        self.box = box
        self.scales: dict[str, Scales] = {ALL_OUTPUTS: Scales(period_s=period)}
        for n in box.ports.controls:
            self.scales[n] = Scales(u=_most(r.inputs.get(n) for r in runs), period_s=period)
        for n in box.ports.outputs:
            self.scales[n] = Scales(y=_most(r.outputs.get(n) for r in runs), period_s=period)
        for f in box.ports.feedbacks:
            self.scales[f.input] = self._motion(f, runs, period)

    def _motion(self, f: Feedback, runs: Sequence[Run], period: float) -> Scales:
        units = {v.name: v.unit for v in (*self.box.model.inputs, *self.box.model.outputs)}
        pushing = [self.scales[n].u for n in self.box.ports.controls if units[n] == units[f.input]]
        position = f.position or ""
        positions = [r.outputs[position].values for r in runs if position in r.outputs]
        q = np.concatenate(positions) if positions else np.array([-1.0, 1.0])
        return Scales(
            v=_most(r.outputs.get(f.velocity) for r in runs),
            f=max(pushing, default=1.0),
            q=float(np.max(np.abs(q))) or 1.0,
            q_low=float(np.min(q)),
            q_high=float(np.max(q)),
            angular=units.get(f.position or "") == "rad",
            period_s=period,
        )

    def width(self, a: Attached) -> dict[str, float]:
        """The rounding of an effect's kinks, where it has some."""
        s = self.scales[a.port]
        sizes = {"u": WIDTH * s.u, "y": WIDTH * s.y, "v": FLANK * s.v, "q": WIDTH * s.q, "time": s.period_s}
        return {a.name("width"): sizes[a.effect.width]} if a.effect.width else {}

    def free(self, a: Attached) -> list[Free]:
        """The parameters of an effect as a fit moves them."""
        return [self._free(a, q) for q in a.effect.parameters]

    def _free(self, a: Attached, q: Parameter) -> Free:
        s = self.scales[a.port]
        starts = tuple(q.starts(s))
        low, high = q.bounds(s)
        if not q.amplitude and min(starts) > 0.0:
            low, high = max(low, 0.1 * min(starts)), min(high, 10.0 * max(starts))
        size = max(abs(v) for v in starts) or _size(q.unit, s)
        return Free(a.name(q.name), low, high, size)

    def base(self) -> list[Free]:
        """The FMU's own parameters, with a prior about their start values."""
        found = []
        for v in self.box.model.parameters:
            if v.start:
                low = -np.inf if v.min is None else v.min
                high = np.inf if v.max is None else v.max
                spread = SPREAD * abs(v.start)
                found.append(Free(v.name, low, high, spread, (v.start, spread)))
        return found


def _most(signals) -> float:
    sizes = [float(np.max(np.abs(s.values))) for s in signals if s is not None]
    return max(sizes, default=1.0) or 1.0


def _size(unit: str, s: Scales) -> float:
    """A size for an amplitude, from its unit at the port."""
    if unit == "s":
        return s.period_s
    size = s.f if unit.startswith("{f}") else s.u if unit == "{u}" else s.y if unit == "{y}" else 1.0
    for text, value in (("({v})^2", s.v**2), ("({v})", s.v), ("({q})^3", s.q**3), ("({q})", s.q)):
        if text in unit:
            return size / value
    return size


def units(a: Attached, box: Box) -> Mapping[str, str]:
    """Units at a port for the templates of parameters."""
    unit = {v.name: v.unit for v in (*box.model.inputs, *box.model.outputs)}
    f = next((x for x in box.ports.feedbacks if x.input == a.port), None)
    q, v = (unit.get(f.position or "", ""), unit[f.velocity]) if f else ("", "")
    own = unit.get(a.port, "")
    other = unit.get(a.other or "", "")
    return {"u": own, "y": own, "f": own, "v": v, "q": q, "other": other, "inertia": ""}
