"""The form of a model file: names, equations and everything the FMU shim needs, written once as CasADi.

A model is continuous (`rhs` returns dx/dt, integrated with a fixed linearly implicit step) or discrete
(`rhs` returns the next state, applied once per `step`).  Equations are plain functions of four namespaces:

    x  states          u  inputs (after their transport delay)
    m  modes (0 or 1)  p  parameters

and return a mapping from names to CasADi expressions.  What is not an equation is declared, and carried
out by the C shim in integer time: transport delays, modes with their timers, sampled sensors with noise.

Symbols are CasADi's SX: equations become straight-line code.  A model of large matrices (a network) chooses
MX instead: its weights become tables, its products loops.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import SimpleNamespace
from typing import Any, Literal

import casadi as ca

from fmus.constants import split
from fmus.factors import factorised
from specs import parameters as parameter_specs, signals as signal_specs
from specs.errors import InputError

Namespace = Any  # SimpleNamespace of casadi.SX (or MX) scalars
Symbolic = Any  # casadi.SX or casadi.MX, as the model chooses
SAMPLE_S = 0.02  # of sensors, where a model states none: the cycle of the project's own controllers
LINE_S = 1.0  # length of delay lines, where a model states none
LINE_SAMPLES = 50  # the same in sample times, where those are no part of LINE_S
Equations = Callable[[Namespace, Namespace, Namespace, Namespace], Mapping[str, Any]]


@dataclass(frozen=True)
class Variable:
    """A scalar variable: SI `unit`, value range, `start` value and, where known, its value reference."""

    name: str
    unit: str
    description: str = ""
    start: float = 0.0
    min: float | None = None
    max: float | None = None
    nominal: float | None = None
    vr: int | None = None
    fixed: bool = False  # parameters: not tunable after initialisation
    tolerance: float | None = None  # parameters: relative standard deviation of `start`, where it is known;
    # of positive ones from about 1 on of their ratio to it: 10 is a factor of eleven


@dataclass(frozen=True)
class Mode:
    """A switch that `on` (expression > 0) sets after `on_delay`, and `off` clears after `off_delay`.

    A guard must hold without a break for its delay (name of a parameter in s) before the mode switches.
    """

    name: str
    on: Callable[[Namespace, Namespace, Namespace, Namespace], Any]
    off: Callable[[Namespace, Namespace, Namespace, Namespace], Any]
    on_delay: str | None = None
    off_delay: str | None = None
    start: float = 0.0


@dataclass(frozen=True)
class Sensor:
    """How an output is measured: sampled and held every `Model.sample_time`; all fields name parameters.

    measured = quantise(scale-free output `delay` seconds ago + bias + noise * N(0, 1), quantum)
    """

    delay: str | None = None
    bias: str | None = None
    noise: str | None = None
    quantum: str | None = None


@dataclass(frozen=True)
class Model:
    """One model: see the module docstring.  `step` is the internal step in s (discrete: the period)."""

    name: str
    description: str
    kind: Literal["continuous", "discrete"]
    step: float
    states: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    parameters: tuple[Variable, ...]
    rhs: Equations
    out: Equations
    initial: Callable[[Namespace], Mapping[str, Any]] | None = None
    modes: tuple[Mode, ...] = ()
    delays: Mapping[str, str] = field(default_factory=dict)  # input -> parameter with its delay in s
    max_delay: float = 0.0  # s, length of every delay line; 0: LINE_S, or LINE_SAMPLES sample times
    sensors: Mapping[str, Sensor] = field(default_factory=dict)  # output -> how it is measured
    sample_time: float = 0.0  # s, of the sensors; 0: SAMPLE_S, or the step where that is no multiple of it
    symbolic: Literal["SX", "MX"] = "SX"
    serves: int = 1  # internal steps that one Jacobian serves (continuous models)

    def __post_init__(self) -> None:
        _check_names(self)
        object.__setattr__(self, "step", float(self.step))  # 4 is as good as 4.0, but not in C
        sample = self.sample_time or (SAMPLE_S if is_multiple(SAMPLE_S, self.step) else self.step)
        longest = LINE_S if is_multiple(LINE_S, sample) else LINE_SAMPLES * sample
        object.__setattr__(self, "sample_time", float(sample))
        object.__setattr__(self, "max_delay", float(self.max_delay or longest))

    @cached_property
    def symbols(self) -> tuple[Symbolic, Symbolic, Symbolic, Symbolic]:
        """Column vectors (x, u, m, p) of scalar symbols, in declaration order."""
        groups = (self.states, self.inputs, self.modes, self.parameters)
        if self.symbolic == "MX":
            names = ("x", "u", "m", "p")
            return tuple(ca.MX.sym(n, len(group)) for n, group in zip(names, groups, strict=True))  # type: ignore[return-value]
        return tuple(self._column([ca.SX.sym(v.name) for v in group]) for group in groups)  # type: ignore[return-value]

    @cached_property
    def namespaces(self) -> tuple[Namespace, Namespace, Namespace, Namespace]:
        """The same symbols by name."""
        groups = (self.states, self.inputs, self.modes, self.parameters)
        return tuple(
            SimpleNamespace(**{v.name: vector[i] for i, v in enumerate(group)})
            for group, vector in zip(groups, self.symbols, strict=True)
        )  # type: ignore[return-value]

    @cached_property
    def f(self) -> ca.Function:
        """(x, u, m, p) -> dx/dt, or the next state of a discrete model."""
        return self._function("slw_f", self._stack(self.rhs(*self.namespaces), self.states, "rhs"))

    @cached_property
    def h(self) -> ca.Function:
        """(x, u, m, p) -> outputs before sampling, delay and noise."""
        return self._function("slw_h", self._stack(self.out(*self.namespaces), self.outputs, "out"))

    @cached_property
    def jacobian(self) -> ca.Function:
        """(x, u, m, p) -> dense df/dx, column-major."""
        x, u, m, p = self.symbols
        return self._function("slw_jac", ca.densify(ca.jacobian(self.f(x, u, m, p), x)))

    @cached_property
    def inner(self) -> tuple[ca.Function, ca.Function, ca.Function, ca.Function]:
        """What an internal step of the FMU computes, with q for all that parameters alone decide.

        `slw_constants`: p -> q; `slw_f`: (x, u, m, q) -> dx/dt; `slw_factors`: (x, u, m, q) -> dx/dt and the
        factors of I - gamma h df/dx; `slw_solve`: (factors, b) -> the solution of that matrix for b.
        """
        x, u, m, p = self.symbols
        rates = self.f(x, u, m, p)
        jacobian = ca.jacobian(rates, x)
        factorise, solve = factorised(jacobian.sparsity(), self.step)
        both = ca.Function("both", [x, u, m, p], [rates, factorise(jacobian.get_nz(False, ca.Slice()))])
        if self.symbolic == "MX":
            given: list[Any] = [x, u, m, p]
            constants, results = ca.Function("slw_constants", [p], [p]), both(*given)
        else:
            constants, given, results = split(both)
        f = ca.Function("slw_f", given, [results[0]])
        return constants, f, ca.Function("slw_factors", given, list(results)), solve

    @cached_property
    def directional(self) -> ca.Function:
        """(x, u, m, p, dx, du, dp) -> (df, dh): instantaneous partials at fixed mode times the seed."""
        x, u, m, p = self.symbols
        seeds = [self._kind.sym("d" + n, v.shape) for n, v in (("x", x), ("u", u), ("p", p))]
        if self.symbolic == "MX":
            return self._directional_mx(seeds)
        point, seed = ca.vertcat(x, u, p), ca.vertcat(*seeds)
        results = [ca.densify(ca.jtimes(g(x, u, m, p), point, seed)) for g in (self.f, self.h)]
        return ca.Function("slw_dir", [x, u, m, p, *seeds], results)

    def _directional_mx(self, seeds: list[ca.MX]) -> ca.Function:
        """The same by the functions' own forward derivatives: MX differentiates by plain symbols only."""
        x, u, m, p = self.symbols
        dx, du, dp = seeds
        fixed = ca.MX(*m.shape)
        results = [g.forward(1)(x, u, m, p, g(x, u, m, p), dx, du, fixed, dp) for g in (self.f, self.h)]
        return ca.Function("slw_dir", [x, u, m, p, *seeds], [ca.densify(r) for r in results])

    @cached_property
    def x0(self) -> ca.Function:
        """p -> initial state."""
        values = {v.name: v.start for v in self.states}
        if self.initial is not None:
            values |= dict(self.initial(self.namespaces[3]))
        stacked = self._stack(values, self.states, "initial")
        return ca.Function("slw_x0", [self.symbols[3]], [ca.densify(stacked)])

    @cached_property
    def guards(self) -> ca.Function:
        """(x, u, m, p) -> (on guards, off guards), one each per mode."""
        ns = self.namespaces
        columns = [
            self._column([self._kind(getattr(mode, side)(*ns)) for mode in self.modes])
            for side in ("on", "off")
        ]
        return ca.Function("slw_guards", list(self.symbols), [ca.densify(c) for c in columns])

    def index(self, group: Literal["states", "inputs", "outputs", "parameters", "modes"], name: str) -> int:
        """Position of `name` in a group."""
        names = [v.name for v in getattr(self, group)]
        if name not in names:
            raise InputError(f"model {self.name}: no {group[:-1]} '{name}'; valid: {', '.join(names)}")
        return names.index(name)

    def start_parameters(self, overrides: Mapping[str, float] | None = None) -> ca.DM:
        """Parameter vector of start values with `overrides` by name."""
        values = {v.name: v.start for v in self.parameters}
        for name, value in (overrides or {}).items():
            self.index("parameters", name)
            values[name] = value
        return ca.DM(list(values.values()))

    @property
    def _kind(self) -> Any:
        return ca.MX if self.symbolic == "MX" else ca.SX

    def _column(self, scalars: list[Symbolic]) -> Symbolic:
        return ca.vertcat(*scalars) if scalars else self._kind(0, 1)

    def _function(self, name: str, result: Symbolic) -> ca.Function:
        return ca.Function(name, list(self.symbols), [ca.densify(result)], ["x", "u", "m", "p"], ["r"])

    def _stack(self, values: Mapping[str, Any], group: Iterable[Variable], what: str) -> Symbolic:
        names, where = [v.name for v in group], f"model {self.name}: {what}"
        if not isinstance(values, Mapping):
            kind = type(values).__name__
            raise InputError(f"{where} returns a {kind}, not {{name: expression}} of {', '.join(names)}")
        wrong = [f"{n} is missing" for n in names if n not in values]
        wrong += [f"{n} is none of them" for n in values if n not in names]
        if wrong:
            raise InputError(
                f"{where} returns the wrong names: {', '.join(wrong)}; valid: {', '.join(names)}"
            )
        return self._column([self._scalar(values[n], f"{where}: {n}") for n in names])

    def _scalar(self, value: Any, where: str) -> Symbolic:
        """An expression of one value; InputError for anything else, at which CasADi may crash later."""
        try:
            found = self._kind(value)
        except NotImplementedError:
            raise InputError(f"{where} is a {type(value).__name__}, not a number or expression") from None
        if found.numel() != 1:
            raise InputError(f"{where} has {found.numel()} values, not one")
        return found


