"""Results as they come: one line of JSON a run, synced in batches; what a crash cuts off is one line.

The content hash covers what was asked and what came of it, in the order of keys: neither times nor the number
of workers nor the order in which they finished.
"""

import contextlib
import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from specs.errors import InputError, RunError

Result = dict[str, Any]
# Of a result: what depends on the computer, and on how much was recorded.
NOT_HASHED = ("seconds", "run_hash")


class Journal:
    """The file `path`, opened to read what is there and to append; one process at a time holds it."""

    def __init__(self, path: Path) -> None:
        """Raises InputError when another campaign writes to it, RunError when the disk refuses."""
        self.path = path
        self._lock = path.with_suffix(".lock")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._take_lock()
            self.results = {r["key"]: r for r in _read(path)}
            _cut(path)
            self._file = path.open("a", encoding="utf-8")
        except OSError as error:
            raise RunError(f"{path}: {error.strerror}") from None

    def _take_lock(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            other = int(self._lock.read_text())
            os.kill(other, 0)
            raise InputError(f"{self.path.parent}: process {other} works on this campaign already")
        self._lock.write_text(str(os.getpid()))

    def append(self, results: Iterable[Result]) -> None:
        """Add results; they are on the disk when this returns."""
        try:
            for result in results:
                self.results[result["key"]] = result
                self._file.write(json.dumps(result, sort_keys=True) + "\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise RunError(f"{self.path}: {error.strerror}; what was written before is kept") from None

    def close(self) -> None:
        """Let others have it."""
        with contextlib.suppress(OSError):
            self._file.close()
        self._lock.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def content_hash(results: Sequence[Mapping[str, Any]]) -> str:
    """SHA-256 of results, whatever their order."""
    digest = hashlib.sha256()
    for result in sorted(results, key=lambda r: r["key"]):
        plain = {k: v for k, v in result.items() if k not in NOT_HASHED}
        digest.update(json.dumps(plain, sort_keys=True).encode() + b"\n")
    return digest.hexdigest()


def _read(path: Path) -> Iterable[Result]:
    if not path.is_file():
        return
    for line in path.read_text(encoding="utf-8").splitlines():
        with contextlib.suppress(json.JSONDecodeError):  # the last one, cut off
            yield json.loads(line)


def _cut(path: Path) -> None:
    """Take an unfinished last line away, lest the next one be joined to it."""
    if not path.is_file():
        return
    data = path.read_bytes()
    end = data.rfind(b"\n") + 1
    if end != len(data):
        os.truncate(path, end)
