"""CAN logs, BLF and ASC (Vector), decoded and encoded by a DBC; each message's signals share its times."""

import io
import logging
import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal
from pathlib import Path
from typing import Any

import can
import numpy as np
from can.io.blf import FILE_HEADER_SIZE, BLFParseError

from records.formats import blf_objects
from records.formats.asc import AscLog, read_asc
from records.formats.can_write import NEVER, write
from records.formats.dbc import Dbc, checksums, columns, data_id, fields, unstated
from records.formats.metadata import at_ns
from records.formats.raw import Group, Raw
from records.recording import first_line
from specs.errors import InputError

__all__ = ["read", "write"]

READS = (".blf", ".asc", ".log", ".candump", ".trc")
WRITES = (".blf", ".asc")
CANDUMP = re.compile(
    r"^\s*\((?P<time>\d+\.\d+)\)\s+(?P<bus>\S+)\s+(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#[0-9A-Fa-f])?(?P<remote>R\d?)?"
    r"(?P<data>(?:[0-9A-Fa-f]{2}\.?)*)(?P<length>)(?:\s+[RT])?\s*$"
)
CANDUMP_SHOWN = re.compile(
    r"^\s*\((?P<time>\d+\.\d+)\)\s+(?P<bus>\S+)\s+(?:[RT]X\s+\S+\s+\S+\s+)?(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(?P<length>\d+)\]"
    r"\s*(?P<remote>remote request)?(?P<data>(?:\s*[0-9A-Fa-f]{2})*)\s*(?:'.*)?$"
)
NO_ZONE = "the start states no time zone: taken as UTC"


@dataclass
class Frames:
    """Frames of one identifier on one bus, in the order of the log."""

    times: list[float] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)


def read(path: Path, names: Mapping[str, str], dbc: Path, protocol: str | None = None) -> Raw:
    """Decode what the DBC knows; raises InputError where that is nothing."""
    database, notes = Dbc(dbc, protocol), list[str]()
    kind, objects = path.suffix.lower(), Counter[int]()
    with _warnings_into(notes):
        if kind == ".blf":
            objects = blf_objects.count(path)
            messages, start = _blf(path, notes)
        elif kind == ".asc":
            log = AscLog()
            named = {m.name: (m.frame_id, m.is_extended_frame) for m in database.messages}
            messages = read_asc(path, named, log)
            start = log.start
            notes += log.notes
            start = None if start == NEVER else start
            notes += [NO_ZONE] if start else []
        else:
            messages, start = _zeroed(_trc(path, notes) if kind == ".trc" else _candump(path, notes))
        counted = Counter[str]()
        found = _collect(messages, path, notes, counted)
    if kind == ".blf":
        _compare(objects, counted, notes)
    return decoded(found, database, path, start, notes)


def _compare(objects: Counter[int], counted: Counter[str], notes: list[str]) -> None:
    """Say what a BLF file holds that did not come as frames."""
    there = sum(objects[k] for k in (*blf_objects.DATA, *blf_objects.ERRORS))
    came = sum(counted.values())
    if there != came and not any("read up to there" in n or "as far as" in n for n in notes):
        notes.append(f"the log holds {there} frames, of which {came} could be read")
    others = sum(n for k, n in objects.items() if k not in (*blf_objects.DATA, *blf_objects.ERRORS))
    if others:
        notes.append(f"objects that are no CAN frames: left out {others}")
    if counted["remote"] or counted["error"]:
        notes.append(
            f"frames without data: left out {counted['error']} error frames and {counted['remote']} "
            f"remote frames"
        )


def decoded(
    found: dict[tuple, Frames], database: Dbc, path: Path, start: datetime | None, notes: list[str]
) -> Raw:
    """The channels of frames; raises InputError where the database knows none of them."""
    dbc = database.path
    groups, unknown = [], {}
    for (bus, identifier, extended), frames in found.items():
        message = database.message(identifier, extended)
        if message is None:
            unknown[identifier] = len(frames.times)
        else:
            groups += _group(message, bus, frames, notes, path)
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


def _collect(
    messages: Iterator[Any], path: Path, notes: list[str], counted: Counter[str]
) -> dict[tuple, Frames]:
    """Data frames by bus and identifier; a log that breaks off is read up to there."""
    found: dict[tuple, Frames] = {}
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
        counted["error" if message.is_error_frame else "remote" if message.is_remote_frame else "data"] += 1
        if message.is_error_frame or message.is_remote_frame:
            continue
        last = message.timestamp
        key = (message.channel, message.arbitration_id, message.is_extended_id)
        frames = found.setdefault(key, Frames())
        frames.times.append(last)
        frames.data.append(bytes(message.data))


