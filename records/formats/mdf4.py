"""MDF4 (ASAM) by way of asammdf: a channel group for each clock, units, descriptions, start with its zone.

Read are also MDF3 files, unsorted files and files that a logger did not finalise.
"""

import gc
import json
import logging
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from datetime import UTC, datetime
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import numpy as np
from asammdf import MDF, Signal

from records.formats.dbc import Dbc
from records.formats.exact import EXACT, ROUNDED
from records.formats.mdf4_codes import applied, exactly, has_texts, named
from records.formats.mdf4_groups import (
    FRAME,
    bus_event,
    check_places,
    check_stored,
    clock_of,
    in_seconds,
    label_of,
    uncounted,
)
from records.formats.metadata import START, as_json, meta_of
from records.formats.raw import Group, Raw, RawColumn
from records.formats.tables import clocks
from records.formats.units import spelled
from records.measurement import Channel, Measurement
from records.recording import first_line
from specs.errors import InputError, listed

READS = (".mf4", ".mdf", ".dat")
WRITES = (".mf4",)
VERSION = "4.11"
META = "slewright"  # property of the header's comment that holds our metadata
PART = 1 << 15  # samples given to asammdf at once
DEFLATED = 2  # transposed, which suits floats
INTEGERS, FLOAT_BITS = (0, 1, 2, 3), 53  # types of whole numbers; a float holds those of so many bits
UNFINISHED = b"UnFinMF "
logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # what it finds is said here


def read(path: Path, names: Mapping[str, str], dbc: Path | None = None, protocol: str | None = None) -> Raw:
    """Read every channel group that has a time; channels of text are left out."""
    with path.open("rb") as file:
        unfinished = file.read(8) == UNFINISHED
    notes = ["the file was not finalised: read as far as it was written"] if unfinished else []
    database = None if dbc is None else Dbc(dbc, protocol)
    with _silence():
        try:
            return _read(path, unfinished, notes, database)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        except Exception as error:  # noqa: BLE001 - a damaged file makes asammdf raise anything
            reason = first_line(error)
        gc.collect()
    if path.suffix.lower() == ".dat" and not _magic(path):
        raise InputError(f"{path} is not MDF; if it is a table in text, name it .csv")
    state = "not finalised and cannot be recovered" if unfinished else "damaged, cut off or not MDF"
    raise InputError(f"{path} is {state}: {reason}")


