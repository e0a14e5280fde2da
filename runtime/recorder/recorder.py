"""The recorder process: empties the queue into segments.

A disk that is full or slow is its own affair: it deletes the oldest segments, or drops what it cannot write
and says so in the queue's note; the control process only ever sees the note.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from runtime.recorder.feed import DISK_FULL, SNAPSHOT, SNAPSHOT_HEAD, TICK
from runtime.recorder.mend import mend
from runtime.recorder.seen import SEEN
from runtime.recorder.segments import Disk, Folder, Segment
from runtime.ring import Ring

SYNC_S = 0.5  # between waits for the disk: with half a second of chunk, less than 1 s is lost
POLL_S = 0.05
SPARE = 1 << 20  # bytes kept free below the limit for what is written between two looks


@dataclass
class Recorder:
    """Takes entries from `ring`; a segment is closed at the first snapshot after `segment_ticks` ticks."""

    ring: Ring
    folder: Folder
    metadata: Mapping[str, str]
    segment_ticks: int
    disk: Disk = field(default_factory=Disk)
    clock: Callable[[], float] = time.monotonic
    segment: Segment | None = None
    full: bool = False
    _synced: float = 0.0
    _seen: bytes = b""

    def __post_init__(self) -> None:
        for path in self.folder.segments()[-1:]:
            mend(path)

    def work(self) -> int:
        """Take all that waits; the number of entries."""
        count = 0
        while (entry := self.ring.get()) is not None:
            count += 1
            self._guarded(self._take, *entry)
            if not count % 64:
                self._beat()
        self._guarded(self._flush)
        self._beat()
        return count

    def run(self, stop: Callable[[], bool]) -> None:
        """Work until `stop()`, then close the segment."""
        while not stop():
            self.work()
            time.sleep(POLL_S)
        self.work()
        self.close()

    def close(self) -> None:
        """Close the segment."""
        if self.segment:
            self._guarded(self.segment.close)
        self.segment = None

    def _beat(self) -> None:
        self.ring.live(DISK_FULL if self.full else 0)

    def _take(self, kind: int, data: bytes) -> None:
        if kind == SNAPSHOT:
            self._at_snapshot(data)
        elif kind == SEEN:
            self._seen = data
        elif kind == TICK and self.segment:
            self.segment.add_tick(data)
            if self._seen:  # came before its tick, and has its time
                self.segment.add_seen(self._seen)
            self._seen = b""

    def _at_snapshot(self, data: bytes) -> None:
        tick, day = SNAPSHOT_HEAD.unpack_from(data)
        if self.segment and self._is_long(self.segment):
            self.close()
        if self.segment is None:
            self.folder.make_room(None, SPARE)
            self.segment = self._open()
            self.full = False
        self.segment.add_snapshot(tick, day, data[SNAPSHOT_HEAD.size :])

    def _is_long(self, segment: Segment) -> bool:
        return segment.ticks >= self.segment_ticks or segment.bytes > self.folder.limit // 4

    def _open(self) -> Segment:
        path = self.folder.next_path()
        try:
            return Segment(path, {**self.metadata, "segment": path.stem}, self.disk)
        except OSError:
            path.unlink(missing_ok=True)  # not even its head is there
            raise

    def _flush(self) -> None:
        if not self.segment:
            return
        now = self.clock()
        sync = now - self._synced >= SYNC_S
        if sync:
            self._synced = now
            self.folder.make_room(self.segment.path, SPARE)
        self.segment.flush(sync)

    def _guarded(self, action: Callable[..., None], *arguments: object) -> None:
        """Do it; if the disk refuses, leave the segment as it is and go on at the next snapshot."""
        try:
            action(*arguments)
        except OSError:
            self.full = True
            if self.segment:
                self.segment.abandon()
                self.folder.drop_oldest(self.segment.path)
            self.segment = None


def folder_of(path: Path, limit: int) -> Folder:
    """The folder, checked to be large enough for two segments' ends."""
    return Folder(path, max(limit, 4 * SPARE))