def _group(message: Any, bus: Any, frames: Frames, notes: list[str], path: Path) -> list[tuple[Any, Group]]:
    """The message's signals, in a list; of a short frame those that are whole in it."""
    if not message.length:
        return []
    sizes = np.array([len(data) for data in frames.data])
    short = int((sizes < message.length).sum())
    long = int((sizes > message.length).sum())
    if short:
        notes.append(
            f"{message.name}: frames shorter than {message.length} bytes: {short}; signals that they do "
            f"not hold are absent"
        )
    if long:
        notes.append(
            f"{message.name}: frames longer than {message.length} bytes: {long}; the rest is not in the DBC"
        )
    data = b"".join(d[: message.length].ljust(message.length, b"\0") for d in frames.data)
    array = np.frombuffer(data, dtype=np.uint8).reshape(len(frames.data), message.length)
    time = np.array(frames.times, dtype=np.float64)
    lengths = sizes if short else None
    _check_protocol(message, array, lengths, time, path)
    identifier = data_id(message)
    if identifier is not None:
        right = checksums(array, identifier) == array[:, 0]
        if not right.all():
            wrong = len(right) - np.count_nonzero(right)
            notes.append(f"{message.name}: frames whose checksum is wrong: dropped {wrong}")
            array, time = array[right], time[right]
            lengths = None if lengths is None else lengths[right]
            if not len(time):
                return []
    return [(bus, Group(message.name, time, columns(message, array, lengths), "frame"))]


def _check_protocol(
    message: Any, array: np.ndarray, lengths: np.ndarray | None, time: np.ndarray, path: Path
) -> None:
    """Refuse fields with all bits set where it is not stated whether that is a value."""
    if not unstated(message):
        return
    for one, column in zip(fields(message), columns(message, array, lengths), strict=False):
        if one.signal.is_signed or one.signal.is_float or one.signal.length < 8:
            continue
        bits = np.unpackbits(array, axis=1, bitorder="little")
        full = (one.raw(bits) == one.not_available) & (True if lengths is None else lengths > one.last_byte)
        if column.absent is not None and column.name == one.signal.name:
            full &= ~column.absent
        if column.broken is not None and column.name == one.signal.name:
            full &= ~column.broken
        if full.any():
            at = time[np.flatnonzero(full)[0]]
            raise InputError(
                f"{path}: {message.name}.{one.signal.name} has all bits set at {at:.9g} s: in J1939 that "
                f"is no value, "
                "and the DBC states no protocol; --protocol j1939 or --protocol can says it"
            )


def _uniquely_named(found: Iterable[tuple[Any, Group]]) -> list[Group]:
    """Groups by the message's name, and the bus's number where one message came on several."""
    found = list(found)
    names = Counter(group.name for _, group in found)
    return [
        Group(f"{g.name}.bus{bus}" if names[g.name] > 1 else g.name, g.time, g.columns, g.row)
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


def _trc(path: Path, notes: list[str]) -> Iterator[Any]:
    """Frames of PEAK's PCAN-View; its lines are counted beside its frames."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        found = list(can.TRCReader(io.StringIO("\n".join([*lines, ""]))))
    except Exception as error:  # noqa: BLE001 - a damaged log makes python-can raise anything
        raise InputError(f"{path} is damaged or no PCAN trace: {first_line(error)}") from None
    rows = sum(bool(line.strip()) and not line.startswith(";") for line in lines)
    if rows != len(found):
        notes.append(f"the trace has {rows} lines, of which {len(found)} were read as frames")
    for message in found:
        message.timestamp = round(Decimal(message.timestamp), 6)  # type: ignore[assignment]  # its resolution
    return iter(found)


def _candump(path: Path, notes: list[str]) -> Iterator[Any]:
    """Frames of candump: `-l` (`(time) can0 100#0011`), `-t a` (`(time) can0 100 [2] 00 11`),
    without brackets.
    """
    found, unread, first = [], 0, ""
    last: dict[str, int] = {}
    text = path.read_text(encoding="utf-8", errors="replace")
    whole = text.split("\n")
    if whole.pop().strip():
        notes.append("the log was not closed: its last line is left out")
    for number, line in enumerate(whole, 1):
        if not line.strip():
            continue
        match = CANDUMP.match(line) or CANDUMP_SHOWN.match(line)
        if match is None:
            unread, first = unread + 1, first or f"line {number} ('{line.strip()[:50]}')"
            continue
        if match["remote"] or (int(match["id"], 16) & 0x2000_0000 and len(match["id"]) == 8):
            notes.append(f"line {number}: a remote or error frame: left out") if len(notes) < 20 else None
            continue
        data = bytes.fromhex(match["data"].replace(" ", "").replace(".", ""))
        if match["length"] and int(match["length"]) != len(data):
            unread, first = unread + 1, first or f"line {number} ('{line.strip()[:50]}')"
            continue
        bus = last.setdefault(match["bus"], len(last))
        found.append(
            can.Message(
                timestamp=Decimal(match["time"]),  # type: ignore[arg-type]
                arbitration_id=int(match["id"], 16) & 0x1FFF_FFFF,
                is_extended_id=len(match["id"]) > 3, data=data, channel=bus, is_fd=len(data) > 8, check=False,
            )
        )  # fmt: skip
    if unread:
        notes.append(f"lines that are not understood: left out {unread}; the first: {first}")
    if not found:
        raise InputError(
            f"{path} is no log of candump: none of its lines is a frame; the first: {whole[0][:50]!r}"
        )
    return iter(found)


def _zeroed(messages: Iterator[Any]) -> tuple[Iterator[Any], datetime | None]:
    """Frames with times from the first one's, exactly; the time of day then if they count from 1970."""
    held = list(messages)
    first = held[0].timestamp if held else Decimal(0)
    for message in held:
        message.timestamp = float(message.timestamp - first)
    return iter(held), at_ns(int(first * 10**9)) if first > 10**8 else None
