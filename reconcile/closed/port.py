"""Effects at the ports of a closed FMU as a discrete model of their own, from which their FMU is built.

Every tick it reads its signals, lets the effects work on them in turn and shows the result after the step.
Stepped before the FMU that it feeds (or after the one that feeds it), it adds no delay.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Literal

import casadi as ca
import numpy as np

from fmus.definition import Model, Variable
from reconcile.catalogue import ALL
from reconcile.equations.model import ALL_OUTPUTS, Attached
from specs.errors import InputError, nearest

Side = Literal["input", "output", "force"]
Entry = tuple[str, str, str | None, Mapping[str, float]]  # key of the effect, port, other signal, values
LATE = "_effects"  # what is added to the name of a signal behind its effects
BEFORE = "before_"  # and before that of its value a tick ago
CLOCK = "clock"
LONGEST_DELAY_S = 2.0


def identifier(name: str) -> str:
    """A name of an effect's as a model may have it."""
    return "".join(c if c.isalnum() else "_" for c in name)


@dataclass(frozen=True)
class Port:
    """`signals` pass through the effects of one side; a force is made of `motion` (role -> signal) instead.

    `step_s`: of a tick.  A force port has one signal, the disturbance input that the force adds to.
    """

    side: Side
    step_s: float
    signals: tuple[Variable, ...]
    effects: tuple[Attached, ...]
    values: Mapping[str, float]
    motion: Mapping[str, Variable]

    def model(self) -> Model:
        """The port as a model: inputs by the signals' names, outputs with LATE added."""
        late = [replace(v, name=v.name + LATE, vr=None) for v in self.signals]
        hidden = [Variable(identifier(a.name(h)), "") for a in self.effects for h in a.effect.hidden]
        shown = [Variable("shown_" + v.name, v.unit, start=v.start) for v in self.signals]
        told = [replace(v, vr=None) for v in dict.fromkeys((*self.signals, *self.motion.values()))]
        return Model(
            name=f"{self.side}_effects",
            description=", ".join(f"{a.effect.name} at {a.port}" for a in self.effects),
            kind="discrete",
            step=self.step_s,
            states=(*shown, *hidden, *self._before(), Variable(CLOCK, "s")),
            inputs=tuple(told),
            outputs=tuple(late),
            parameters=tuple(self._parameters()),
            rhs=self._next,
            out=lambda x, u, m, p: {v.name + LATE: getattr(x, "shown_" + v.name) for v in self.signals},
            delays=self._delays(),
            max_delay=self.step_s * round(LONGEST_DELAY_S / self.step_s),
        )

    def _before(self) -> list[Variable]:
        """Last values of outputs that an effect sees as they move over the step (inputs are held over it)."""
        seen = {n for a in self.effects if self._follows(a) for n in self.at(a)}
        return [Variable(BEFORE + v.name, v.unit, start=v.start) for v in self.signals if v.name in seen]

    def _follows(self, a: Attached) -> bool:
        """Whether an effect is a filter of a moving signal; play and limits follow its last value."""
        return self.side == "output" and bool(a.effect.hidden) and a.effect.width is None

    def _parameters(self) -> list[Variable]:
        found = []
        for a in self.effects:
            names = [q.name for q in a.effect.parameters] + (["width"] if a.effect.width else [])
            text = f"{a.effect.name} at {a.port}: {a.effect.equation}"
            found += [Variable(identifier(a.name(n)), "", text, self.values[a.name(n)]) for n in names]
        return found

    def _delays(self) -> dict[str, str]:
        return {n: identifier(a.name("delay")) for a in self.effects if a.effect.delays for n in self.at(a)}

    def at(self, a: Attached) -> list[str]:
        """The signals that an effect is at."""
        return [v.name for v in self.signals] if a.port == ALL_OUTPUTS else [a.port]

    def _next(self, x: Any, u: Any, m: Any, p: Any) -> dict[str, Any]:
        raw = {v.name: getattr(u, v.name) for v in self.signals}
        found: dict[str, Any] = {CLOCK: getattr(x, CLOCK) + self.step_s}
        found |= {v.name: raw[v.name.removeprefix(BEFORE)] for v in self._before()}
        for v in self.signals:
            value = raw[v.name]
            for a in (a for a in self.effects if not a.effect.delays and v.name in self.at(a)):
                mean = 0.5 * (value + getattr(x, BEFORE + v.name)) if self._follows(a) else value
                result = self._built(a, x, u, p, mean, raw)
                value = value + result.value if self.side == "force" else result.value
                for h in a.effect.hidden:
                    state = identifier(a.name(h))
                    stepped = (
                        result.next[h]
                        if h in result.next
                        else getattr(x, state) + self.step_s * result.rates[h]
                    )
                    found[state] = stepped
            found["shown_" + v.name] = value
        return found

    def _built(self, a: Attached, x: Any, u: Any, p: Any, value: Any, raw: Mapping[str, Any]) -> Any:
        # a force has no speed of its own to stop here: its dry friction is one with a steep flank
        step = self.step_s if self.side != "force" or a.effect.hidden else None
        own = SimpleNamespace(**{q.name: getattr(p, identifier(a.name(q.name))) for q in a.effect.parameters})
        memory = SimpleNamespace(**{h: getattr(x, identifier(a.name(h))) for h in a.effect.hidden})
        width = getattr(p, identifier(a.name("width"))) if a.effect.width else 1.0
        clock = getattr(x, CLOCK) + self.step_s
        c = SimpleNamespace(width=width, step=step, t=clock, averaged=False, slope=None, stops=False)
        if self.side == "force":
            c.v = getattr(u, self.motion["velocity"].name)
            c.q = getattr(u, self.motion["position"].name) if "position" in self.motion else None
        else:
            c.u = c.y = value
            c.other = raw[a.other] if a.other else None
            c.size = next(float(v.max or v.nominal or 1.0) for v in self.signals if v.name == self.at(a)[0])
        if a.effect.build is None:
            raise InputError(f"effect {a.key} has no equation")
        return a.effect.build(c, own, memory)


