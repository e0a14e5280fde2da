"""What drives the system inputs: values that change at whole ticks and hold in between."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from orchestrator.system.system import System
from specs.errors import InputError, nearest
from specs.signals import signals


@dataclass(frozen=True)
class Stimuli:
    """`changes`: tick -> {system input: value in the unit of its connector}, held until the next change."""

    changes: Mapping[int, Mapping[str, float]] = field(default_factory=dict)

    @classmethod
    def constant(cls, **values: float) -> "Stimuli":
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
                if not math.isfinite(value):
                    raise InputError(f"input {name} is {value} at tick {tick}; it must be finite")


def explain(name: str, choices: Mapping[str, object]) -> str:
    """The end of a message on an unusable signal name: is it a signal at all, and what was meant?"""
    known = signals()
    if name in known:
        return f": it is a signal, but not here; {nearest(name, choices)}"
    return f", nor is it a signal of specs/signals.toml; {nearest(name, {**known, **choices})}"
