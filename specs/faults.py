"""Faults on a connection, an output or a whole FMU: what a scenario or a system description asks for.

In a scenario file (docs/reference/scenarios.md) a fault is an entry of `[[faults]]`, in a system
description an element <slw:Fault .../> whose attributes have the same names:

    [[faults]]
    target = "pi.q_slew"   # what arrives at an input; or a connector of the system; fail: a component
    kind = "bias"
    start_s = 10.0
    end_s = 20.0           # left out: to the end of the run
    value = 0.05
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from specs.errors import InputError, nearest
from specs.schema import STRICT, validate

FAIL = "fail"
FOR_EVER = 2**63 - 1  # tick: no end
SLACK = 1e-6  # of a step, so that 0.1 s is a multiple of 0.02 s


@dataclass(frozen=True)
class Kind:
    """What a kind of fault does, the keys it needs and those it may have."""

    does: str
    needs: tuple[str, ...] = ()
    may_have: tuple[str, ...] = ()


# In the order of slw_fault_kind in orchestrator/core/core.h; `fail` is not among them.
KINDS: dict[str, Kind] = {
    "stuck": Kind("keeps the value it had at start_s, or `value`", (), ("value",)),
    "bias": Kind("adds `value`", ("value",)),
    "drift": Kind("adds rate_per_s times the time since start_s", ("rate_per_s",)),
    "noise": Kind("adds a normal random number of standard deviation `std` at each tick", ("std",)),
    "delay": Kind("gives what it was delay_s before", ("delay_s",)),
    "dropout": Kind(
        "loses ticks: the last value that was not lost stays. `probability`: that a tick is lost; with "
        "mean_ticks: that a loss begins, and then it lasts so many ticks on average",
        ("probability",),
        ("mean_ticks",),
    ),
    "spike": Kind("adds or subtracts `size` at a tick with `probability`", ("probability", "size")),
    "quantise": Kind("rounds to the nearest multiple of `step`, halves to the even one", ("step",)),
    "scale": Kind("multiplies by `factor`", ("factor",)),
    "saturate": Kind("keeps within `low` … `high`", ("low", "high")),
    FAIL: Kind("the component `target` reports an error in its step from start_s on"),
}
_ALWAYS = ("target", "kind", "start_s", "end_s")


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One fault; of the keys after end_s each kind has its own (KINDS).

    target       "component.input": on what arrives there; or a system input or output; fail: a component
    kind         one of KINDS
    start_s      first time at which it acts [s]
    end_s        from this time on it acts no more [s]; None: it lasts to the end of the run
    value, std, size, step, low, high   in the unit of the target
    rate_per_s   in the unit of the target, per second
    delay_s      [s], a whole number of steps
    probability  per tick, above 0 and at most 1
    mean_ticks   mean length of a loss in ticks, at least 1
    factor       without unit
    """

    __pydantic_config__: ClassVar[Any] = STRICT

    target: str
    kind: str
    start_s: float = 0.0
    end_s: float | None = None
    value: float | None = None
    rate_per_s: float | None = None
    std: float | None = None
    delay_s: float | None = None
    probability: float | None = None
    mean_ticks: float | None = None
    size: float | None = None
    step: float | None = None
    factor: float | None = None
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        if not self.target.strip():
            raise InputError("target: empty; a component's input as component.input, or a system's connector")
        if self.kind not in KINDS:
            raise InputError(f"kind: no fault '{self.kind}'; valid: {', '.join(KINDS)}")
        self._check_keys()
        self._check_times()
        self._check_values()

    def _check_keys(self) -> None:
        kind = KINDS[self.kind]
        own = kind.needs + kind.may_have
        for key in kind.needs:
            if getattr(self, key) is None:
                raise InputError(f"{self.kind}: missing {key}")
        for key in self.as_dict():
            if key not in _ALWAYS + own:
                raise InputError(f"{key}: not of a fault '{self.kind}'; valid: {', '.join(_ALWAYS + own)}")

    def _check_times(self) -> None:
        if self.start_s < 0.0:
            raise InputError(f"start_s = {self.start_s:g}: must not be negative")
        if self.end_s is not None and self.kind == FAIL:
            raise InputError("end_s: a component that failed does not recover")
        if self.end_s is not None and self.end_s <= self.start_s:
            raise InputError(f"end_s = {self.end_s:g}: must be after start_s = {self.start_s:g}")

    def _check_values(self) -> None:
        for key in ("std", "delay_s", "size", "step"):
            if (value := getattr(self, key)) is not None and value <= 0.0:
                raise InputError(f"{key} = {value:g}: must be above 0")
        if self.probability is not None and not 0.0 < self.probability <= 1.0:
            raise InputError(f"probability = {self.probability:g}: must be above 0 and at most 1")
        if self.mean_ticks is not None and self.mean_ticks < 1.0:
            raise InputError(f"mean_ticks = {self.mean_ticks:g}: must be at least 1")
        if self.low is not None and self.high is not None and self.low > self.high:
            raise InputError(f"low = {self.low:g}: must not be above high = {self.high:g}")

    def as_dict(self) -> dict[str, Any]:
        """The keys that are given: what a record's metadata lists, and what `validate` takes back."""
        given = ((f.name, getattr(self, f.name)) for f in fields(self))
        return {name: value for name, value in given if value is not None}

    def ticks(self, step_s: float) -> tuple[int, int]:
        """First tick, and the first one after the fault (FOR_EVER: none); InputError if not whole."""
        end = FOR_EVER if self.end_s is None else whole_ticks("end_s", self.end_s, step_s)
        if self.delay_s is not None:
            whole_ticks("delay_s", self.delay_s, step_s)
        return whole_ticks("start_s", self.start_s, step_s), end

    def values(self) -> tuple[float, float]:
        """The two numbers a and b that the core knows a fault of this kind by (orchestrator/core/core.h)."""
        if self.kind == "stuck":
            return (0.0, 0.0) if self.value is None else (self.value, 1.0)
        kind = KINDS[self.kind]
        given = [getattr(self, key) or 0.0 for key in kind.needs + kind.may_have]
        a, b = [*given, 0.0, 0.0][:2]
        return a, b

    def __str__(self) -> str:
        """The fault in words, e.g. `bias on pi.q_slew, 10 s to 20 s: value 0.05`."""
        until = "to the end" if self.end_s is None else f"to {self.end_s:g} s"
        when = f"at {self.start_s:g} s" if self.kind == FAIL else f"{self.start_s:g} s {until}"
        own = ", ".join(f"{k} {v:g}" for k, v in self.as_dict().items() if k not in _ALWAYS)
        on = "of" if self.kind == FAIL else "on"
        return f"{self.kind} {on} {self.target}, {when}" + (f": {own}" if own else "")


