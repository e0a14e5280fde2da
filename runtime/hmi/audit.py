"""Who did what: one JSON object a line, only ever appended, bounded by rotating the files."""

import json
import os
import threading
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

NAME = "audit"
LARGEST = 1_000_000  # bytes of a file
KEPT = 5  # files, the present one included


class Audit:
    """The log in `folder`: audit.jsonl, older ones audit.1.jsonl and up; safe for several threads."""

    def __init__(self, folder: Path, largest: int = LARGEST, kept: int = KEPT) -> None:
        self.folder, self.largest, self.kept = folder, largest, kept
        self._lock = threading.Lock()
        self.failed = False  # the last entry could not be written
        folder.mkdir(parents=True, exist_ok=True)

    def path(self, number: int = 0) -> Path:
        """The present file, or an older one."""
        return self.folder / (f"{NAME}.{number}.jsonl" if number else f"{NAME}.jsonl")

    def write(self, who: str, role: str, where: str, what: str, **more: Any) -> None:
        """Append an entry, on the disk when this returns; raises OSError.

        `more`: what it is about, `old`, `new`, `result`.
        """
        stamp = datetime.now(UTC).isoformat(timespec="milliseconds")
        entry = {"time": stamp, "who": who, "role": role, "from": where, "what": what, **more}
        line = json.dumps(entry, ensure_ascii=False, default=str).encode("utf-8", "replace") + b"\n"
        with self._lock:
            self.failed = True
            self._make_room(len(line))
            descriptor = os.open(self.path(), os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o640)
            try:
                os.write(descriptor, line)
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
            self.failed = False

    def last(self, count: int) -> list[dict[str, Any]]:
        """The newest entries, the last one first; what is no entry is left out."""
        found: list[dict[str, Any]] = []
        for number in range(self.kept):
            path = self.path(number)
            lines = path.read_bytes().splitlines() if path.is_file() else []
            for line in reversed(lines):
                if len(found) == count:
                    return found
                found += _entry(line)
        return found

    def _make_room(self, size: int) -> None:
        path = self.path()
        if not path.is_file() or path.stat().st_size + size <= self.largest:
            return
        self.path(self.kept - 1).unlink(missing_ok=True)
        for number in range(self.kept - 2, -1, -1):
            if self.path(number).is_file():
                self.path(number).rename(self.path(number + 1))


def _entry(line: bytes) -> list[dict[str, Any]]:
    try:
        found = json.loads(line)
    except ValueError:  # cut off by a power failure
        return []
    return [found] if isinstance(found, dict) else []
