"""A queue in shared memory from one process to one other: the writer never waits, and never takes a lock.

A file that both map: a head of words, then `capacity` bytes in which entries follow each other and wrap.

    word  0  magic           1  capacity [bytes]      2  entries that found no room (writer)
    word  8  head: bytes written so far (writer)     16  tail: bytes read so far (reader)
    word 17  beat: counts while the reader works     18  note of the reader (its own meaning)

An entry is `length u32, crc32 u32, kind u32, pad u32`, its bytes, and zeros to a whole number of 8.  The head
moves after the entry is whole; on machines that reorder stores the reader sees that by the checksum and looks
again.
"""

import mmap
import struct
import zlib
from pathlib import Path

from runtime.shared import address
from specs.errors import InputError

MAGIC = 0x0001_474E_4952_5753  # "SWRING", version 1
HEAD_BYTES = 256
ENTRY = struct.Struct("<IIII")
WRAP = 0xFFFF_FFFF  # kind of the filler before the end
MAGIC_AT, CAPACITY_AT, LOST_AT, HEAD_AT, TAIL_AT, BEAT_AT, NOTE_AT = 0, 1, 2, 8, 16, 17, 18
LOOKS = 1000  # how often an entry whose checksum is wrong is read again


class Ring:
    """One end of the queue; `create` makes it, `attach` opens one that is there."""

    def __init__(self, path: Path, capacity: int) -> None:
        self.path, self.capacity = path, capacity
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), HEAD_BYTES + capacity)
        self._words = memoryview(self._map)[:HEAD_BYTES].cast("Q")
        self._data = memoryview(self._map)[HEAD_BYTES:]

    @classmethod
    def create(cls, path: Path, capacity: int) -> "Ring":
        """A new, empty queue of `capacity` bytes (a multiple of 8), readable by this user only."""
        path.touch(mode=0o600)
        with path.open("r+b") as file:
            file.write(struct.pack("<QQ", MAGIC, capacity))
            file.truncate(HEAD_BYTES + capacity)
        return cls(path, capacity)

    @classmethod
    def attach(cls, path: Path) -> "Ring":
        """The queue at `path`; raises InputError if that is none."""
        with path.open("rb") as file:
            head = file.read(16)
        magic, capacity = struct.unpack("<QQ", head) if len(head) == 16 else (0, 0)
        if magic != MAGIC or path.stat().st_size != HEAD_BYTES + capacity:
            raise InputError(f"{path} is no queue of this version")
        return cls(path, capacity)

    @property
    def place(self) -> tuple[int, int, int]:
        """Addresses of words and data, and the capacity: for C code."""
        start = address(self._map)
        return start, start + HEAD_BYTES, self.capacity

    def put(self, kind: int, *parts: bytes | memoryview) -> bool:
        """Append an entry made of `parts`; False, and counted, if there is no room: nobody is waited for."""
        words, capacity = self._words, self.capacity
        length = sum(map(len, parts))
        whole = ENTRY.size + (length + 7 & ~7)
        head = words[HEAD_AT]
        at = head % capacity
        skip = capacity - at if at + whole > capacity else 0
        if head - words[TAIL_AT] + skip + whole > capacity:
            words[LOST_AT] += 1
            return False
        if skip:  # always at least 8 bytes, enough for length and checksum; the kind marks it if it fits
            self._fill(at, skip)
            at = 0
        start = end = at + ENTRY.size
        crc = 0
        for part in parts:
            self._data[end : end + len(part)] = part
            crc = zlib.crc32(part, crc)
            end += len(part)
        ENTRY.pack_into(self._data, start - ENTRY.size, length, crc, kind, 0)
        words[HEAD_AT] = head + skip + whole
        return True

    def get(self) -> tuple[int, bytes] | None:
        """The oldest entry as (kind, bytes), taken out; None if there is none.

        An entry that stays damaged is dropped with everything behind it and counted as lost.
        """
        words = self._words
        for _ in range(LOOKS):
            tail, head = words[TAIL_AT], words[HEAD_AT]
            if tail == head:
                return None
            at = tail % self.capacity
            if self._is_filler(at):
                words[TAIL_AT] = tail + self.capacity - at
                continue
            found = self._entry(at)
            if found:
                kind, data = found
                words[TAIL_AT] = tail + ENTRY.size + (len(data) + 7 & ~7)
                return kind, data
        words[TAIL_AT] = words[HEAD_AT]
        words[LOST_AT] += 1
        return None

    @property
    def lost(self) -> int:
        """Entries that found no room so far."""
        return self._words[LOST_AT]

    @property
    def waiting(self) -> int:
        """Bytes that the reader has not taken yet."""
        return self._words[HEAD_AT] - self._words[TAIL_AT]

    @property
    def beat(self) -> int:
        """A count that grows while the reader works."""
        return self._words[BEAT_AT]

    @property
    def note(self) -> int:
        """What the reader tells the writer."""
        return self._words[NOTE_AT]

    def live(self, note: int = 0) -> None:
        """The reader says that it works, and what it has to tell."""
        self._words[NOTE_AT] = note
        self._words[BEAT_AT] += 1

    def close(self) -> None:
        """Let go of the memory; the file stays."""
        self._words.release()
        self._data.release()
        self._map.close()

    def _fill(self, at: int, skip: int) -> None:
        head = ENTRY.pack(WRAP, WRAP, WRAP, 0)[: min(skip, ENTRY.size)]
        self._data[at : at + len(head)] = head

    def _is_filler(self, at: int) -> bool:
        return self._data[at : at + 4] == b"\xff\xff\xff\xff"

    def _entry(self, at: int) -> tuple[int, bytes] | None:
        length, crc, kind, _ = ENTRY.unpack_from(self._data, at)
        start = at + ENTRY.size
        if start + length > self.capacity:
            return None
        data = bytes(self._data[start : start + length])
        return (kind, data) if zlib.crc32(data) == crc else None
