"""Writes CAN logs: channels by a DBC into frames at the times of their samples.

A frame goes out whenever a signal of its message has a sample.  In J1939 the others that have none at that
time are not available in it; elsewhere they are held, before their first sample at their start value.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import can
import numpy as np

from records.formats.dbc import Dbc, Field, data_id, fields, is_j1939, protect
from records.formats.tables import clocks, finer
from records.formats.units import converted, spelled
from records.measurement import Channel, Measurement
from specs.errors import InputError, listed

NEVER = datetime(1970, 1, 1, tzinfo=UTC)  # the date of a log without one
BUS = 1  # number of the bus in the log
DAYS = ["Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun"]
MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"]
RESOLUTION = {".blf": 1e-9, ".asc": 1e-6}  # s


@dataclass(frozen=True)
class _Sent:
    """Frames of one message: times [n], data [n, bytes]."""

    message: Any
    times: np.ndarray
    data: np.ndarray


def write(measurement: Measurement, path: Path, dbc: Path) -> list[str]:
    """Write what the DBC has a place for; returns what the log does not keep.

    Raises InputError for a value that its field cannot hold, naming channel and time, and where nothing fits.
    """
    database, lost = Dbc(dbc), list[str]()
    places = {f.signal.name for m in database.messages for f in fields(m)}
    left = [name for name in measurement.channels if name not in places]
    if len(left) == len(measurement.channels):
        raise InputError(f"{measurement.source or 'the recording'} has no channel that {dbc.name} has")
    if left:
        lost.append(f"channels without a place in {dbc.name}: {listed(left, 8)}")
    sent = [frames for m in database.messages if (frames := _frames(m, measurement, lost)) is not None]
    form = path.suffix.lower()
    start = _start(measurement.start, lost)
    (_write_blf if form == ".blf" else _write_asc)(path, _in_order(sent), start)
    lost.append("values: rounded to the steps of the DBC")
    if finer((frames.times for frames in sent), RESOLUTION[form]):
        lost.append(f"times: rounded to {RESOLUTION[form]:g} s")
    if measurement.meta:
        lost.append("metadata")
    return lost


def _start(start: datetime | None, lost: list[str]) -> datetime | None:
    """The start in UTC to a millisecond, as the logs hold it."""
    if start is None:
        return None
    utc = start.astimezone(UTC)
    if start.utcoffset():
        lost.append("the start's time zone: written in UTC")
    if utc.microsecond % 1000:
        lost.append("start: cut to 1 ms")
    return utc.replace(microsecond=utc.microsecond // 1000 * 1000)


def _frames(message: Any, measurement: Measurement, lost: list[str]) -> _Sent | None:
    """The message's frames; None where none of its signals is there."""
    known = {f.signal.name: f for f in fields(message)}
    there = [measurement[n] for n in known if n in measurement and len(measurement[n].time)]
    if not there:
        return None
    if message.is_multiplexed():
        lost.append(f"channels of {message.name}: multiplexed messages are not written")
        return None
    groups = clocks(there)
    times = groups[0][0] if len(groups) == 1 else np.unique(np.concatenate([t for t, _ in groups]))
    bits = np.zeros((len(times), 8 * message.length), dtype=np.uint8)
    if is_j1939(message):
        bits[:] = 1  # not available
    for name, one in known.items():
        channel = measurement.channels.get(name)
        one.put(bits, _raw(one, channel, times, measurement.source))
    if not is_j1939(message):
        _say_what_is_made_up(message, known, there, len(groups), lost)
    data, identifier = np.packbits(bits, axis=1, bitorder="little"), data_id(message)
    return _Sent(message, times, data if identifier is None else protect(data, identifier))


def _say_what_is_made_up(
    message: Any, known: Iterable[str], there: list[Channel], clocks_there: int, lost: list[str]
) -> None:
    names = {c.name for c in there}
    missing = [name for name in known if name not in names]
    if missing:
        lost.append(f"{message.name}: start values stand for {listed(missing, 8)}, which is not recorded")
    if clocks_there > 1:
        lost.append(f"{message.name}: its signals get each other's times, values held")


