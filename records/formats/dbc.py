"""A DBC's messages over many frames at once: bits to values and back, with J1939's reserved numbers.

In J1939 the top of an unsigned field is no value: error, and above it not available (specs/wire.py).  What is
not available has no sample in that frame; so channels of other rates can share a message.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cantools
import numpy as np
from cantools.database.errors import Error

from records.formats.codes import means_no_value, of_states
from records.formats.encoding import Damaged, decoded
from records.formats.exact import scaled
from records.formats.raw import RawColumn
from records.recording import first_line
from specs import e2e
from specs.dbc import PROFILE
from specs.errors import InputError
from specs.wire import CanPlace

GROUP_MASK = 0x3FFFF  # parameter group, data page and reserved bit of a 29-bit identifier
PROTECTING = ("MessageCounter", "MessageChecksum")
PDU1 = 0xF000  # groups below it hold a destination in their low byte


@dataclass(frozen=True)
class Field:
    """One signal of a message as cantools describes it; `j1939` where the reserved numbers apply."""

    signal: Any
    j1939: bool

    @cached_property
    def place(self) -> CanPlace:
        """Its bits, in this project's terms."""
        s = self.signal
        return CanPlace(
            message="", start=s.start, length=s.length, byte_order=s.byte_order, signed=s.is_signed,
            scale=float(s.scale), offset=float(s.offset),
        )  # fmt: skip

    @property
    def reserved(self) -> bool:
        """Whether the top of the field is no value."""
        return (
            self.j1939 and not self.signal.is_signed and not self.signal.is_float and self.signal.length > 1
        )

    @property
    def limits(self) -> tuple[int, int]:
        """Smallest and largest raw number that is a value."""
        if self.reserved or self.signal.is_signed:
            return self.place.raw_limits
        return 0, (1 << self.signal.length) - 1

    @property
    def not_available(self) -> int:
        """All bits set."""
        return (1 << self.signal.length) - 1

    @property
    def codes(self) -> list[int]:
        """Raw numbers that the value table calls no value; one bit has no room for any."""
        labels = {int(n): str(t) for n, t in (self.signal.choices or {}).items()}
        if self.signal.length == 1:
            return []
        top = (self.not_available >> self.signal.is_signed) - 1
        some = len(labels) <= self.not_available  # an enumeration of all numbers has *error* as a state
        states = of_states(labels.values())
        return [n for n, t in labels.items() if t not in states and means_no_value(t, some and n >= top)]

    @property
    def last_byte(self) -> int:
        """The last byte of the frame in which it has a bit."""
        return int(self.bits.max()) // 8

    @property
    def bits(self) -> np.ndarray:
        """Its bits in the frame, that of value 1 first; bit 8 i + k is bit k (of value 2^k) of byte i."""
        start, length = self.signal.start, self.signal.length
        if self.signal.byte_order == "little_endian":
            return np.arange(start, start + length)
        sent = 8 * (start // 8) + 7 - start % 8 + np.arange(length)  # counted as they are sent
        return (8 * (sent // 8) + 7 - sent % 8)[::-1]

    def raw(self, bits: np.ndarray) -> np.ndarray:
        """Raw numbers [n, uint64] of frames as bits [n, 8 bytes]."""
        weights = np.uint64(1) << np.arange(self.signal.length, dtype=np.uint64)
        return (bits[:, self.bits].astype(np.uint64) * weights).sum(axis=1, dtype=np.uint64)

    def put(self, bits: np.ndarray, raw: np.ndarray) -> None:
        """Set the field in frames as bits [n, 8 bytes] to raw numbers [n, uint64]."""
        shifts = np.arange(self.signal.length, dtype=np.uint64)
        bits[:, self.bits] = (raw[:, None] >> shifts) & np.uint64(1)

    def column(self, bits: np.ndarray, there: np.ndarray) -> RawColumn:
        """The signal's samples; `there` [n] marks the frames that carry it."""
        raw, absent, broken = self.raw(bits), ~there, None
        if self.reserved:
            absent |= raw == self.not_available
            broken = (raw > self.limits[1]) & ~absent
        if codes := self.codes:
            coded = self._is_one_of(raw, codes) & ~absent
            broken = coded if broken is None else broken | coded
        absent = absent if absent.any() else None
        comment = self.signal.comment if isinstance(self.signal.comment, str) else ""
        return RawColumn(self.signal.name, self.signal.unit or "", self._values(raw), comment, absent, broken)

    def _is_one_of(self, raw: np.ndarray, codes: list[int]) -> np.ndarray:
        """Whether raw numbers [n, uint64] are codes: of a float its number, else its bits."""
        if self.signal.is_float:
            return np.isin(self._floats(raw), np.array(codes, dtype=np.float64))
        return np.isin(raw, np.array([n & self.not_available for n in codes], dtype=np.uint64))

    def _floats(self, raw: np.ndarray) -> np.ndarray:
        kinds = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}
        bits, kind = kinds[self.signal.length]
        return raw.astype(bits).view(kind).astype(np.float64)

    def _values(self, raw: np.ndarray) -> np.ndarray:
        s = self.signal
        if s.is_float:
            number = self._floats(raw)
        elif s.is_signed:
            number = (raw << np.uint64(64 - s.length)).view(np.int64) >> np.int64(64 - s.length)
        else:
            number = raw if s.length > 63 else raw.astype(np.int64)
        if self.place.scale == 1 and self.place.offset == 0 and not s.is_float:
            return number
        if self.is_wide and (exact := scaled(number, self.place.scale, self.place.offset)) is not None:
            return exact
        return number.astype(np.float64) * self.place.scale + self.place.offset

    @property
    def is_wide(self) -> bool:
        """Whether it has numbers that floats round."""
        return self.signal.length > 53 and not self.signal.is_float

    def encoded(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Raw numbers [n, uint64] of values in the DBC's unit, and which of them the field cannot hold."""
        number = (np.asarray(values, dtype=np.float64) - self.place.offset) / self.place.scale
        if self.signal.is_float:
            kind = {16: np.float16, 32: np.float32, 64: np.float64}[self.signal.length]
            raw = number.astype(kind).view(f"u{self.signal.length // 8}").astype(np.uint64)
            return raw, ~np.isfinite(number.astype(kind))
        low, high = self.limits
        whole = np.round(number)
        bad = ~((whole >= low) & (whole <= high))
        whole = np.where(bad, 0, whole)
        mask = np.uint64(self.not_available)
        return (whole.astype(np.int64).view(np.uint64) if low < 0 else whole.astype(np.uint64)) & mask, bad


class Dbc:
    """The messages of a DBC file, found by the identifiers of frames."""

    def __init__(self, path: Path, protocol: str | None = None) -> None:
        """Read the file; raises InputError naming it.  `protocol` says whether J1939's rules
        hold ("j1939", "can").
        """
        if not path.is_file():
            raise InputError(f"no DBC at {path}")
        try:
            text = decoded(path.read_bytes())
            database: Any = cantools.database.load_string(text, "dbc", strict=False)
            _protocols(database, protocol)
            self.messages = list(database.messages)
        except Damaged as error:
            raise InputError(f"{path}: {error}; save it as UTF-8 or Windows-1252") from None
        except (Error, ValueError, KeyError, AttributeError) as error:
            raise InputError(f"{path} is not a DBC: {first_line(error)}") from None
        if not self.messages:
            raise InputError(f"{path} describes no message")
        self.path = path
        self._exact = {(m.frame_id, m.is_extended_frame): m for m in self.messages}
        self._groups: dict[int, Any] = {}
        for message in self.messages:
            if is_j1939(message):
                group = group_number(message.frame_id)
                self._groups[group] = None if group in self._groups else message  # None: not one alone

    def message(self, identifier: int, extended: bool) -> Any | None:
        """The message of a frame; in J1939 also from another sender, where one message has its group."""
        found = self._exact.get((identifier, extended))
        return found or (self._groups.get(group_number(identifier)) if extended else None)


def _parents_there(one: Field, found: dict[str, Field], bits: np.ndarray) -> np.ndarray:
    """Whether the selector of a multiplexed signal, itself multiplexed, is in the frames."""
    selector = found[one.signal.multiplexer_signal]
    if not selector.signal.multiplexer_ids:
        return np.ones(len(bits), dtype=bool)
    above = found[selector.signal.multiplexer_signal].raw(bits)
    there = np.isin(above, np.array(selector.signal.multiplexer_ids, dtype=np.uint64))
    return there & _parents_there(selector, found, bits)


def is_j1939(message: Any) -> bool:
    """Whether J1939's rules hold for a message: it says so, or its database does."""
    return message.is_extended_frame and (message.protocol == "j1939" or getattr(message, "of_j1939", False))


def unstated(message: Any) -> bool:
    """Whether neither message nor database says if J1939's rules hold for a frame with a long identifier."""
    return (
        message.is_extended_frame and not is_j1939(message) and getattr(message, "protocol_unstated", False)
    )


def _protocols(database: Any, protocol: str | None) -> None:
    """Write down for each message what `protocol`, else the database, states."""
    attributes = database.dbc.attributes if database.dbc else {}
    kinds = [str(getattr(attributes.get(k), "value", "")) for k in ("ProtocolType", "BusType")]
    named = kinds[0] or (kinds[1] if "j1939" in kinds[1].lower() else "")  # a bus of CAN may carry J1939
    for message in database.messages:
        own = message.dbc.attributes.get("VFrameFormat") if message.dbc else None
        message.of_j1939 = protocol == "j1939" or (
            protocol is None and own is None and "j1939" in named.lower()
        )
        message.protocol_unstated = protocol is None and own is None and not named


def group_number(identifier: int) -> int:
    """The parameter group number of a 29-bit identifier."""
    group = identifier >> 8 & GROUP_MASK
    return group if (group & 0xFF00) >= PDU1 else group & ~0xFF


def fields(message: Any) -> list[Field]:
    """The fields of a message that carry values; not those that protect it."""
    return [Field(s, is_j1939(message)) for s in message.signals if _kind(s) not in PROTECTING]


def _kind(signal: Any) -> str:
    """What sort of signal it is, as J1939 databases state it ("" where they do not)."""
    attribute = signal.dbc.attributes.get("SigType") if signal.dbc else None
    if attribute is None:
        return ""
    choices, value = attribute.definition.choices, attribute.value
    return choices[value] if choices and isinstance(value, int) and value < len(choices) else str(value)


def data_id(message: Any) -> int | None:
    """The data ID of a message that is protected as ours are (specs/e2e.py); None of any other."""
    attributes = message.dbc.attributes if message.dbc else {}
    profile, number = attributes.get("E2EProfile"), attributes.get("E2EDataID")
    if profile is None or number is None or profile.value != PROFILE or message.length < 2:
        return None
    return int(number.value)


def checksums(data: np.ndarray, identifier: int) -> np.ndarray:
    """What byte 0 must be in protected frames [n, bytes, uint8]."""
    table, crc = (
        np.array(e2e.TABLE, dtype=np.uint8),
        np.full(len(data), e2e.start(identifier), dtype=np.uint8),
    )
    for column in data.T[1:]:
        crc = table[crc ^ column]
    return crc


def protect(data: np.ndarray, identifier: int) -> np.ndarray:
    """Frames [n, bytes, uint8] with counters from 0 and checksums."""
    data = data.copy()
    data[:, 1] = data[:, 1] & 0xF0 | np.arange(len(data)) % (e2e.LAST_COUNT + 1)
    data[:, 0] = checksums(data, identifier)
    return data


def columns(message: Any, data: np.ndarray, lengths: np.ndarray | None = None) -> list[RawColumn]:
    """The signals of frames of one message, data [n, bytes, uint8]; not those that are never available."""
    return [c for c in all_columns(message, data, lengths) if c.absent is None or not c.absent.all()]


def all_columns(message: Any, data: np.ndarray, lengths: np.ndarray | None = None) -> list[RawColumn]:
    """The signals of frames of one message, data [n, bytes, uint8], in the order of its fields.

    `lengths` [n] is how many bytes of each frame were sent: a signal that is not whole in it is absent.
    """
    bits = np.unpackbits(data, axis=1, bitorder="little")
    found = {f.signal.name: f for f in fields(message)}
    made = []
    for one in found.values():
        there = np.ones(len(data), dtype=bool)
        if one.signal.multiplexer_ids:
            selector = found[one.signal.multiplexer_signal].raw(bits)
            there = np.isin(selector, np.array(one.signal.multiplexer_ids, dtype=np.uint64))
            there &= _parents_there(one, found, bits)
        if lengths is not None:
            there &= lengths > one.last_byte
        made.append(one.column(bits, there))
    return made
