"""What drives the system inputs: values that change at whole ticks and hold in between."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from orchestrator.fmi.variable import BLOBS, BOOLEANS, RANGES, Scalar, Value
from orchestrator.system.system import System, SystemInput
from specs.errors import InputError, nearest
from specs.signals import signals


@dataclass(frozen=True)
class Stimuli:
    """`changes`: tick -> {system input: value in the unit of its connector}, held until the next change.

    The value of an array is a tuple.
    """

    changes: Mapping[int, Mapping[str, Value]] = field(default_factory=dict)

    @classmethod
    def constant(cls, **values: Value) -> "Stimuli":
        """The same values from the first tick on."""
        return cls({0: values})

    def check(self, system: System) -> None:
        """InputError for a tick that is none, an unknown input, or a value that is not finite."""
        for tick, values in self.changes.items():
            if not isinstance(tick, int) or tick < 0:
                raise InputError(f"stimuli change at whole ticks from 0 on, not at {tick!r}")
            for name, value in values.items():
                if name not in system.inputs:
                    raise InputError(
                        f"system {system.name} has no input '{name}'{explain(name, system.inputs)}"
                    )
                _check_value(system.inputs[name], value, tick)


def _check_value(given: SystemInput, value: Value, tick: int) -> None:
    """InputError for what the input cannot hold."""
    numbers = value if isinstance(value, tuple) else (value,)
    if len(numbers) != given.size:
        raise InputError(f"input {given.name} has {given.size} elements, not {len(numbers)} (tick {tick})")
    if given.type in BLOBS:
        raise InputError(f"input {given.name} is of type {given.type}; only numbers can be set (tick {tick})")
    for number in numbers:
        _check_number(given, number, f"input {given.name} is {number} at tick {tick}")


def _check_number(given: SystemInput, number: Scalar, shown: str) -> None:
    if isinstance(number, str | bytes) or not math.isfinite(number):
        raise InputError(f"{shown}; it must be finite")
    if given.type not in RANGES and given.type not in BOOLEANS:
        return
    least, most = RANGES.get(given.type, (0, 1))
    if not (number == int(number) and least <= number <= most):
        raise InputError(f"{shown}; valid: whole numbers of {least} … {most} ({given.type})")


def explain(name: str, choices: Mapping[str, object]) -> str:
    """The end of a message on an unusable signal name: is it a signal at all, and what was meant?"""
    known = signals()
    if name in known:
        return f": it is a signal, but not here; {nearest(name, choices)}"
    near = nearest(name, {**known, **choices})
    if not near.startswith("did you mean"):  # a list of signals that the system lacks would mislead
        near = nearest(name, choices)
    return f", nor is it a signal of specs/signals.toml; {near}"