def _raw(one: Field, channel: Channel | None, times: np.ndarray, source: str) -> np.ndarray:
    """Raw numbers [n] of a signal at the times of its message."""
    if channel is None or not len(channel.time):
        return np.full(len(times), one.not_available if one.j1939 else _initial(one), dtype=np.uint64)
    if one.j1939 and one.reserved:
        raw = np.full(len(times), one.not_available, dtype=np.uint64)
        raw[np.searchsorted(times, channel.time)] = _encoded(one, channel, source)
        return raw
    index = np.searchsorted(channel.time, times, side="right") - 1
    held = _encoded(one, channel, source)[np.maximum(index, 0)]
    return np.where(index >= 0, held, np.uint64(_initial(one)))


def _initial(one: Field) -> int:
    """The start value the DBC states as a raw number, else 0."""
    return int(one.signal.raw_initial or 0) & one.not_available


def _encoded(one: Field, channel: Channel, source: str) -> np.ndarray:
    where = f"{source or 'the recording'}: channel {channel.name}"
    unit = spelled(one.signal.unit or "") or channel.unit
    values = converted(channel.values, channel.unit or unit, unit, where)
    raw, bad = one.encoded(values)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        low, high = (one.place.offset + one.place.scale * limit for limit in one.limits)
        raise InputError(
            f"{where} is {values[first]:.6g} at {channel.time[first]:.9g} s; "
            f"its place on CAN holds {low:g} to {high:g}"
        )
    return raw


def _in_order(sent: list[_Sent]) -> Iterator[tuple[float, Any, bytes]]:
    """All frames by time; those of one time in the order of the DBC."""
    times = np.concatenate([s.times for s in sent])
    owner = np.repeat(np.arange(len(sent)), [len(s.times) for s in sent])
    row = np.concatenate([np.arange(len(s.times)) for s in sent])
    order = np.argsort(times, kind="stable")
    data = [s.data.tobytes() for s in sent]
    for time, i, k in zip(times[order].tolist(), owner[order].tolist(), row[order].tolist(), strict=True):
        length = sent[i].message.length
        yield time, sent[i].message, data[i][k * length : (k + 1) * length]


def _write_blf(path: Path, frames: Iterable[tuple[float, Any, bytes]], start: datetime | None) -> None:
    with can.BLFWriter(path, channel=BUS) as writer:
        writer.start_timestamp, last = 0.0, 0.0  # times of day would cost the frames their digits
        for time, message, data in frames:
            last = time
            stamp = (round(1e9 * time) + 0.5) / 1e9  # the writer cuts instead of rounding
            writer.on_message_received(
                can.Message(
                    timestamp=stamp,
                    arbitration_id=message.frame_id,
                    is_extended_id=message.is_extended_frame,
                    is_fd=len(data) > 8,
                    data=data,
                )
            )
        zero = start.timestamp() if start else 0.0
        writer.start_timestamp, writer.stop_timestamp = zero, zero + last


def _write_asc(path: Path, frames: Iterable[tuple[float, Any, bytes]], start: datetime | None) -> None:
    """The text as CANoe writes it; python-can's writer would state the time of writing as the start."""
    zero = start or NEVER
    date = (
        f"{DAYS[zero.weekday()]} {MONTHS[zero.month - 1]} {zero.day:02d} {zero:%H:%M:%S}."
        f"{zero.microsecond // 1000:03d} {zero.year}"
    )
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n")
        file.write(f"Begin Triggerblock {date}\n   0.000000 Start of measurement\n")
        for time, message, data in frames:
            identifier = f"{message.frame_id:X}" + "x" * message.is_extended_frame
            line = f"{BUS}  {identifier:<15} Rx   d {len(data):x} {data.hex(' ').upper()}"
            file.write(f"{time:11.6f} {line}\n")
        file.write("End TriggerBlock\n")
