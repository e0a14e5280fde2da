"""The records of an MCAP file one after the other, chunk by chunk, as far as the file is whole."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from records.recording import first_line
from specs.errors import InputError

BROKEN_CHUNK = (
    CRCValidationError,
    McapError,
    ValueError,
    RuntimeError,
    struct.error,
    zstandard.ZstdError,
    MemoryError,
)
HEAD = struct.Struct("<BQ")  # of a record: its kind and its length


class _WholePart:
    """The bytes of a file up to the end of its last whole record, and what must stand behind them.

    It reads what is there, however much a damaged length asks for.
    """

    def __init__(self, file: Any, end: int, behind: bytes) -> None:
        self.file, self.left, self.behind = file, end, behind
        file.seek(0)

    def read(self, size: int) -> bytes:
        data = self.file.read(min(size, self.left))
        self.left -= len(data)
        more = size - len(data)
        data, self.behind = data + self.behind[:more], self.behind[more:]
        return data


def records_of(path: Path, notes: list[str]) -> Iterator[Any]:
    """The records of the file, those of damaged chunks left out, until its end or where it was cut."""
    with path.open("rb") as file:
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise InputError(f"{path} is not MCAP")
        end, closed = _last_whole_record(file, path.stat().st_size)
        if not closed:
            notes.append("the file was not closed, it has no footer: read as far as it is whole")
        part = _WholePart(file, end, MCAP0_MAGIC if closed else b"")
        records = StreamReader(part, emit_chunks=True).records  # type: ignore[arg-type]
        while True:
            try:
                record = next(records)
            except (StopIteration, EndOfFile):
                return
            except (McapError, ValueError, OverflowError, MemoryError, struct.error) as error:
                notes.append(f"the file is damaged: read up to there ({first_line(error)})")
                return
            yield from _of_chunk(record, notes) if isinstance(record, Chunk) else (record,)


def _last_whole_record(file: Any, size: int) -> tuple[int, bool]:
    """Where the last whole record ends, and whether that is the footer."""
    at = len(MCAP0_MAGIC)
    while at + HEAD.size <= size:
        file.seek(at)
        code, length = HEAD.unpack(file.read(HEAD.size))
        if at + HEAD.size + length > size:
            break
        at += HEAD.size + length
        if code == Opcode.FOOTER:
            return at, True
    return at, False


def _of_chunk(chunk: Chunk, notes: list[str]) -> list[Any]:
    try:
        return breakup_chunk(chunk, validate_crc=True)
    except BROKEN_CHUNK:
        seconds = (chunk.message_end_time - chunk.message_start_time) / 1e9
        notes.append(f"dropped a damaged chunk of {seconds:.6g} s")
        return []
