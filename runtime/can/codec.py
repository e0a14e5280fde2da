"""Frames to values and back, by the tables of `specs/signals.toml`.

Raw numbers of a field, as in J1939 (specs/wire.py): up to the top of its range a value; above, by the highest
byte of fields of 8, 16 and 32 bits, reserved (0xFB to 0xFD), error (0xFE) and not available (0xFF); in other
fields the last number but one is error and the last not available.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

from runtime.image import TICK_S, Status
from specs.e2e import COUNTER_BITS, LAST_COUNT, TABLE, start
from specs.signals import Signal, definition
from specs.wire import CanPlace, Message

WORD_BITS = (8, 16, 32)


@dataclass(frozen=True)
class Field:
    """One signal's place in its frame, with what decoding needs worked out."""

    signal: Signal
    place: CanPlace

    @property
    def name(self) -> str:
        """The signal's name."""
        return self.signal.name

    @cached_property
    def top(self) -> int:
        """All bits set."""
        return (1 << self.place.length) - 1

    @cached_property
    def largest(self) -> int:
        """The largest raw number that is a value."""
        return self.place.raw_limits[1]

    @cached_property
    def error(self) -> int:
        """The smallest raw number that says error."""
        return 0xFE << (self.place.length - 8) if self.place.length in WORD_BITS else self.top - 1

    @cached_property
    def absent(self) -> int:
        """The smallest raw number that says not available."""
        return 0xFF << (self.place.length - 8) if self.place.length in WORD_BITS else self.top

    @cached_property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value that the signal has, half a step aside for rounding."""
        low, high = self.signal.min, self.signal.max
        assert low is not None  # noqa: S101  (specs: a signal on CAN has its range)
        assert high is not None  # noqa: S101
        return low - 0.5 * self.place.scale, high + 0.5 * self.place.scale

    def value(self, raw: int) -> tuple[float, Status]:
        """Value in SI and what is known of it; of error and not available the value is 0."""
        if raw > self.largest:
            if raw >= self.absent:
                return 0.0, Status.NOT_AVAILABLE
            return 0.0, Status.ERROR if raw >= self.error else Status.RANGE
        value = raw * self.place.scale + self.place.offset
        low, high = self.limits
        return value, Status.OK if low <= value <= high else Status.RANGE

    def raw(self, value: float) -> int:
        """Raw number of a value; error if the value is no number or outside the signal's range."""
        low, high = self.limits
        if not isfinite(value) or not low <= value <= high:
            return self.error
        return round((value - self.place.offset) / self.place.scale)


@dataclass(frozen=True)
class Codec:
    """One message: its fields in the order of the specs, and the start of its checksum."""

    message: Message
    fields: tuple[Field, ...]

    @cached_property
    def cycle_ticks(self) -> int:
        """Ticks between two frames."""
        return max(1, round(self.message.cycle_ms / 1000 / TICK_S))

    @cached_property
    def begun(self) -> int:
        """The checksum over the data ID."""
        return start(self.message.data_id or 0)

    @cached_property
    def _unpacking(self) -> list[tuple[int, int, Field]]:
        return [(f.place.start, f.top, f) for f in self.fields]

    def unpack(self, data: bytes) -> list[tuple[float, Status]]:
        """Values and status of all fields of a frame of the right length."""
        bits = int.from_bytes(data, "little")
        return [f.value(bits >> first & mask) for first, mask, f in self._unpacking]

    def pack(self, values: Sequence[float], count: int) -> bytes:
        """A frame of the values [SI] of all fields, with counter and checksum; what no field has is 1."""
        bits = (1 << 8 * self.message.length) - 1
        for (first, mask, field), value in zip(self._unpacking, values, strict=True):
            bits ^= (mask ^ field.raw(value)) << first
        bits ^= (0xF ^ count) << COUNTER_BITS.start
        data = bytearray(bits.to_bytes(self.message.length, "little"))
        data[0] = self.checksum(data)
        return bytes(data)

    def checksum(self, data: bytes | bytearray) -> int:
        """What byte 0 must be."""
        table, value = TABLE, self.begun
        for byte in data[1:]:
            value = table[value ^ byte]
        return value

    def count(self, data: bytes) -> int | None:
        """The counter of a frame; None if length, checksum or counter are wrong."""
        if len(data) != self.message.length or data[0] != self.checksum(data):
            return None
        count = data[1] & 0x0F
        return count if count <= LAST_COUNT else None


def codecs() -> dict[str, Codec]:
    """The codecs of all messages, by name."""
    spec = definition()
    places = [(s, s.can) for s in spec.signals.values() if s.can]
    return {
        name: Codec(message, tuple(Field(s, p) for s, p in places if p.message == name))
        for name, message in spec.bus.messages.items()
    }


def sent_by(node: str) -> list[Codec]:
    """The messages that a node sends, the most urgent first."""
    found = [c for c in codecs().values() if c.message.sender == node]
    return sorted(found, key=lambda c: c.message.frame_id)


def received_by(node: str) -> list[Codec]:
    """The messages that are for a node."""
    return [c for c in codecs().values() if node in c.message.receivers]
