"""What an interface tells people: who was refused, who lost or has the right to command, what is lost.

Each event is a line on the console and an entry of `told-NAME.cell`, from which the HMI has its alarms and
its audit log.  The same is said once a minute, and no more than LINES in a minute: who tries again and again
must not fill a disk.
"""

import json
import time
from collections import deque
from pathlib import Path
from typing import Any

from runtime.hmi.alarms import Level
from runtime.modbus.told import to_console
from runtime.shared import Cell
from specs.errors import InputError

LABELS = {"canopen": "CANopen", "foxglove": "Foxglove", "opcua": "OPC UA", "ros2": "ROS 2"}
HOLDS, BYTES = "interface events", 16_384
KEPT, LENGTH = 24, 200  # events in the cell; letters of one
MINUTE_S, LINES = 60.0, 30


def path_of(folder: Path, name: str) -> Path:
    """The file of an interface's cell."""
    return folder / f"told-{name}.cell"


class Teller:
    """The writing side, in an interface's process."""

    def __init__(self, folder: Path, name: str) -> None:
        self._label, self._cell = LABELS[name], _made(path_of(folder, name))
        self._events: deque[dict[str, Any]] = deque(maxlen=KEPT)
        self._said: dict[str, float] = {}

    def tell(self, text: str, level: Level) -> bool:
        """Say it, unless it was said in the last minute; whether it was."""
        now = time.monotonic()
        self._said = {said: at for said, at in self._said.items() if now - at < MINUTE_S}
        text = _plain(text)
        if text in self._said or len(self._said) >= LINES:
            return False
        self._said[text] = now
        self._say(text, {"level": level.value})
        return True

    def acknowledge(self, key: str, who: str, text: str) -> None:
        """Say that somebody with the right to do so acknowledged the alarm `key`; always said."""
        more = {"level": Level.NOTE.value, "acknowledged": key, "who": _plain(who)}
        self._say(_plain(text), more)

    def _say(self, text: str, more: dict[str, Any]) -> None:
        number = max(time.monotonic_ns(), self._events[-1]["number"] + 1 if self._events else 0)
        self._events.append({"number": number, "what": text, **more})
        self._cell.write(json.dumps(list(self._events), ensure_ascii=False).encode().ljust(BYTES))
        to_console(f"{self._label}: {text}")


class Listener:
    """The reading side, in the HMI's process: joins the cell once it is there; every event is told once."""

    def __init__(self, folder: Path, name: str) -> None:
        self.label, self._path = LABELS[name], path_of(folder, name)
        self._cell: Cell | None = None
        self._number = self._newest = 0

    def new(self) -> list[dict[str, Any]]:
        """Events since the last call."""
        if self._cell is None:
            self._cell = self._join()
        if self._cell is None or self._cell.number == self._number or not (found := self._cell.read()):
            return []
        self._number, told = found[0], json.loads(found[1])
        fresh = [event for event in told if event["number"] > self._newest]
        self._newest = max((event["number"] for event in told), default=0)
        return fresh

    def _join(self) -> Cell | None:
        if not self._path.exists():
            return None
        try:
            return Cell.open(self._path, BYTES, HOLDS)
        except InputError:  # being made
            return None


def _plain(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)[:LENGTH]


def _made(path: Path) -> Cell:
    """The cell, made where there is none yet: the process may have been started again."""
    try:
        return Cell.open(path, BYTES, HOLDS)
    except InputError:
        path.unlink(missing_ok=True)
        return Cell.create(path, BYTES, HOLDS)