def from_signals(*names: str) -> tuple[Variable, ...]:
    """Inputs or outputs as `specs/signals.toml` defines them."""
    found = (signal_specs.signal(n) for n in names)
    return tuple(
        Variable(s.name, s.unit, s.description, s.start, s.min, s.max, s.nominal, s.vr) for s in found
    )


def from_parameters(*files: str) -> tuple[Variable, ...]:
    """Parameters of one or more `specs/parameters/*.toml` files, in file order; `start_*` are not tunable."""
    found = parameter_specs.load(*files).values()
    return tuple(
        Variable(
            s.name, s.unit, s.description, s.value, s.min, s.max, s.nominal, s.vr, s.name.startswith("start_")
        )
        for s in found
    )


def _check_names(model: Model) -> None:
    """Every name once; everything declared about an input, output or parameter names an existing one."""
    groups = (model.states, model.inputs, model.outputs, model.parameters, model.modes)
    names = [v.name for group in groups for v in group]
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise InputError(f"model {model.name}: names used twice: {', '.join(twice)}")
    for name in model.delays:
        model.index("inputs", name)
    for name in model.sensors:
        model.index("outputs", name)
    used = [*model.delays.values()]
    used += [n for s in model.sensors.values() for n in (s.delay, s.bias, s.noise, s.quantum) if n]
    used += [n for mode in model.modes for n in (mode.on_delay, mode.off_delay) if n]
    for name in used:
        model.index("parameters", name)


def is_multiple(duration: float, step: float) -> bool:
    """Whether a time is a whole number of steps, one or more, but for rounding."""
    count = round(duration / step)
    return count >= 1 and abs(count * step - duration) <= 1e-9 * duration
