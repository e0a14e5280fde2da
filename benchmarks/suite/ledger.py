"""Results of a suite as a file of lines: what was measured stays where the folders of its cases do not.

The first line says which suite it is, every other is the result of a case (work.py).  A suite goes on from
such a file in a fresh clone: cases in it are done.
"""

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.suite.plan import Settings
from records.figures_file import check_target, write_text
from specs.errors import InputError

SUITE = "suite"  # the first line's only key


class Ledger:
    """The results of a suite in a file, by key; `path` None: kept nowhere."""

    def __init__(self, path: Path | None, settings: Settings):
        self.path, self.settings = path, settings
        self.results = _read(path)[1] if path is not None and path.exists() else {}

    def keep(self, results: Iterable[dict[str, Any]]) -> None:
        """Take in further results, those of a known case in place of the old ones, and write the file."""
        self.results |= {r["key"]: r for r in results if not r["failed"]}
        if self.path is None:
            return
        rows = [{SUITE: asdict(self.settings)}, *(self.results[k] for k in sorted(self.results))]
        write_text(self.path, "".join(json.dumps(row, separators=(",", ":")) + "\n" for row in rows))


def seed_of(path: Path | None, seed: int | None, **wanted) -> int | None:
    """The seed asked for, or else that of the suite whose results a file holds; None if there is neither.

    Raises InputError if the file holds another suite, something else, or could not be written.
    """
    check_target(path)
    if path is None or not path.exists():
        return seed
    there = _read(path)[0]
    if there != Settings(there.seed if seed is None else seed, **wanted):
        said = ", ".join(f"{k} {v}" for k, v in asdict(there).items() if v is not None)
        raise InputError(f"{path} holds results of another suite ({said}); name another file")
    return there.seed


def _read(path: Path) -> tuple[Settings, dict[str, dict[str, Any]]]:
    try:
        first, *rows = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
        return Settings(**first[SUITE]), {r["key"]: r for r in rows}
    except (ValueError, TypeError, KeyError, OSError) as error:
        raise InputError(f"{path} holds no results of a suite: {error}") from None