class Passing:
    """A port's model ready to pass whole signals through, for any values of its parameters."""

    def __init__(self, port: Port):
        self.port, self.model = port, port.model()
        self._steps: dict[int, ca.Function] = {}

    def through(self, u: Mapping[str, np.ndarray], values: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Signals [n] behind the effects, of `u` [n] (delayed already); memories rest at the first values."""
        n = len(next(iter(u.values())))
        if n not in self._steps:
            self._steps[n] = self.model.f.mapaccum(n)
        names = [v.name for v in self.model.inputs]
        told = np.array([np.broadcast_to(u.get(m, 0.0), n) for m in names])
        by_name = {identifier(k): v for k, v in values.items()}
        p = np.array([by_name.get(v.name, v.start) for v in self.model.parameters])
        x0 = self._rest(told[:, 0], p)
        states = np.asarray(self._steps[n](x0, told, np.zeros((0, n)), np.tile(p[:, None], n)))
        return {v.name: states[i] for i, v in enumerate(self.port.signals)}

    def _rest(self, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Hidden states where they start with the first signals, as the FMU that is built of it does not."""
        x = np.zeros(len(self.model.states))
        names = [v.name for v in self.model.states]
        told = dict(zip((v.name for v in self.model.inputs), u, strict=True))
        for v in self.port._before():
            x[names.index(v.name)] = told[v.name.removeprefix(BEFORE)]
        own = SimpleNamespace(**{v.name: p[i] for i, v in enumerate(self.model.parameters)})
        for a in self.port.effects:
            if not a.effect.hidden:
                continue
            state = SimpleNamespace(**dict.fromkeys(names, 0.0))
            signals = SimpleNamespace(**told)
            raw = {v.name: told[v.name] for v in self.port.signals}
            result = self.port._built(a, state, signals, own, raw[self.port.at(a)[0]], raw)
            for h in a.effect.hidden:
                x[names.index(identifier(a.name(h)))] = float(ca.DM(result.starts[h]))
        return x


def port_model(
    side: Side,
    step_s: float,
    signals: Sequence[tuple[str, str, float, float | None]],
    effects: Sequence[Entry],
    motion: Mapping[str, tuple[str, str]] | None = None,
) -> Model:
    """The model of a port as a model.py states it: signals as (name, unit, start, max), motion by role."""
    known = {e.key: e for e in ALL}
    for key, *_ in effects:
        if key not in known:
            raise InputError(f"no effect '{key}' in the catalogue; {nearest(key, known)}")
    attached = tuple(Attached(known[key], port, other) for key, port, other, _ in effects)
    values = {a.name(n): v for a, (*_, own) in zip(attached, effects, strict=True) for n, v in own.items()}
    return Port(
        side,
        step_s,
        tuple(Variable(n, unit, start=start, max=most) for n, unit, start, most in signals),
        attached,
        values,
        {role: Variable(n, unit) for role, (n, unit) in (motion or {}).items()},
    ).model()
