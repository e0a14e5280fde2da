"""Reading a recording: whole files and files that end anywhere."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Channel, Chunk, Message, Metadata
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from runtime.recorder.message import SNAPSHOT_TOPIC, TICK_TOPIC, places, snapshot_of
from runtime.recorder.seen import SEEN_TOPIC, places as seen_places
from runtime.recorder.segments import METADATA, SUFFIX
from specs.errors import InputError

BROKEN = (CRCValidationError, McapError, ValueError, RuntimeError, struct.error, zstandard.ZstdError)


@dataclass(frozen=True)
class Tick:
    """One tick's entry: timing, input image, output image."""

    entry: bytes


@dataclass(frozen=True)
class Snapshot:
    """The core's state before `tick`."""

    tick: int
    state: bytes


@dataclass(frozen=True)
class Seen:
    """What the operator did in a tick of shadow mode: an entry of runtime/recorder/seen.py."""

    entry: bytes


@dataclass
class Recording:
    """A file or a folder of segments; `notes` says what was missing in it, once it was read."""

    path: Path
    notes: list[str] = field(default_factory=list)

    def files(self) -> list[Path]:
        """The segments, oldest first; raises InputError where there are none."""
        found = sorted(self.path.glob(f"*{SUFFIX}")) if self.path.is_dir() else [self.path]
        if not found:
            raise InputError(f"{self.path} holds no recording (*{SUFFIX})")
        if not found[0].is_file():
            raise InputError(f"there is no file {found[0]}")
        return found

    def metadata(self) -> dict[str, str]:
        """Who recorded it; raises InputError for a file that is not ours."""
        for path in self.files():
            for part in parts(path, []):
                if isinstance(part, Metadata) and part.name == METADATA:
                    return dict(part.metadata)
        raise InputError(f"{self.path} is no recording of the runtime")

    def items(self) -> Iterator[Tick | Snapshot]:
        """Ticks and snapshots in order, as far as the files are whole."""
        return (item for item in self.everything() if not isinstance(item, Seen))

    def everything(self) -> Iterator[Tick | Snapshot | Seen]:
        """The same, each tick of shadow mode followed by what the operator did in it."""
        for path in self.files():
            topics: dict[int, str] = {}
            for part in parts(path, self.notes):
                if isinstance(part, Channel):
                    topics[part.id] = part.topic
                elif isinstance(part, Message):
                    yield from _item(part, topics.get(part.channel_id, ""), path)


def _item(message: Message, topic: str, path: Path) -> Iterator[Tick | Snapshot | Seen]:
    if topic == SNAPSHOT_TOPIC:
        yield Snapshot(*snapshot_of(message.data))
    elif topic == TICK_TOPIC:
        entry = places().entry(message.data)
        if entry is None:
            raise InputError(f"{path}: its ticks are not of this version's signals")
        yield Tick(entry)
    elif topic == SEEN_TOPIC:
        entry = seen_places().entry(message.data)
        if entry is None:
            raise InputError(f"{path}: what its operator did is not of this version's signals")
        yield Seen(entry)


def parts(path: Path, notes: list[str]) -> Iterator[Any]:
    """The records of a file, chunks taken apart, as far as it is whole; InputError if it is not MCAP."""
    with path.open("rb") as file:
        head = file.read(len(MCAP0_MAGIC))
        if not MCAP0_MAGIC.startswith(head):
            raise InputError(f"{path} is not MCAP")
        file.seek(0)
        records = StreamReader(file, emit_chunks=True).records
        while True:
            try:
                part = next(records)
            except StopIteration:
                return
            except (EndOfFile, *BROKEN) as error:
                notes.append(f"{path.name}: ends within a record, read up to there ({type(error).__name__})")
                return
            yield from _inside(part, path, notes) if isinstance(part, Chunk) else (part,)


def _inside(chunk: Chunk, path: Path, notes: list[str]) -> list[Any]:
    try:
        return breakup_chunk(chunk, validate_crc=True)
    except BROKEN:
        notes.append(f"{path.name}: a chunk is damaged and left out")
        return []
