"""The reference machine as a plant to be driven from outside, tick by tick: commands in, sensors out."""

from collections.abc import Mapping
from functools import cache
from types import TracebackType
from typing import Protocol, Self

import numpy as np

from orchestrator.run.master import Master, Options
from orchestrator.run.simulate import seeds
from orchestrator.system.assembly import assemble
from orchestrator.system.layout import lay_out
from orchestrator.system.system import System
from specs import draws, systems
from specs.scenario import TICK_S
from specs.signals import signal

COMPONENT = "machine"
COMMANDS: tuple[str, ...] = ("u_slew", "u_boom", "u_stick")


class Placed(Protocol):
    """How a run begins: a `Scenario`, or anything else that says pose and load."""

    def parameters(self, seed: int) -> Mapping[str, float]:
        """Parameters of the machine by name, SI."""
        ...


class Machine:
    """One run of the simulated reference machine; a context, which frees it.

    After `start` and after every `advance`, `outputs` are those of the present tick.
    """

    def __init__(self, scenario: Placed, seed: int = 1, which: str = draws.NOMINAL) -> None:
        """Stand where `scenario` starts, with its load; `seed` is of noise and load, `which` names a draw."""
        self.system = plant()
        parameters = {**draws.named(which), **scenario.parameters(seed)}
        start = self.system.start_values(
            {**seeds(self.system, seed), **{f"{COMPONENT}.{name}": v for name, v in parameters.items()}}
        )
        layout = lay_out(self.system, None)
        self.names = tuple(signal_names())
        self._master = Master(self.system, layout, start, Options())
        slots = layout.blocks[0].outputs
        self._cells = np.array([slots[name].first for name in self.names])
        self._rows = 0
        self._master.plan.log(64)
        self._master.initialise()

    @property
    def tick(self) -> int:
        """Ticks of TICK_S since the start."""
        return self._master.tick

    @property
    def values(self) -> np.ndarray:
        """Every output in the order of `names`, a copy."""
        return self._master.plan.reals[self._cells]

    def outputs(self) -> dict[str, float]:
        """The same by name."""
        return dict(zip(self.names, self.values.tolist(), strict=True))

    def advance(self, commands: Mapping[str, float]) -> None:
        """One tick with these commands held; RunError when the model fails."""
        for name in COMMANDS:
            self._master.set_input(name, float(commands[name]))
        self._master.run(self._master.tick + 1)
        self._master.take(1, 64, 0)  # the ring is not what this records from

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._master.log_finish()
        self._master.free()


def signal_names() -> list[str]:
    """Outputs of the machine, sensors first, as the reference system has them."""
    found = systems.load("reference")
    return [
        c.target.name for c in found.connections if not c.target.component and c.source.component == COMPONENT
    ]


@cache
def plant() -> System:
    """The machine alone, its valves driven from outside; its FMU is built where that is needed."""
    data = {
        "description": "Reference machine, its valves driven from outside",
        "step_s": TICK_S,
        "stop_s": 60.0,
        "components": {COMPONENT: {"fmu": COMPONENT, "inputs": {systems.SYSTEM: list(COMMANDS)}}},
        "outputs": {COMPONENT: signal_names()},
    }
    return assemble(systems.parse("plant", data))


def within_field(name: str, value: float) -> float:
    """What a sensor's message carries of a value: fields end where the signal's range does."""
    s = signal(name)
    low, high = -np.inf if s.min is None else s.min, np.inf if s.max is None else s.max
    return min(max(value, low), high)
