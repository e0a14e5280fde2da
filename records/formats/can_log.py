"""CAN logs, BLF and ASC (Vector), decoded and encoded by a DBC; each message's signals share its times."""

import io
import logging
import re
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import can
import numpy as np
from can.io.blf import FILE_HEADER_SIZE, BLFParseError

from records.formats.can_write import MONTHS, NEVER, write
from records.formats.dbc import Dbc, checksums, columns, data_id
from records.formats.metadata import at_ns
from records.formats.raw import Group, Raw
from records.recording import first_line
from specs.errors import InputError

__all__ = ["read", "write"]

READS = (".blf", ".asc")
WRITES = (".blf", ".asc")
GERMAN = {"Mär": "Mar", "Mai": "May", "Okt": "Oct", "Dez": "Dec"}
ASC_DATE = re.compile(r"^(?:date|begin\s+triggerblock)\s+\w+\s+(.+)$", re.IGNORECASE | re.MULTILINE)
ASC_END = re.compile(r"^end\s+triggerblock", re.IGNORECASE | re.MULTILINE)
ASC_RELATIVE = re.compile(r"^base\s+\w+\s+timestamps\s+relative", re.IGNORECASE | re.MULTILINE)
ASC_FORMS = ("%m %d %I:%M:%S.%f %p %Y", "%m %d %I:%M:%S %p %Y", "%m %d %H:%M:%S.%f %Y", "%m %d %H:%M:%S %Y")
NO_ZONE = "the start states no time zone: taken as UTC"
HEAD = 4096  # characters of an ASC file in which its head lies


@dataclass
class _Frames:
    """Frames of one identifier on one bus, in the order of the log."""

    times: list[float] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)


def read(path: Path, names: Mapping[str, str], dbc: Path) -> Raw:
    """Decode what the DBC knows; raises InputError where that is nothing."""
    database, notes = Dbc(dbc), list[str]()
    if path.suffix.lower() == ".blf":
        messages, start = _blf(path, notes)
    else:
        messages, start = _asc(path, notes)
    with _warnings_into(notes):
        found = _collect(messages, path, notes)
    groups, unknown = [], {}
    for (bus, identifier, extended), frames in found.items():
        message = database.message(identifier, extended)
        if message is None:
            unknown[identifier] = len(frames.times)
        else:
            groups += _group(message, bus, frames, notes)
    if unknown:
        shown = ", ".join(f"{i:X}" for i in sorted(unknown)[:4]) + (", …" if len(unknown) > 4 else "")
        notes.append(f"frames that the DBC does not know: left out {sum(unknown.values())}, of {shown}")
    if not groups:
        what = "no frame that it knows" if found else "no frame"
        raise InputError(f"{path} holds {what} ({dbc.name})" + "".join(f"; {n}" for n in notes[:1]))
    return Raw(_uniquely_named(groups), start, {}, notes)


@contextmanager
def _warnings_into(notes: list[str]) -> Iterator[None]:
    """What python-can warns of, once each."""
    said: dict[str, None] = {}
    handler, logger = logging.Handler(), logging.getLogger("can")
    handler.emit = lambda record: said.setdefault(f"while reading: {record.getMessage()}")
    before, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.propagate = before
        notes += said


def _collect(messages: Iterator[Any], path: Path, notes: list[str]) -> dict[tuple, _Frames]:
    """Data frames by bus and identifier; a log that breaks off is read up to there."""
    found: dict[tuple, _Frames] = {}
    last = None
    while True:
        try:
            message = next(messages)
        except StopIteration:
            return found
        except (struct.error, zlib.error, BLFParseError, ValueError, IndexError, KeyError) as error:
            if last is None:
                raise InputError(f"{path} is damaged or no CAN log: {first_line(error)}") from None
            notes.append(f"the log breaks off or is damaged after {last:.9g} s: read up to there")
            return found
        if message.is_error_frame or message.is_remote_frame:
            continue
        last = message.timestamp
        key = (message.channel, message.arbitration_id, message.is_extended_id)
        frames = found.setdefault(key, _Frames())
        frames.times.append(last)
        frames.data.append(bytes(message.data))


