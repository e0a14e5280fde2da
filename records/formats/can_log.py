"""CAN logs (BLF, ASC, candump, PCAN traces) and a DBC: the signals of a message share its times."""

import logging
import struct
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import can
from can.io.blf import FILE_HEADER_SIZE, BLFParseError

from records.formats import blf_objects
from records.formats.asc import AscLog, read_asc
from records.formats.can_frames import NO_ZONE, FrameLog, Frames, decoded
from records.formats.can_write import NEVER, write
from records.formats.candump import read_candump, read_trc
from records.formats.dbc import Dbc
from records.formats.metadata import at_ns
from records.formats.raw import Raw
from records.recording import first_line
from specs.errors import InputError

__all__ = ["read", "write"]

READS = (".blf", ".asc", ".log", ".candump", ".trc")
WRITES = (".blf", ".asc")


@dataclass
class BlfLog(FrameLog):
    """What a BLF file says of itself, and the objects in it, counted by themselves."""

    objects: Counter[int] = field(default_factory=Counter)
    stated: int = 0  # objects that its head says there are; 0 in a log that was not closed
    breaks_off: bool = False


def read(path: Path, names: Mapping[str, str], dbc: Path, protocol: str | None = None) -> Raw:
    """Decode what the DBC knows; raises InputError where that is nothing."""
    database, said = Dbc(dbc, protocol), list[str]()
    counted = Counter[str]()
    log = {".asc": AscLog, ".blf": BlfLog}.get(path.suffix.lower(), FrameLog)()
    with _warnings_into(said):
        found = _collect(_messages(path, database, log), path, said, counted)
    if isinstance(log, BlfLog):
        _compare(log, counted, any("read up to there" in s for s in said))
    start = None if log.start == NEVER else log.start
    zone = [NO_ZONE] if start and isinstance(log, AscLog | BlfLog) else []
    return decoded(found, database, path, start, [*log.notes, *zone, *said])


def _messages(path: Path, database: Dbc, log: FrameLog) -> Iterator[Any]:
    """The frames of a log one by one; `log` is complete behind the last one."""
    if isinstance(log, BlfLog):
        return _blf(path, log)
    if isinstance(log, AscLog):
        return read_asc(path, {m.name: (m.frame_id, m.is_extended_frame) for m in database.messages}, log)
    return read_trc(path, log) if path.suffix.lower() == ".trc" else read_candump(path, log)


def _compare(log: BlfLog, counted: Counter[str], broken: bool) -> None:
    """Say what a BLF file holds, or says it holds, that did not come as frames."""
    objects, frames = log.objects, (*blf_objects.DATA, *blf_objects.ERRORS)
    there, came = sum(objects[k] for k in frames), sum(counted.values())
    if there != came and not broken and not log.breaks_off:
        log.notes.append(f"the log holds {there} frames, of which {came} could be read")
    whole = objects.total() - objects[blf_objects.CONTAINER]
    if log.stated not in (0, whole, objects.total()):  # some writers count the containers, too
        log.notes.append(f"the log's head states {log.stated} objects, {whole} are there")
    others = sum(n for k, n in objects.items() if k not in (*frames, blf_objects.CONTAINER))
    if others:
        log.notes.append(f"objects that are no CAN frames: left out {others}")
    if counted["remote"] or counted["error"]:
        log.notes.append(
            f"frames without data: left out {counted['error']} error frames and {counted['remote']} remote "
            "frames"
        )


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
        found.setdefault(key, Frames()).add(last, message.data)


def _blf(path: Path, log: BlfLog) -> Iterator[Any]:
    """Frames at times from the log's start; a log that was not closed has no start."""
    log.objects = blf_objects.count(path)  # refuses objects of no size, at which python-can does not end
    try:
        reader = can.BLFReader(path)
    except (struct.error, BLFParseError, ValueError, OverflowError):
        raise InputError(f"{path} is damaged or not BLF") from None
    start, reader.start_timestamp = reader.start_timestamp, 0.0  # times of day would cost their digits
    size, log.stated = path.stat().st_size, reader.object_count
    if reader.file_size in (0, FILE_HEADER_SIZE) and size > FILE_HEADER_SIZE:
        log.notes.append("the log was not closed: read as far as it was written")
    elif size < reader.file_size:
        log.notes.append(
            f"the log was cut, {size} of {reader.file_size} bytes are left: read as far as it goes"
        )
    log.breaks_off = bool(log.notes)
    log.start = at_ns(round(start * 1000) * 1_000_000) if start else None
    return iter(reader)
