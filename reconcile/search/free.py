"""What is fitted of a model and of its effects: centres, sizes and limits, from units and scales."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fmus.definition import Variable
from reconcile.catalogue import Scales
from reconcile.catalogue.effect import Parameter
from reconcile.catalogue.kinds import kind
from reconcile.equations.model import Attached, Folder
from reconcile.filter.point import Free

LATEST = 0.25  # of the longest recording: the most that a delay may be, so that enough is left to compare
BROAD = 0.7  # log of a base parameter's ratio to its start: half or twice


@dataclass(frozen=True)
class FreeParameters:
    """Of a folder and its candidates; `duration_s` of the longest run, `memory_s` in which outputs forget."""

    folder: Folder
    duration_s: float
    memory_s: float

    def of_base(self) -> list[Free]:
        """The model's own parameters, where they are in doubt."""
        return [f for v in self._doubtful() if (f := self._base(v))]

    def _doubtful(self) -> list[Variable]:
        model, doubtful = self.folder.model, self.folder.ports.doubtful
        left = {n for s in model.sensors.values() for n in (s.noise, s.bias, s.quantum) if n}
        left |= {n for m in model.modes for n in (m.on_delay, m.off_delay) if n}
        names = [v for v in model.parameters if not v.fixed and v.name not in left]
        return [v for v in names if doubtful is None or v.name in doubtful]

    @staticmethod
    def _base(v: Variable) -> Free | None:
        low = -np.inf if v.min is None else v.min
        high = np.inf if v.max is None else v.max
        if v.unit == "s":
            low = max(low, 0.0)
        if high <= low:
            return None
        size = BROAD * abs(v.start) or v.nominal or (0.25 * (high - low) if high - low < 1e6 else 1.0)
        if v.tolerance:
            size = v.tolerance * abs(v.start) or v.tolerance
        elif np.isfinite(high - low):
            size = min(size, high - low)
        log = v.start > 0.0 and low >= 0.0 and size >= 0.5 * v.start
        if log:  # a loose tolerance is one of the ratio: 10 is eleven times as large or small
            ratio = float(np.log1p(v.tolerance)) if v.tolerance else BROAD
            return Free(v.name, v.start, ratio, True, max(low, 1e-9 * v.start), high)
        return Free(v.name, v.start, size, False, low, high)

    def of_effect(self, a: Attached, scales: Mapping[str, Scales]) -> list[Free]:
        """An effect's parameters as they are fitted, centred at the middle of their starts."""
        s = scales[a.port]
        return [self._own(a, q, s, scales.get(a.other or "", s)) for q in a.effect.parameters]

    def _own(self, a: Attached, q: Parameter, s: Scales, other: Scales) -> Free:
        low, high = q.bounds(s)
        if a.effect.delays and q.unit == "s":
            high = min(high, LATEST * self.duration_s)
        elif q.unit == "s" and any(n.endswith("_delay") for n in a.effect.becomes):
            # a lag that is longer than the recording is another gain
            high = min(high, self.duration_s)
        starts, scaleless = np.array(q.starts(s), float), q.unit == "s" or a.effect.clock
        if q.amplitude or np.min(starts) <= 0.0:
            size = self._unit_size(a, q.unit, s, other)
            if q.name in ("factor",):
                size = 1.0
            # a drive may hold a load that hardly moves
            if a.effect.place == "force" and kind(a.effect.name) == "load":
                size *= max(1.0, s.drive / s.f)
            return Free(a.name(q.name), 0.0, size, False, low, high, scaleless)
        center = float(np.exp(np.mean(np.log(starts))))
        size = max(0.7, 0.5 * float(np.log(starts.max() / starts.min())))
        return Free(a.name(q.name), center, size, True, max(low, 1e-9 * center), high, scaleless)

    def _unit_size(self, a: Attached, unit: str, s: Scales, other: Scales) -> float:
        """Size of an amplitude from its unit: a force of the recording's own size at its port, and so on."""
        if a.effect.clock:  # at the end of a recording as late as outputs that are late throughout
            return self.memory_s / self.duration_s
        names = {"f": s.f, "v": s.v, "q": s.q, "inertia": s.inertia, "u": s.u, "y": s.y, "demand": s.d}
        names["other"] = other.y if a.effect.place == "output" else other.u
        text = unit.format(**{n: f"({v!r})" for n, v in names.items()}).replace("^", "**")
        known = {
            "s": self.duration_s if "/s" in unit else self.memory_s,
            "rad": 0.1,
            "kg": self._of("kg"),
            "m": 1.0,
            "Pa": s.p,
        }
        known |= {"s2": self.memory_s**2}
        try:
            return abs(float(eval(text, {"__builtins__": {}}, known))) or 1.0
        except (
            NameError,
            SyntaxError,
            TypeError,
            ZeroDivisionError,
        ):  # a unit of its own kind: sized by its first start, or one
            starts = [abs(v) for q in a.effect.parameters if q.unit == unit for v in q.starts(s)]
            return max(starts, default=0.0) or 1.0

    def _of(self, unit: str) -> float:
        found = [abs(v.start) for v in self.folder.model.parameters if v.unit == unit and v.start]
        return max(found, default=1.0)


def stated(v: Variable) -> bool:
    """Whether its tolerance says more than that it is about right."""
    return v.tolerance is not None and 0.0 < v.tolerance < BROAD
