"""What the interfaces tell (runtime/interfaces/told.py), for people: alarms and the audit log."""

from pathlib import Path
from typing import Any

from runtime.hmi.alarms import Condition, Level
from runtime.hmi.audit import Audit
from runtime.interfaces.told import LABELS, Listener

SHOWN_NS = 3_000_000_000  # for which an event is a present alarm; it stays in the list until acknowledged
ABOUT = {LABELS["canopen"]: "a device is missing, refused or in trouble"}
JOIN_NS = 200_000_000  # between two looks


class Outsiders:
    """Reads the cells of all interfaces in `folder`."""

    def __init__(self, folder: Path, audit: Audit) -> None:
        self._listeners = [Listener(folder, name) for name in LABELS]
        self._audit, self._looked = audit, 0
        self._present: dict[str, tuple[int, Condition]] = {}
        self.acknowledged: list[tuple[str, str]] = []  # alarms by key, and by whom; taken by `Watch`

    def look(self, now: int) -> None:
        """Take what is new at `now` [ns]."""
        self._present = {k: (end, c) for k, (end, c) in self._present.items() if now < end}
        if now - self._looked < JOIN_NS:
            return
        self._looked = now
        for listener in self._listeners:
            for event in listener.new():
                self._take(listener.label, event, now)

    def conditions(self) -> list[Condition]:
        """Alarms of the last few events."""
        return [condition for _, condition in self._present.values()]

    def _take(self, label: str, event: dict[str, Any], now: int) -> None:
        if key := event.get("acknowledged"):
            self.acknowledged.append((key, f"{event['who']} ({label})"))
        level = Level(event["level"])
        if level != Level.NOTE:
            text = f"{label}: {ABOUT.get(label, 'somebody was refused or lost the right to command')}"
            condition = Condition(f"interface:{label}", level, text, event["what"])
            self._present[condition.key] = (now + SHOWN_NS, condition)
        try:
            self._audit.write(label, "interface", "this computer", event["what"], result="told")
        except OSError:
            return  # the log says so itself
