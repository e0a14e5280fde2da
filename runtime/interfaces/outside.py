"""A policy outside: what it asks for, from the interface's process to the control process.

The interface (runtime/ros2/policy.py) writes the cell; the control process judges the age by a clock of its
own, at each tick.  In the input image the commands are signals like all others, so the core's rules for lost
inputs hold, and a recording repeats bit for bit.  Layout and port.
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from runtime.image import INPUT, TICK_S, Group, Status, group, timeout_ticks
from runtime.shared import Cell

PERIOD_NS = round(1e9 * TICK_S)
COMMANDS = tuple(s for s in INPUT.signals if group(s) is Group.POLICY)
PREFIX = "policy_"  # of their names, before that of the output which they are to become
PLACES = slice(INPUT.index[COMMANDS[0].name], INPUT.index[COMMANDS[-1].name] + 1)  # side by side
HEARTBEAT = next(s for s in COMMANDS if s.name == f"{PREFIX}heartbeat")
LATE = timeout_ticks(HEARTBEAT)
LIMIT_NS = LATE * PERIOD_NS  # the age from which on commands are lost
COMMAND = np.dtype(
    [
        ("made_ns", "<i8"),  # when the policy made them, on the monotonic clock
        ("owner", "<i8"),  # another number for each that gets the right; 0: nobody has it
        ("value", "<f8", (len(COMMANDS),)),  # SI, in the order of COMMANDS
    ]
)
FILE, HOLDS = "outside.cell", "policy outside"
OK, NEVER, TIMEOUT = int(Status.OK), int(Status.NEVER), int(Status.TIMEOUT)


def create(folder: Path) -> Cell:
    """Make the cell in a private folder."""
    return Cell.create(folder / FILE, COMMAND.itemsize, HOLDS)


def join(folder: Path) -> Cell:
    """Join it; raises InputError if it is of another version."""
    return Cell.open(folder / FILE, COMMAND.itemsize, HOLDS)


class OutsidePort:
    """Brings in what the policy outside asks for, as old as it is."""

    def __init__(self, commands: Cell, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.commands, self._clock = commands, clock
        self._start = np.array([s.start for s in COMMANDS])
        self._number, self._owner, self._made, self._values = -1, 0, 0, self._start

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Put the commands into the image."""
        handed_over = self.commands.number != self._number and self._take()
        age = max(0, self._clock() - self._made) // PERIOD_NS
        if self._owner and not handed_over:
            self._fill(inputs, self._values, age, TIMEOUT if age >= LATE else OK)
        else:
            self._fill(inputs, self._start, -1, NEVER)

    def _take(self) -> bool:
        """The newest state; whether another one's commands are there: for one tick they do not count."""
        if not (found := self.commands.read()):
            return False
        before, newest = self._owner, np.frombuffer(found[1], COMMAND)[0]
        self._number, self._values = found[0], newest["value"]
        self._made, self._owner = int(newest["made_ns"]), int(newest["owner"])
        return bool(before) and before != self._owner

    @staticmethod
    def _fill(inputs: np.ndarray, values: np.ndarray, age: int, status: int) -> None:
        inputs["value"][PLACES], inputs["age"][PLACES], inputs["status"][PLACES] = values, age, status

    def follow(self, other: "OutsidePort") -> None:
        """Know what another one knows."""
        self._number, self._owner = other._number, other._owner
        self._made, self._values = other._made, other._values

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Nothing goes out this way."""

    def flags(self) -> int:
        """None: the core finds that commands are lost."""
        return 0

    def received_ns(self) -> int:
        """No sensor comes this way."""
        return 0
