"""Shared memory between the runtime's processes: the latest state of something, written by one process.

A cell is a file, mapped into each process.  Its writer (there is one) never waits: it fills the slot after
the one that is current and then makes that current.  A reader copies the current slot and keeps the copy if
number and CRC agree; only a writer that goes round all slots during one copy makes it try again.  So no
reader ever waits for a writer that was preempted or killed, and no torn state passes, whatever the order of
the processor's stores: with a plain sequence lock the first is false, and the second needs barriers that
Python lacks.

The image goes out of the control process in one cell; what other processes want from it comes in, each
through a cell of its own (a mailbox: only the newest counts, `number` tells how many were written).
"""

import ctypes
import mmap
import os
import struct
import tempfile
from pathlib import Path
from zlib import crc32

import numpy as np

from specs.errors import InputError

SLOTS = 4  # so many states may begin while one is being copied
RETRIES = 4
MAGIC = b"SLRCELL1"
HEAD = struct.Struct("=8s24sQQ")  # magic, what it holds, payload bytes, number of the current state
SLOT = struct.Struct("=QQ")  # number of the state, CRC-32 over number and payload
CURRENT = HEAD.size - 8
NUMBER = struct.Struct("=Q")


def private_folder(prefix: str = "slewright-") -> Path:
    """A new folder that only this user can enter, in memory where the system has such a place."""
    base = next((p for p in (Path("/dev/shm"),) if os.access(p, os.W_OK)), None)
    return Path(tempfile.mkdtemp(prefix=prefix, dir=base))


def flat(state: bytes | memoryview | np.ndarray) -> memoryview:
    """The bytes of an array as they lie in memory; valid while the array is changed."""
    return state.reshape(-1).view(np.uint8).data if isinstance(state, np.ndarray) else memoryview(state)


def address(memory: mmap.mmap | memoryview) -> int:
    """Where memory lies, for C code: for as long as it stays open."""
    return ctypes.addressof(ctypes.c_char.from_buffer(memory))


class Cell:
    """One state of fixed size in shared memory; make it with `create`, join it with `open`."""

    def __init__(self, path: Path, memory: mmap.mmap) -> None:
        self.path, self._memory = path, memory
        _, _, self.size, _ = HEAD.unpack_from(memory)
        self._stride = _stride(self.size)

    @classmethod
    def create(cls, path: Path, size: int, holds: str) -> "Cell":
        """A new cell for states of `size` bytes; `holds` says what (ASCII, at most 24 letters)."""
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        try:
            total = HEAD.size + SLOTS * _stride(size)
            os.posix_fallocate(descriptor, 0, total)  # a full memory disk is found here, not in the loop
            memory = mmap.mmap(descriptor, total)
        finally:
            os.close(descriptor)
        HEAD.pack_into(memory, 0, MAGIC, holds.encode("ascii")[:24], size, 0)
        return cls(path, memory)

    @classmethod
    def alone(cls, size: int, holds: str) -> "Cell":
        """A new cell that no other process sees: without a file."""
        memory = mmap.mmap(-1, HEAD.size + SLOTS * _stride(size))
        HEAD.pack_into(memory, 0, MAGIC, holds.encode("ascii")[:24], size, 0)
        return cls(Path(), memory)

    @classmethod
    def open(cls, path: Path, size: int, holds: str) -> "Cell":
        """Join a cell that another process made; raises InputError if it is not that."""
        try:
            with path.open("r+b") as file:
                memory = mmap.mmap(file.fileno(), 0)
        except (OSError, ValueError) as error:
            raise InputError(f"shared memory {path}: {error}") from None
        whole = len(memory) >= HEAD.size
        magic, name, found, _ = HEAD.unpack_from(memory) if whole else (b"", b"", 0, 0)
        wanted = (MAGIC, holds.encode("ascii")[:24].ljust(24, b"\0"), size)
        if (magic, name, found) != wanted or len(memory) != HEAD.size + SLOTS * _stride(size):
            raise InputError(
                f"shared memory {path} does not hold {size} bytes of '{holds}': of another version?"
            )
        return cls(path, memory)

    @property
    def place(self) -> tuple[int, int, int]:
        """Address, bytes of a state, bytes from one slot to the next: for C code."""
        return address(self._memory), self.size, self._stride

    @property
    def number(self) -> int:
        """How many states were written; 0: none yet."""
        return NUMBER.unpack_from(self._memory, CURRENT)[0]

    def write(self, *parts: bytes | memoryview | np.ndarray) -> None:
        """Make `parts`, one after the other, the current state (single writer; never waits)."""
        number = self.number + 1  # a cell has one writer, but that may be C code at times (scan.c)
        at = HEAD.size + number % SLOTS * self._stride
        crc, end, last = number & 0xFFFFFFFF, at + SLOT.size, at + SLOT.size + self.size
        NUMBER.pack_into(self._memory, at, 0)  # nobody takes the slot while it is filled
        for part in parts:
            state = flat(part) if isinstance(part, np.ndarray) else part
            begin, end = end, end + len(state)
            if end > last:
                break
            self._memory[begin:end] = state
            crc = crc32(state, crc)
        if end != last:
            raise ValueError(f"state of {sum(len(flat(p)) for p in parts)} bytes, not {self.size}")
        SLOT.pack_into(self._memory, at, number, crc)
        NUMBER.pack_into(self._memory, CURRENT, number)

    def read(self) -> tuple[int, bytes] | None:
        """Number and bytes of the current state; None if there is none, or none was had in a few tries."""
        for _ in range(RETRIES):
            number = NUMBER.unpack_from(self._memory, CURRENT)[0]
            if number == 0:
                return None
            at = HEAD.size + number % SLOTS * self._stride
            copy = self._memory[at : at + SLOT.size + self.size]
            found, check = SLOT.unpack_from(copy)
            payload = copy[SLOT.size :]
            if found == number and check == crc32(payload, number & 0xFFFFFFFF):
                return number, payload
        return None

    def close(self) -> None:
        """Leave the cell; the file stays for the others."""
        self._memory.close()

    def unlink(self) -> None:
        """Remove the file; whoever joined keeps what it has."""
        self.path.unlink(missing_ok=True)


def _stride(size: int) -> int:
    """Bytes of a slot, whole cache lines."""
    return -(-(SLOT.size + size) // 64) * 64
