"""What a user states about recordings, so that nothing has to be decided from the files themselves.

A statement is about files, whoever reads them and however often: commands state it once, around all they do.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path

from records.formats.text.options import TextOptions


@dataclass(frozen=True)
class Statement:
    """What holds for a recording: names of channels, {theirs: ours}, and how its text is read."""

    names: Mapping[str, str] = field(default_factory=dict)
    text: TextOptions | None = None


_STATED: ContextVar[Mapping[Path, Statement]] = ContextVar("stated", default={})  # noqa: B039  (never changed)


@contextmanager
def stated(paths: Sequence[Path], statement: Statement) -> Iterator[None]:
    """Within it, `statement` holds for the recordings at `paths`, and for no others."""
    token = _STATED.set({**_STATED.get(), **dict.fromkeys((p.resolve() for p in paths), statement)})
    try:
        yield
    finally:
        _STATED.reset(token)


def statement_of(path: Path) -> Statement:
    """What was stated about a recording; nothing if nothing was."""
    found = _STATED.get()
    return found.get(path.resolve(), Statement()) if found else Statement()
