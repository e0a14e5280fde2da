"""Who commands over OPC UA or ROS 2: what a client asked for, and whether it was given the right.

Each of these interfaces has a seat: a cell `seat-NAME.cell` in the layout of Modbus's targets
(runtime/modbus/cells.py), which its process writes.  The control process alone decides (runtime/interfaces/
port.py) and says in `seats.cell` which seat, and which of its claims, has the right.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from secrets import randbits

import numpy as np

from runtime.hmi.alarms import Level
from runtime.modbus.cells import HOLDING, TARGETS
from runtime.modbus.holding import LAPSE_NS
from runtime.shared import Cell
from specs.errors import InputError, nearest

NAMES = ("opcua", "ros2")  # number of a seat: its place here, from 1 on; 0: none
GRANTED = np.dtype([("seat", "<u4"), ("owner", "<u4")])
GRANTED_FILE, HOLDS_GRANTED, HOLDS_SEAT = "seats.cell", "seats", "seat"
PLACES = {s.name: i for i, s in enumerate(HOLDING)}
BEAT, NUMBER = PLACES["planner_heartbeat"], PLACES["target_number"]
PLACE = ("target_x", "target_y", "target_z")  # a change of one of them makes a new target
HIGHEST_NUMBER = int(HOLDING[NUMBER].max or 0)
HIGHEST_BEAT = int(HOLDING[BEAT].max or 0)


def create(folder: Path, names: tuple[str, ...]) -> None:
    """Make the cells in a private folder: one for each interface, and the one of who has the right."""
    for name in names:
        Cell.create(_path(folder, name), TARGETS.itemsize, HOLDS_SEAT).close()
    create_granted(folder).close()


def create_granted(folder: Path) -> Cell:
    """Only the cell of who has the right."""
    return Cell.create(folder / GRANTED_FILE, GRANTED.itemsize, HOLDS_GRANTED)


def join(folder: Path, name: str) -> Cell:
    """The cell of a seat."""
    return Cell.open(_path(folder, name), TARGETS.itemsize, HOLDS_SEAT)


def join_granted(folder: Path) -> Cell | None:
    """The cell of who has the right; None where no interface commands."""
    path = folder / GRANTED_FILE
    return Cell.open(path, GRANTED.itemsize, HOLDS_GRANTED) if path.is_file() else None


def granted(cell: Cell) -> tuple[int, int]:
    """Which seat has the right, and which of its claims; zeros: none."""
    found = cell.read()
    state = np.frombuffer(found[1], GRANTED)[0] if found else (0, 0)
    return int(state[0]), int(state[1])


class Seat:
    """One client's claim at a time, and what it asked for; no clock, no sockets."""

    def __init__(self, name: str, cell: Cell, granted_cell: Cell, tell: Callable[[str, Level], None]) -> None:
        self._number, self._cell, self._granted = NAMES.index(name) + 1, cell, granted_cell
        self._tell = tell
        # not from 0 on: a process that was started again must not repeat a claim that is over
        self._claims, self._since, self._had = randbits(31), 0, False
        self.client: str = ""  # who has, or asks for, the right
        self.state = np.zeros((), TARGETS)
        self._published = (-1, -1, -1)
        self._asked_ns, self._told = 0, False  # when it asked; whether it was said that it waits
        self._clear()

    def _clear(self) -> None:
        for key in ("heartbeat_ns", "commits", "owner"):
            self.state[key] = 0
        self.state["value"] = [s.start for s in HOLDING]

    @property
    def has_right(self) -> bool:
        """Whether what was asked for counts."""
        return bool(self.client) and granted(self._granted) == (self._number, int(self.state["owner"]))

    def why_not(self) -> str:
        """Why what was asked for does not count."""
        return "somebody else has it" if self._granted.number else "the controller does not run yet"

    def ask(self, client: str, values: Mapping[str, float], now: int) -> str:
        """Take new targets of a client at `now` [ns], and its sign of life; "" or why they are refused."""
        if reason := invalid(values):
            return reason
        if self.client not in ("", client):
            return f"busy: {self.client} has the right to command"
        if not self.client:
            self._claim(client, now)
        held = self.state["value"]
        if any(held[PLACES[name]] != value for name, value in values.items() if name in PLACE):
            held[NUMBER] = (held[NUMBER] + 1) % (HIGHEST_NUMBER + 1)
        for name, value in values.items():
            held[PLACES[name]] = value
        self.state["commits"] += 1
        self._live(now)
        return ""

    def live(self, client: str, now: int) -> str:
        """A sign of life; "" or why it is refused."""
        if client != self.client:
            return "not the client that has the right to command"
        self._live(now)
        return ""

    def _claim(self, client: str, now: int) -> None:
        self._claims = self._claims % 0xFFFF_FFFE + 1
        self.client, self._had, self._since = client, False, now
        self._asked_ns, self._told = now, False
        self._clear()
        self.state["owner"] = self._claims

    def _live(self, now: int) -> None:
        self._since = now
        self.state["heartbeat_ns"] = now
        value = self.state["value"]
        value[BEAT] = (value[BEAT] + 1) % (HIGHEST_BEAT + 1)
        self.beat(now)

    def release(self, client: str, why: str) -> None:
        """The client's claim ends."""
        if client and client == self.client:
            self._end(why)

    def _end(self, why: str) -> None:
        client, self.client = self.client, ""
        self._clear()
        self._tell(f"{client} {why}", Level.WARNING)

    def beat(self, now: int) -> None:
        """Publish the state; end a claim that is silent, or lost the right that it had, or never got it."""
        if self.client and now - self._since >= LAPSE_NS:
            self._end(
                f"{'lost' if self._had else 'no longer asks for'} the right to command: no sign of life"
            )
        elif self.client and self._had and not self.has_right:
            self._end("lost the right to command: the controller gave it to nobody or to another")
        elif self.client and not self._had and self.has_right:
            self._had = True
            self._tell(f"{self.client} has the right to command", Level.NOTE)
        elif self.client and not self._had and not self._told and now - self._asked_ns >= LAPSE_NS:
            self._told = True
            self._tell(f"{self.client} is refused the right to command: {self.why_not()}", Level.WARNING)
        news = tuple(int(self.state[key]) for key in ("owner", "commits", "heartbeat_ns"))
        if news != self._published:  # nothing else is read: the cycle is not bothered for less
            self._published = news
            self.state["stamp_ns"] = now
            self._cell.write(self.state)


def invalid(values: Mapping[str, float]) -> str:
    """Why targets are refused: a name, or a value outside its range; "" if they are right."""
    for name, value in values.items():
        if name not in PLACES or name in ("planner_heartbeat", "target_number"):
            return f"unknown target '{name}'; {nearest(name, PLACES)}"
        if reason := HOLDING[PLACES[name]].wrong(value):
            return reason
    return ""


def _path(folder: Path, name: str) -> Path:
    if name not in NAMES:
        raise InputError(f"no seat '{name}'; {nearest(name, NAMES)}")
    return folder / f"seat-{name}.cell"
