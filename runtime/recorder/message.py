"""One message a tick as Protocol Buffers, which other tools plot: every signal a field, its age and status
beside it.

All fields have a fixed width and are always written, so a message has one length, and turning an image into
it is copying bytes to other places: `Places`.  Field numbers come from the signals' value references, which
are never given out twice: value 10·vr, age 10·vr + 1, status 10·vr + 2.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from runtime.image import INPUT, OUTPUT, Layout

PACKAGE = "slewright"
TICK_TOPIC, SNAPSHOT_TOPIC = "/tick", "/snapshot"
TIMING_FIELDS = {  # of an entry's head, int64
    "day_ns": "time of day when the tick was due, by the clock at the start",
    "count": "ticks run so far: 1 more in each message, but where some are missing",
    "clock_ns": "time of day that the clock showed then",
    "deadline_ns": "CLOCK_MONOTONIC when the tick was due",
    "late_ns": "how much later it began",
    "work_ns": "from its beginning until its commands were sent",
    "cpu_ns": "processor time in that",
    "latency_ns": "from the sensor message used last to the commands; -1: none came",
}
HEAD_FIELDS = {"tick": 1, "overruns": 2, "flags": 3}  # of the input image; of the output image 3 more
FIRST_TIMING = 10_001  # above every signal's fields
WIDE, NARROW = 1, 5  # wire types of Protocol Buffers: 8 and 4 bytes, little end first
SFIXED64, SFIXED32, DOUBLE, FIXED32 = "sfixed64", "sfixed32", "double", "fixed32"


@dataclass(frozen=True)
class Field:
    """A field of the message and where its bytes are in an entry: timing, input image, output image."""

    name: str
    number: int
    type: str
    at: int  # first byte in the entry
    size: int  # bytes there; the message has 4 or 8
    unit: str = ""


@cache
def fields() -> tuple[Field, ...]:
    """All fields of `slewright.Tick`, by their number."""
    start = 8 * len(TIMING_FIELDS)
    found = [
        Field(name, FIRST_TIMING + i, SFIXED64, 8 * i, 8, "ns" if name.endswith("_ns") else "")
        for i, name in enumerate(TIMING_FIELDS)
    ]
    found += _image(INPUT, start, "", 0)
    found += _image(OUTPUT, start + INPUT.dtype.itemsize, "output_", len(HEAD_FIELDS))
    return tuple(sorted(found, key=lambda f: f.number))


class Places:
    """Where each byte of an entry goes in the message, and back."""

    def __init__(self, found: tuple[Field, ...], entry_bytes: int) -> None:
        template, to, source = bytearray(), [], []
        for f in found:
            wide = f.type in (SFIXED64, DOUBLE)
            template += _varint(f.number << 3 | (WIDE if wide else NARROW))
            to += range(len(template), len(template) + f.size)
            source += range(f.at, f.at + f.size)
            template += bytes(8 if wide else 4)
        self._template = np.frombuffer(bytes(template), np.uint8)
        self._to, self._source = np.array(to), np.array(source)
        self._constant = np.setdiff1d(np.arange(len(template)), self._to)
        self.entry_bytes = entry_bytes
        self.message_bytes = len(template)

    def message(self, entry: bytes) -> bytes:
        """The message of an entry."""
        found = self._template.copy()
        found[self._to] = np.frombuffer(entry, np.uint8)[self._source]
        return found.tobytes()

    def entry(self, message: bytes) -> bytes | None:
        """The entry of a message; None if the message is not of these fields."""
        given = np.frombuffer(message, np.uint8)
        if len(given) != self.message_bytes or (given != self._template)[self._constant].any():
            return None
        found = np.zeros(self.entry_bytes, np.uint8)
        found[self._source] = given[self._to]
        return found.tobytes()


@cache
def places() -> Places:
    """The one of this layout."""
    return Places(fields(), 8 * len(TIMING_FIELDS) + INPUT.dtype.itemsize + OUTPUT.dtype.itemsize)


def snapshot_message(tick: int, state: bytes) -> bytes:
    """`slewright.Snapshot`: the core's state before `tick`."""
    head = bytes([1 << 3 | WIDE]) + tick.to_bytes(8, "little", signed=True)
    return head + bytes([2 << 3 | 2]) + _varint(len(state)) + state


def snapshot_of(message: bytes) -> tuple[int, bytes]:
    """Tick and state of a `slewright.Snapshot`."""
    at, length, shift = 10, 0, 0
    while True:
        byte = message[at]
        length |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            break
    return int.from_bytes(message[1:9], "little", signed=True), message[at : at + length]


def schema(**more: tuple[Field, ...]) -> bytes:
    """The serialised FileDescriptorSet that MCAP wants of Protocol Buffers, with `more` messages by name."""
    from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet

    whole = FileDescriptorSet()
    file = whole.file.add(name="slewright/tick.proto", package=PACKAGE, syntax="proto3")
    for name, found in {"Tick": fields(), **more}.items():
        message = file.message_type.add(name=name)
        for f in found:
            _declare(message, f.name, f.number, getattr(FieldDescriptorProto, f"TYPE_{f.type.upper()}"))
    snapshot = file.message_type.add(name="Snapshot")
    _declare(snapshot, "tick", 1, FieldDescriptorProto.TYPE_SFIXED64)
    _declare(snapshot, "state", 2, FieldDescriptorProto.TYPE_BYTES)
    return whole.SerializeToString(deterministic=True)


def units() -> dict[str, str]:
    """`unit:NAME` -> unit of every field that has one, as our converter reads it."""
    return {f"unit:{f.name}": f.unit for f in fields() if f.unit}


def _declare(message: Any, name: str, number: int, kind: Any) -> None:
    message.field.add(name=name, json_name=name, number=number, type=kind, label=1)


def _image(layout: Layout, start: int, prefix: str, first: int) -> list[Field]:
    offset = {name: start + entry[1] for name, entry in (layout.dtype.fields or {}).items()}
    types = {"tick": (SFIXED64, 8), "overruns": (SFIXED32, 4), "flags": (FIXED32, 4)}
    found = [
        Field(prefix + name, first + number, *_at(types[name], offset[name]))
        for name, number in HEAD_FIELDS.items()
    ]
    for i, s in enumerate(layout.signals):
        found += [
            Field(s.name, 10 * s.vr, DOUBLE, offset["value"] + 8 * i, 8, s.unit),
            Field(f"{s.name}_age", 10 * s.vr + 1, SFIXED32, offset["age"] + 4 * i, 4),
            Field(f"{s.name}_status", 10 * s.vr + 2, FIXED32, offset["status"] + i, 1),
        ]
    return found


def _at(kind: tuple[str, int], at: int) -> tuple[str, int, int]:
    return kind[0], at, kind[1]


def _varint(number: int) -> bytes:
    found = bytearray()
    while number > 0x7F:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*found, number])
