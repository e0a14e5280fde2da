"""What the Modbus server tells people: who writes, who is connected, and what happened to the right to write.

Each event is a line on the console (stderr of the process) and an entry of `told.cell`, from which the HMI
has its alarms, its audit log and what it shows.  A peer that is refused again and again, or comes
back on a new connection for each write, is told of once a minute.
"""

import json
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from runtime.modbus.holding import Event
from runtime.shared import Cell
from specs.errors import InputError

TOLD_FILE, HOLDS_TOLD, TOLD_BYTES = "told.cell", "told", 65_536
EVENTS, CLIENTS, NAME = 24, 64, 80  # so many at most, and letters of a name
SELDOM_S = 60.0  # between two events of one address that may come OFTEN
OFTEN = (Event.REFUSED, Event.BACK)


def open_told(folder: Path) -> Cell:
    """The cell, made where there is none yet: the server may have been started again."""
    path = folder / TOLD_FILE
    try:
        return Cell.open(path, TOLD_BYTES, HOLDS_TOLD)
    except InputError:
        path.unlink(missing_ok=True)
        return Cell.create(path, TOLD_BYTES, HOLDS_TOLD)


def read_told(cell: Cell) -> dict[str, Any]:
    """What was told last."""
    found = cell.read()
    return json.loads(found[1].rstrip(b"\0")) if found else {}


class Teller:
    """Collects events and the state; `say` gets each event as a line."""

    def __init__(self, cell: Cell | None, say: Callable[[str], None] = lambda line: None) -> None:
        self._cell, self._say = cell, say
        self._events: deque[dict[str, Any]] = deque(maxlen=EVENTS)
        self._seldom: dict[tuple[Event, str], tuple[float, int]] = {}
        self._last = b""

    def event(self, event: Event, who: str, why: str = "") -> None:
        """Something happened to `who`, an address and, over TLS, a name."""
        count = 1
        if event in OFTEN:
            count = self._count(event, who)
            if not count:
                return
        what = str(event) + (f" ({why})" if why else "") + (f", {count} times" if count > 1 else "")
        number = max(time.monotonic_ns(), self._events[-1]["number"] + 1 if self._events else 0)
        told = {"number": number, "kind": event.name, "who": who[:NAME], "what": what}
        self._events.append(told)
        self._say(f"Modbus: {who[:NAME]} {what}")

    def _count(self, event: Event, who: str) -> int:
        """How many times of an address are to be told of now; 0: none yet."""
        where, now = (event, who.rpartition(":")[0]), time.monotonic()
        told, count = self._seldom.get(where, (-SELDOM_S, 0))
        if now - told < SELDOM_S:
            self._seldom[where] = told, count + 1
            return 0
        if len(self._seldom) > CLIENTS:
            self._seldom.clear()
        self._seldom[where] = now, 0
        return count + 1

    def state(self, writer: str, clients: Iterable[str], places: int, **more: int) -> None:
        """Who writes, and who is connected."""
        shown = [c[:NAME] for c in clients][:CLIENTS]
        told = {"writer": writer[:NAME], "clients": shown, "places": places, **more}
        data = json.dumps({**told, "events": list(self._events)}, ensure_ascii=False).encode()
        if self._cell is not None and data != self._last and len(data) <= TOLD_BYTES:
            self._last = data
            self._cell.write(data.ljust(TOLD_BYTES, b"\0"))


def to_console(line: str) -> None:
    """A line of the process, whatever somebody's name may hold."""
    shown = "".join(c if c.isprintable() else "?" for c in line)
    sys.stderr.write(f"slewright: {shown}\n")
    sys.stderr.flush()
