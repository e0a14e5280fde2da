"""The newest of everything that is pushed to pages: made once, sent to all, skipped by who is slow."""

import json
import threading
from typing import Any


class Hub:
    """Newest text of each kind of event; writers never wait for readers, and nothing piles up."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._events: dict[str, tuple[int, bytes]] = {}
        self._count = 0
        self.closed = False

    def put(self, kind: str, content: Any) -> None:
        """A new state of `kind`; the one before is forgotten."""
        data = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
        with self._changed:
            self._count += 1
            self._events[kind] = (self._count, b"event: " + kind.encode() + b"\ndata: " + data + b"\n\n")
            self._changed.notify_all()

    def after(self, number: int, seconds: float) -> tuple[int, bytes]:
        """Events newer than `number`, oldest first, and the number of the newest; b"" after `seconds`."""
        with self._changed:
            self._changed.wait_for(lambda: self.closed or self._count > number, seconds)
            found = sorted(e for e in self._events.values() if e[0] > number)
            return self._count, b"".join(data for _, data in found)

    def close(self) -> None:
        """Let all who wait go."""
        with self._changed:
            self.closed = True
            self._changed.notify_all()