@dataclass(frozen=True, kw_only=True)
class Change:
    """A parameter that changes in a run: `parameter` ("component.parameter") = `value` from at_s [s] on."""

    __pydantic_config__: ClassVar[Any] = STRICT

    parameter: str
    at_s: float
    value: float | bool | str

    def __post_init__(self) -> None:
        owner, dot, name = self.parameter.partition(".")
        if not (owner and dot and name):
            raise InputError(f"parameter: '{self.parameter}' is not of the form component.parameter")
        if self.at_s < 0.0:
            raise InputError(f"at_s = {self.at_s:g}: must not be negative")

    def ticks(self, step_s: float) -> int:
        """The tick from which on it holds; InputError if that is not whole."""
        return whole_ticks("at_s", self.at_s, step_s)


def read_faults(entries: Any, where: str) -> tuple[Fault, ...]:
    """The faults of a list of tables; `where` ("file: faults") starts every message."""
    return tuple(validate(Fault, e, f"{where}.{i}") for i, e in enumerate(_tables(entries, where), 1))


def read_changes(entries: Any, where: str) -> tuple[Change, ...]:
    """The parameter changes of a list of tables; `where` ("file: changes") starts every message."""
    return tuple(validate(Change, e, f"{where}.{i}") for i, e in enumerate(_tables(entries, where), 1))


def from_attributes(attributes: Mapping[str, str], where: str = "slw:Fault") -> Fault:
    """The fault of an XML element; `where` (file, line and element) starts every message."""
    unknown = sorted(set(attributes) - {f.name for f in fields(Fault)})
    if unknown:
        raise InputError(
            f"{where}: no attribute '{unknown[0]}'; {nearest(unknown[0], [f.name for f in fields(Fault)])}"
        )
    return validate(Fault, dict(attributes), where, texts=True)


def by_tick(changes: Sequence[Change], step_s: float) -> dict[int, dict[str, float | bool | str]]:
    """Changes as `simulate` takes them: tick -> {"component.parameter": value}; InputError if not whole."""
    found: dict[int, dict[str, float | bool | str]] = {}
    for change in sorted(changes, key=lambda c: c.at_s):
        found.setdefault(change.ticks(step_s), {})[change.parameter] = change.value
    return found


def seed_of(fault: Fault, run_seed: int | None, number: int) -> int:
    """Seed (64 bits) of fault `number` of a run: another run seed, target or number gives another noise."""
    key = f"fault/{run_seed or 0}/{fault.target}/{fault.kind}/{number}"
    return int.from_bytes(hashlib.sha256(key.encode()).digest()[:8], "big")


def whole_ticks(key: str, time_s: float, step_s: float) -> int:
    """`time_s` in steps; InputError naming `key` if that is not a whole number."""
    ticks = round(time_s / step_s)
    if abs(time_s / step_s - ticks) > SLACK:
        raise InputError(f"{key} = {time_s:g}: not a multiple of the step, {step_s:g} s")
    return ticks


def _tables(entries: Any, where: str) -> list[Any]:
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        name = where.rpartition(" ")[2]
        raise InputError(f"{where}: must be a list of tables, each headed [[{name}]]")
    return entries