def _group(message: Any, bus: Any, frames: _Frames, notes: list[str]) -> list[tuple[Any, Group]]:
    """The message's signals, in a list; an empty one where all frames are too short."""
    whole = [i for i, data in enumerate(frames.data) if len(data) >= message.length]
    if len(whole) < len(frames.data):
        short = len(frames.data) - len(whole)
        notes.append(f"{message.name}: frames shorter than {message.length} bytes: dropped {short}")
    if not whole or not message.length:
        return []
    data = b"".join(frames.data[i][: message.length] for i in whole)
    array = np.frombuffer(data, dtype=np.uint8).reshape(len(whole), message.length)
    time = np.array([frames.times[i] for i in whole], dtype=np.float64)
    identifier = data_id(message)
    if identifier is not None:
        right = checksums(array, identifier) == array[:, 0]
        if not right.all():
            wrong = len(right) - np.count_nonzero(right)
            notes.append(f"{message.name}: frames whose checksum is wrong: dropped {wrong}")
            array, time = array[right], time[right]
            if not len(time):
                return []
    return [(bus, Group(message.name, time, columns(message, array), "frame"))]


def _uniquely_named(found: Iterable[tuple[Any, Group]]) -> list[Group]:
    """Groups by the message's name, and the bus's number where one message came on several."""
    found = list(found)
    names = [group.name for _, group in found]
    return [
        Group(f"{g.name}.bus{bus}" if names.count(g.name) > 1 else g.name, g.time, g.columns, g.row)
        for bus, g in found
    ]


def _blf(path: Path, notes: list[str]) -> tuple[Iterator[Any], datetime | None]:
    """Frames at times from the log's start; a log that was not closed has no start."""
    try:
        reader = can.BLFReader(path)
    except (struct.error, BLFParseError):
        raise InputError(f"{path} is damaged or not BLF") from None
    start, reader.start_timestamp = reader.start_timestamp, 0.0  # times of day would cost their digits
    size = path.stat().st_size
    if reader.file_size in (0, FILE_HEADER_SIZE) and size > FILE_HEADER_SIZE:
        notes.append("the log was not closed: read as far as it was written")
    elif size < reader.file_size:
        notes.append(f"the log was cut, {size} of {reader.file_size} bytes are left: read as far as it goes")
    if start:
        notes.append(NO_ZONE)
    return iter(reader), at_ns(round(start * 1000) * 1_000_000) if start else None


def _asc(path: Path, notes: list[str]) -> tuple[Iterator[Any], datetime | None]:
    """Frames at times from the log's start."""
    text = path.read_text(encoding="utf-8", errors="replace")
    head = text[:HEAD]
    if not ASC_DATE.search(head):
        raise InputError(f"{path} is not ASC: no line with its date")
    if ASC_RELATIVE.search(head):
        raise InputError(f"{path}: times since the event before are not read; export with absolute ones")
    if not ASC_END.search(text[-HEAD:]):
        cut = "" if text.endswith("\n") else ", but for its last line, which is cut"
        notes.append(f"the log was not closed: read as far as it was written{cut}")
        text = text[: text.rfind("\n") + 1]
    start = _date(ASC_DATE.findall(head)[-1])
    start = None if start == NEVER else start
    if start:
        notes.append(NO_ZONE)
    return iter(can.ASCReader(io.StringIO(text))), start


def _date(text: str) -> datetime | None:
    """The date of an ASC file's head; None where it cannot be read."""
    for german, english in GERMAN.items():
        text = text.replace(german, english)
    for number, month in enumerate(MONTHS, 1):
        text = text.replace(month, f"{number:02d}")
    for form in ASC_FORMS:
        try:
            return datetime.strptime(text.strip(), form).replace(tzinfo=UTC)
        except ValueError:
            continue
    return None
