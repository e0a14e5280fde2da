"""Who did what: one JSON object a line, only ever appended, bounded by rotating the files.

What was refused, and what clients of the bus did, has files of its own: whoever asks for nonsense, or claims
and leaves a thousand times, pushes nothing out of the files in which stands what was done.

In the oldest file there is room for everybody: when it is full, whoever has most in it loses his oldest
entries, first by where they came from, then by name.  So whatever one does, and however often, what others
did stays on the disk.
"""

import errno
import json
import os
import threading
from collections.abc import Callable
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
        last = self.path(self.kept - 1, name)
        _merge(last, self.path(self.kept - 2, name), self.largest)
        for number in range(self.kept - 2):
            older = self.path(self.kept - 3 - number, name)
            if older.is_file():
                older.rename(self.path(self.kept - 2 - number, name))


def _merge(last: Path, before: Path, largest: int) -> None:
    """Put the file before the last into the last, as far as there is room; whole at every moment."""
    if not before.is_file():
        return
    lines = [line for p in (last, before) if p.is_file() for line in p.read_bytes().splitlines(True)]
    kept = sorted(_fair(list(enumerate(lines)), largest, [_place, _name]))
    made = last.with_suffix(".new")
    with made.open("wb") as file:
        file.write(b"".join(line for _, line in kept))
        file.flush()
        os.fsync(file.fileno())
    made.rename(last)
    before.unlink()


Numbered = tuple[int, bytes]


def _fair(lines: list[Numbered], room: float, by: list[Callable[[bytes], str]]) -> list[Numbered]:
    """The newest lines that fit into `room` bytes, shared evenly by each key in turn."""
    if sum(len(line) for _, line in lines) <= room:
        return lines
    if not by:
        return _newest_of(lines, room)
    groups: dict[str, list[Numbered]] = {}
    for line in lines:
        groups.setdefault(by[0](line[1]), []).append(line)
    found: list[Numbered] = []
    smallest_first = sorted(groups.values(), key=lambda g: sum(len(line) for _, line in g))
    for number, group in enumerate(smallest_first):  # what one leaves of his share is the others'
        kept = _fair(group, room / (len(groups) - number), by[1:])
        room -= sum(len(line) for _, line in kept)
        found += kept
    return found


def _newest_of(lines: list[Numbered], room: float) -> list[Numbered]:
    for place in range(len(lines) - 1, -1, -1):
        room -= len(lines[place][1])
        if room < 0:
            return lines[place + 1 :]
    return lines


def _place(line: bytes) -> str:
    entry = next(iter(_entry(line)), {})
    return f"{entry.get('role')} {entry.get('from')}"


def _name(line: bytes) -> str:
    return str(next(iter(_entry(line)), {}).get("who"))


def _entry(line: bytes) -> list[dict[str, Any]]:
    try:
        found = json.loads(line)
    except ValueError:  # cut off by a power failure
        return []
    return [found] if isinstance(found, dict) else []
