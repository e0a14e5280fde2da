"""What the Modbus server tells (runtime/modbus/told.py), for people: alarms, audit log, who is there."""

from pathlib import Path
from typing import Any

from runtime.hmi.alarms import Condition, Level
from runtime.hmi.audit import Audit
from runtime.modbus.holding import Event
from runtime.modbus.told import HOLDS_TOLD, TOLD_BYTES, TOLD_FILE, read_told
from runtime.shared import Cell
from specs.errors import InputError

SHOWN_NS = 3_000_000_000  # for which an event is a present alarm; it stays in the list until acknowledged
JOIN_NS = 1_000_000_000  # between two tries to join
ALARMS = {
    Event.LAPSED: Level.WARNING,
    Event.LEFT: Level.WARNING,
    Event.TAKEN: Level.WARNING,
    Event.HMI: Level.WARNING,
    Event.REFUSED: Level.NOTE,
}


class Planners:
    """Reads the cell in `folder`, if there is a Modbus server; every event is seen once."""

    def __init__(self, folder: Path, audit: Audit) -> None:
        self._path, self._audit = folder / TOLD_FILE, audit
        self._cell: Cell | None = None
        self._tried = self._cell_number = self._newest = 0
        self._present: dict[str, tuple[int, Condition]] = {}
        self.last = ""  # what ended the last writer's right
        self.state: dict[str, Any] = {}

    def look(self, now: int) -> bool:
        """Take what is new at `now` [ns]; whether something is."""
        self._present = {k: (end, c) for k, (end, c) in self._present.items() if now < end}
        if self._cell is None:
            self._join(now)
        if self._cell is None or self._cell.number == self._cell_number:
            return False
        self._cell_number = self._cell.number
        self.state = read_told(self._cell)
        for told in self.state.get("events", []):
            if told["number"] > self._newest:
                self._newest = told["number"]
                self._take(Event[told["kind"]], told, now)
        return True

    def conditions(self) -> list[Condition]:
        """Alarms of the last few events."""
        return [condition for _, condition in self._present.values()]

    def _join(self, now: int) -> None:
        if now - self._tried < JOIN_NS or not self._path.exists():
            return
        self._tried = now
        try:
            self._cell = Cell.open(self._path, TOLD_BYTES, HOLDS_TOLD)
        except InputError:  # being made
            return

    def _take(self, event: Event, told: dict[str, Any], now: int) -> None:
        said = f"{told['who']} {told['what']}"
        if event in ALARMS:
            condition = Condition(f"modbus:{event.name}", ALARMS[event], "Modbus: " + _short(event), said)
            self._present[condition.key] = (now + SHOWN_NS, condition)
        if event in (Event.LAPSED, Event.LEFT, Event.HMI, Event.TAKEN, Event.GIVEN_BACK):
            self.last = said
        try:
            self._audit.write(told["who"], "Modbus", told["who"], told["what"], result="told")
        except OSError:
            return  # the log says so itself


def _short(event: Event) -> str:
    return {
        Event.REFUSED: "writes are refused",
        Event.TAKEN: "the right to write was taken over",
    }.get(event, "the writer lost its right")
