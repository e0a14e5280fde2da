"""Who did what: one JSON object a line, only ever appended, bounded by rotating the files.

What was refused, and what clients of the bus did, has files of its own: whoever asks for nonsense, or claims
and leaves a thousand times, pushes nothing out of the files in which stands what was done.
"""

import errno
import json
import os
import threading
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

NAME, OTHERS = "audit", "audit-refused"
TEXT = 200  # characters of a text in an entry
LARGEST = 1_000_000  # bytes of a file
KEPT = 5  # files, the present one included


class Audit:
    """The log in `folder`: audit.jsonl, older ones audit.1.jsonl and up; safe for several threads."""

    def __init__(self, folder: Path, largest: int = LARGEST, kept: int = KEPT) -> None:
        self.folder, self.largest, self.kept = folder, largest, kept
        self._lock = threading.Lock()
        self.failed = False  # the last entry could not be written
        folder.mkdir(parents=True, exist_ok=True)

    def path(self, number: int = 0, name: str = NAME) -> Path:
        """The present file, or an older one."""
        return self.folder / (f"{name}.{number}.jsonl" if number else f"{name}.jsonl")

    def write(self, who: str, role: str, where: str, what: str, **more: Any) -> None:
        """Append an entry, on the disk when this returns; raises OSError.

        `more`: what it is about, `old`, `new`, `result`.
        """
        stamp = datetime.now(UTC).isoformat(timespec="milliseconds")
        entry = {"time": stamp, "who": who, "role": role, "from": where, "what": what, **more}
        entry = {k: v[:TEXT] if isinstance(v, str) else v for k, v in entry.items()}
        name = OTHERS if str(more.get("result", "")).startswith(("refused", "told")) else NAME
        line = json.dumps(entry, ensure_ascii=False, default=str).encode("utf-8", "replace") + b"\n"
        with self._lock:
            self.failed = True
            self._make_room(len(line), name)
            flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC
            descriptor = os.open(self.path(name=name), flags, 0o640)
            try:
                size = os.fstat(descriptor).st_size
                if os.write(descriptor, line) < len(line):  # the disk is full: half an entry is none
                    os.ftruncate(descriptor, size)
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
            self.failed = False

    def last(self, count: int) -> list[dict[str, Any]]:
        """The newest entries, the last one first; what is no entry is left out."""
        both = [*self._newest(count, NAME), *self._newest(count, OTHERS)]
        return sorted(both, key=lambda e: str(e.get("time", "")), reverse=True)[:count]

    def _newest(self, count: int, name: str) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = []
        for number in range(self.kept):
            path = self.path(number, name)
            lines = path.read_bytes().splitlines() if path.is_file() else []
            for line in reversed(lines):
                if len(found) == count:
                    return found
                found += _entry(line)
        return found

    def _make_room(self, size: int, name: str) -> None:
        path = self.path(name=name)
        if not path.is_file() or path.stat().st_size + size <= self.largest:
            return
        self.path(self.kept - 1, name).unlink(missing_ok=True)
        for number in range(self.kept - 2, -1, -1):
            if self.path(number, name).is_file():
                self.path(number, name).rename(self.path(number + 1, name))


def _entry(line: bytes) -> list[dict[str, Any]]:
    try:
        found = json.loads(line)
    except ValueError:  # cut off by a power failure
        return []
    return [found] if isinstance(found, dict) else []
