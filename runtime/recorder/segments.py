"""The files of a recording: segments that begin with a snapshot, oldest deleted first, readable wherever cut.

A segment's chunks hold half a second each and go to the disk when they are full, so a file that ends anywhere
loses less than a second.  A segment that was not closed gets its end when the next recorder starts.
"""

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from mcap.writer import Writer

from runtime.recorder import seen
from runtime.recorder.message import (
    PACKAGE,
    SNAPSHOT_TOPIC,
    TICK_TOPIC,
    places,
    schema,
    snapshot_message,
    units,
)

CHUNK_TICKS = 25  # half a second
METADATA = "slewright"
SUFFIX = ".mcap"


class Disk:
    """What segments ask of the disk; tests put a full or a slow one in its place."""

    def open(self, path: Path) -> BinaryIO:
        """A new file."""
        return path.open("xb")

    def sync(self, file: BinaryIO) -> None:
        """Wait for the disk."""
        os.fsync(file.fileno())


class Segment:
    """One file being written."""

    def __init__(self, path: Path, metadata: Mapping[str, str], disk: Disk) -> None:
        self.path, self._disk = path, disk
        self.ticks = 0
        self._file = disk.open(path)
        self._writer = Writer(self._file, chunk_size=CHUNK_TICKS * places().message_bytes)
        self._writer.start(profile="", library="slewright")
        self._writer.add_metadata(METADATA, dict(metadata))
        whole = schema()
        tick = self._writer.register_schema(f"{PACKAGE}.Tick", "protobuf", whole)
        snapshot = self._writer.register_schema(f"{PACKAGE}.Snapshot", "protobuf", whole)
        self._tick = self._writer.register_channel(
            TICK_TOPIC, "protobuf", tick, {METADATA: "channels", **units()}
        )
        self._snapshot = self._writer.register_channel(
            SNAPSHOT_TOPIC, "protobuf", snapshot, {METADATA: "state"}
        )
        self._operator: int | None = None  # the topic, once there is something in it
        self._day = 0  # of the last tick
        self._file.flush()

    def add_tick(self, entry: bytes) -> None:
        """A tick as the queue holds it."""
        day = self._day = int.from_bytes(entry[:8], "little", signed=True)
        self._writer.add_message(self._tick, day, places().message(entry), day, self.ticks & 0xFFFF_FFFF)
        self.ticks += 1

    def add_seen(self, entry: bytes) -> None:
        """What the operator did in the tick that was added last (shadow mode)."""
        if self._operator is None:
            whole = schema(Operator=seen.fields())
            kind = self._writer.register_schema(f"{PACKAGE}.Operator", "protobuf", whole)
            told = {METADATA: "channels", **seen.units()}
            self._operator = self._writer.register_channel(seen.SEEN_TOPIC, "protobuf", kind, told)
        self._writer.add_message(self._operator, self._day, seen.places().message(entry), self._day)

    def add_snapshot(self, tick: int, day: int, state: bytes) -> None:
        """The core's state before `tick`."""
        self._writer.add_message(self._snapshot, day, snapshot_message(tick, state), day)

    @property
    def bytes(self) -> int:
        """Written so far."""
        return self._file.tell()

    def flush(self, sync: bool) -> None:
        """Hand what chunks are whole to the system, and wait for the disk if `sync`."""
        self._file.flush()
        if sync:
            self._disk.sync(self._file)

    def close(self) -> None:
        """Write index and footer."""
        try:
            self._writer.finish()
            self._file.flush()
        finally:
            with suppress(OSError):
                self._file.close()

    def abandon(self) -> None:
        """Leave the file as it is on the disk: what is whole in it stays readable."""
        with suppress(OSError):
            self._file.close()


class Folder:
    """The segments of a recording in `path`, together at most `limit` bytes."""

    def __init__(self, path: Path, limit: int) -> None:
        self.path, self.limit = path, limit
        path.mkdir(parents=True, exist_ok=True)

    def segments(self) -> list[Path]:
        """Oldest first."""
        return sorted(self.path.glob(f"segment-*{SUFFIX}"))

    def next_path(self) -> Path:
        """Where the next segment goes."""
        there = self.segments()
        number = int(there[-1].stem.split("-")[1]) + 1 if there else 0
        return self.path / f"segment-{number:08d}{SUFFIX}"

    def make_room(self, keep: Path | None, need: int = 0) -> bool:
        """Delete the oldest segments until `need` more bytes fit; False if all that is left is `keep`."""
        sizes = {p: p.stat().st_size for p in self.segments()}
        for oldest in [p for p in sizes if p != keep]:
            if sum(sizes.values()) + need <= self.limit:
                return True
            oldest.unlink()
            del sizes[oldest]
        return sum(sizes.values()) + need <= self.limit

    def drop_oldest(self, keep: Path | None) -> bool:
        """Delete one segment; False if there is none but `keep`."""
        for oldest in self.segments():
            if oldest != keep:
                oldest.unlink()
                return True
        return False