def _magic(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(8) in (b"MDF     ", UNFINISHED)


@contextmanager
def _silence() -> Iterator[None]:
    """asammdf prints what it fails at, and fails again when what is left of it is cleared away."""
    before, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        with redirect_stdout(StringIO()):
            yield
    finally:
        sys.unraisablehook = before


def _read(path: Path, unfinished: bool, notes: list[str], database: Any) -> Raw:
    # What asammdf mends of an unfinished file stays in memory; others it reads in parts.  Looking into frames
    # by itself it would read beyond their records.
    options: Any = {"process_bus_logging": False}
    with MDF(BytesIO(path.read_bytes()) if unfinished else path, **options) as file:
        for number, group in enumerate(file.groups):
            check_places(group, label_of(group, number))
            notes += [] if unfinished else uncounted(path, group, label_of(group, number))
        if database is not None:
            from records.formats.mdf4_frames import read_frames

            return read_frames(file, path, database, _start(file, notes), notes)
        groups = list(_groups(file, notes))
        return Raw(groups, _start(file, notes), _meta(file), notes)


def _groups(file: Any, notes: list[str]) -> Iterator[Group]:
    """The channel groups that hold samples over time."""
    for number, group in enumerate(file.groups):
        label, master, kind = label_of(group, number), clock_of(file, number), bus_event(group)
        if not group.channels:
            continue  # bytes of another group's channel
        if not group.channel_group.cycles_nr:
            notes.append(f"{label}: left out, it has no samples")
        elif master is None:
            notes.append(f"{label}: left out, its samples are not over time")
        else:
            check_stored(file, number, label)
            said: list[str] = []
            made = _group(file, number, master, label, said)
            one_by_one = not kind or bool((np.diff(made.time) > 0).all())
            how = "read as they are" if one_by_one else "left out, as some share a time or came late"
            if kind == FRAME:
                notes.append(f"{label}: frames of a CAN bus, {how}; --dbc FILE decodes them")
            elif not one_by_one:
                notes.append(f"{label}: {kind}, {how}")
            if one_by_one:
                notes += said
                yield made


def _group(file: Any, number: int, master: int, label: str, notes: list[str]) -> Group:
    channels = range(len(file.groups[number].channels))
    wanted = [(None, number, index) for index in channels if index != master]
    found = file.select(wanted, ignore_value2text_conversions=True, copy_master=False, validate=False)
    time = found[0].timestamps if found else file.get_master(number)
    time = in_seconds(file, number, master, label, np.asarray(time))
    columns = []
    for signal, (_, _, index) in zip(found, wanted, strict=True):
        rule = file.groups[number].channels[index].conversion
        if has_texts(rule):
            plain = file.select([(None, number, index)], raw=True, copy_master=False, validate=False)[0]
            columns += _with_codes(plain, rule, signal, notes)
        else:
            columns += _columns(_exact(file, number, index, signal, notes), notes)
    short = [c.name for c in columns if len(c.values) != len(time)]
    if short:
        raise ValueError(f"{short[0]} of {label} has not as many samples as times")
    return Group(label, time, columns, "sample")


def _exact(file: Any, number: int, index: int, signal: Any, notes: list[str]) -> Any:
    """A signal whose raw whole numbers a rule made floats, exactly where it can be; else it is said."""
    channel = file.groups[number].channels[index]
    wide = channel.bit_count > FLOAT_BITS and channel.data_type in INTEGERS
    if not wide or np.asarray(signal.samples).dtype.kind != "f":
        return signal
    raw = file.select([(None, number, index)], raw=True, copy_master=False, validate=False)[0].samples
    exact = exactly(channel.conversion, raw)
    if exact is not None:
        signal.samples = exact
    elif len(raw) and max(abs(int(raw.min())), abs(int(raw.max()))) > EXACT:
        notes.append(f"{signal.name}: {ROUNDED}")
    return signal


def _with_codes(plain: Any, rule: Any, signal: Any, notes: list[str]) -> list[RawColumn]:
    """A channel whose rule has texts: codes among numbers are no samples; an enumeration stays numbers."""
    raw = np.asarray(plain.samples)
    if raw.ndim != 1 or raw.dtype.kind not in "fiub":
        return _columns(signal, notes)
    values, coded = applied(rule, raw)
    if coded.any():
        notes.append(f"{signal.name}: {coded.sum()} samples are codes of its conversion, no values")
    kept = named(rule, raw, coded) if spelled(signal.unit or "") not in ("", "1") else {}
    if kept:  # a quantity, no enumeration
        shown = listed([f"'{text}'" for text in kept], 3)
        notes.append(
            f"{signal.name}: numbers that its conversion names are kept as values, {sum(kept.values())} "
            f"times: {shown}"
        )
    invalid = signal.invalidation_bits
    broken = coded if invalid is None else coded | np.asarray(invalid, dtype=bool)
    return [RawColumn(signal.name, signal.unit or "", values, _text(signal.comment), None, broken)]


def _columns(signal: Any, notes: list[str]) -> list[RawColumn]:
    """The channel as numbers, in a list; an empty one for text and arrays."""
    held = np.asarray(signal.samples)
    if held.ndim != 1 or held.dtype.kind not in "fiub":
        notes.append(f"{signal.name}: left out, it holds no numbers")
        return []
    kinds = {"f": np.float64, "i": np.int64, "u": np.uint64 if held.dtype.itemsize == 8 else np.int64}
    held = held.astype(kinds.get(held.dtype.kind, held.dtype), copy=False)
    broken = signal.invalidation_bits
    broken = None if broken is None else np.asarray(broken, dtype=bool)
    return [RawColumn(signal.name, signal.unit or "", held, _text(signal.comment), None, broken)]


def _text(comment: str) -> str:
    """A comment's text, where it is XML."""
    if not (comment or "").startswith("<"):
        return comment or ""
    try:
        return ElementTree.fromstring(comment).findtext(".//TX") or ""
    except ElementTree.ParseError:
        return ""


def _start(file: Any, notes: list[str]) -> datetime | None:
    """The header's start; 1970 is none."""
    start = file.start_time
    if start.timestamp() == 0:
        return None
    if start.tzinfo is None:
        notes.append("the start states no time zone: taken as UTC")
        return start.replace(tzinfo=UTC)
    return start


def _meta(file: Any) -> dict[str, Any]:
    """Our own metadata, where we wrote the file."""
    try:
        for entry in ElementTree.fromstring(file.header.comment).iter("e"):
            if entry.get("name") == META:
                return json.loads(entry.text or "{}")
    except (ElementTree.ParseError, ValueError, TypeError, AttributeError):
        pass
    return {}


def write(measurement: Measurement, path: Path) -> list[str]:
    """Write a channel group for each clock; returns what MDF4 does not keep."""
    if measurement.start and measurement.start.timestamp() < 0:
        raise InputError(f"{path}: MDF4 holds no start before 1970")
    meta = meta_of(measurement)
    meta.pop(START, None)
    with MDF(version=VERSION) as file:
        file.start_time = measurement.start or datetime.fromtimestamp(0, UTC)
        file.header.comment = (
            f"<HDcomment><TX/><common_properties><e name='{META}'>{escape(as_json(meta))}</e>"
            "</common_properties></HDcomment>"
        )
        for number, (time, channels) in enumerate(clocks(measurement.channels.values())):
            if len(time):
                _append(file, number, time, channels)
        file.save(path, overwrite=True, compression=DEFLATED)
    flags = any(c.values.dtype.kind == "b" for c in measurement.channels.values())
    return ["types: flags become whole numbers"] if flags else []


def _append(file: Any, number: int, time: np.ndarray, channels: Sequence[Channel]) -> None:
    """Add the group of a clock, in parts: asammdf makes several copies of what it is given."""
    part = slice(0, PART)
    signals = [
        Signal(_held(c, part), time[part], unit=c.unit, name=c.name, comment=c.description) for c in channels
    ]
    file.append(signals, acq_name=f"clock {number + 1}", common_timebase=True)
    for first in range(PART, len(time), PART):
        part = slice(first, first + PART)
        file.extend(len(file.groups) - 1, [(time[part], None), *((_held(c, part), None) for c in channels)])


def _held(channel: Channel, part: slice) -> np.ndarray:
    held = channel.values[part]
    return held.astype(np.uint8) if held.dtype == bool else held
