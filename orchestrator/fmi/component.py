"""One FMU of a system: unpacked, described, with the binary for this platform and its start values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fmus.paths import built_here
from orchestrator.fmi.model_description import ModelDescription
from orchestrator.fmi.terminals import Terminals
from orchestrator.fmi.variable import Value, Variable, size_of


@dataclass(frozen=True)
class TimedClock:
    """A time-based input clock that does not tick with the grid of steps.

    kind      periodic: at the start + shift_s + n · interval_s; fixed, tunable, changing, countdown: as its
              FMU tells
    fraction  its FMU tells times as fractions
    """

    kind: str
    fraction: bool = False
    shift_s: float = 0.0
    interval_s: float = 0.0


@dataclass(frozen=True)
class Component:
    """An FMU unpacked in `folder`, with the binary for this platform and its start values by variable.

    The name of a component in a nested system is its path, `outer.inner`.

    multiple  it steps once in so many steps of the system
    clocks    its periodic input clocks that tick with the grid, by name: (shift, interval) in ticks of the
              system
    timed     its other time-based input clocks, by name
    line      in the SSD; 0: there is none
    file      the SSD, as messages call it
    terminals groups of its variables that are connected together
    """

    name: str
    model: ModelDescription
    folder: Path
    library: Path
    sha256: str
    start: Mapping[str, Value]
    multiple: int = 1
    line: int = 0
    clocks: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    timed: Mapping[str, TimedClock] = field(default_factory=dict)
    file: str = ""
    terminals: Terminals = field(default_factory=Terminals)

    def __str__(self) -> str:
        """How messages call it: with file and line, where it has some."""
        where = f"{self.file or 'SSD'} line {self.line}: " if self.line else ""
        return f"{where}component {self.name}"

    def ticking(self) -> list[str]:
        """Its time-based input clocks, in the order in which those that are due at one instant tick.

        In scheduled execution by priority, else as declared.
        """
        declared = [name for name in self.model.variables if name in self.clocks or name in self.timed]
        if not self.model.scheduled:
            return declared
        return sorted(declared, key=self._priority)

    def _priority(self, name: str) -> int:
        clock = self.model.variables[name].clock
        return clock.priority if clock else 0

    def size(self, variable: Variable) -> int:
        """Number of elements of one of its variables, with the structural parameters it starts with."""
        model = self.model.structural()
        return size_of(variable, {name: int(self.start.get(name, model[name])) for name in model})  # type: ignore[arg-type]


def runs_here(component: Component, trust: bool) -> bool:
    """Whether the FMU of a component runs in this process: it was built here, or the user trusts it."""
    return trust or built_here(component.sha256)
