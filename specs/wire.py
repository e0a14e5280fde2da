"""What crosses the machine's wires: CAN frames as J1939 lays them out, and Modbus registers."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

from specs.e2e import COUNTER_BITS
from specs.errors import InputError
from specs.schema import STRICT

REGISTERS = {"float32": 2, "uint16": 1, "int16": 1, "uint32": 2}
MODBUS_HEADER = ("magic", "magic", "model_id", "version", "length")  # the first registers of each table


@dataclass(frozen=True, kw_only=True)
class CanPlace:
    """Where a signal lies in its frame: value in SI = scale * raw + offset; `start` as a DBC counts bits."""

    __pydantic_config__: ClassVar[Any] = STRICT

    message: str
    start: int
    length: int
    byte_order: Literal["little_endian", "big_endian"] = "little_endian"
    signed: bool = False
    scale: float = 1.0
    offset: float = 0.0

    @property
    def raw_limits(self) -> tuple[int, int]:
        """Smallest and largest raw number that is a value.

        As in J1939, the top of an unsigned field is reserved: 8 bits 0–250, 16 bits 0–0xFAFF and
        32 bits 0–0xFAFFFFFF are values, 0xFE… is error and 0xFF… not available; 2 bits: 0 off, 1 on.
        """
        if self.signed:
            return -(1 << (self.length - 1)), (1 << (self.length - 1)) - 1
        if self.length in (8, 16, 32):
            return 0, 250 if self.length == 8 else (0xFB << (self.length - 8)) - 1
        return 0, max((1 << self.length) - 3, 1)

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value in SI that the field can carry."""
        low, high = (raw * self.scale + self.offset for raw in self.raw_limits)
        return low, high

    @property
    def bits(self) -> frozenset[int]:
        """The bits of the frame it takes; bit 8*i + k is bit k (of value 2^k) of byte i."""
        if self.byte_order == "little_endian":
            return frozenset(range(self.start, self.start + self.length))
        first = 8 * (self.start // 8) + 7 - self.start % 8  # counted in the order of transmission
        return frozenset(8 * (n // 8) + 7 - n % 8 for n in range(first, first + self.length))


@dataclass(frozen=True, kw_only=True)
class ModbusPlace:
    """Where a signal lies in the register map: value in SI = scale * register value."""

    __pydantic_config__: ClassVar[Any] = STRICT

    table: Literal["input", "holding"]
    address: int  # of the first register, from 0
    type: Literal["float32", "uint16", "int16", "uint32"]
    word_order: Literal["high_first", "low_first"] = "high_first"
    scale: float = 1.0

    @property
    def registers(self) -> range:
        """Addresses of its 16-bit registers."""
        return range(self.address, self.address + REGISTERS[self.type])


@dataclass(frozen=True, kw_only=True)
class Message:
    """One CAN message: J1939 parameter group, priority and source address make its 29-bit identifier."""

    __pydantic_config__: ClassVar[Any] = STRICT

    name: str
    description: str
    pgn: int
    priority: int
    sender: str
    source: int  # address of the sender
    receivers: tuple[str, ...]
    cycle_ms: int
    length: int = 8
    data_id: int | None = None  # of its end-to-end protection (specs/e2e.py); None: unprotected

    def __post_init__(self) -> None:
        ranges = {"pgn": (0xFF00, 0xFFFF), "priority": (0, 7), "source": (0, 253)}  # proprietary B groups
        ranges |= {"cycle_ms": (1, 65535), "length": (1, 8), "data_id": (0, 0xFFFF)}
        for key, (low, high) in ranges.items():
            found = getattr(self, key)
            if found is not None and not low <= found <= high:
                raise InputError(f"{key} = {found}: outside {low} … {high}")
        if self.data_id is not None and self.length < 2:
            raise InputError("a protected message has two bytes or more")

    @property
    def first_bit(self) -> int:
        """The first bit that signals may take: before it lie CRC and counter."""
        return 0 if self.data_id is None else COUNTER_BITS.stop

    @property
    def frame_id(self) -> int:
        """The 29-bit identifier: priority, parameter group number, source address."""
        return self.priority << 26 | self.pgn << 8 | self.source


@dataclass(frozen=True, kw_only=True)
class Bus:
    """The CAN bus: bit rate [bit/s], nodes with their J1939 addresses, messages by name."""

    __pydantic_config__: ClassVar[Any] = STRICT

    bit_rate: int
    nodes: Mapping[str, int]
    messages: Mapping[str, Message]


@dataclass(frozen=True, kw_only=True)
class ModbusTable:
    """One register table: it starts with magic (2 registers), model id, map version and body length."""

    __pydantic_config__: ClassVar[Any] = STRICT

    model_id: int
    description: str
    length: int = 0  # registers after the header: `sized` counts them

    @property
    def body(self) -> range:
        """Addresses of the registers after the header."""
        return range(len(MODBUS_HEADER), len(MODBUS_HEADER) + self.length)


@dataclass(frozen=True, kw_only=True)
class ServiceRegister:
    """A register of the server itself, of type uint16."""

    __pydantic_config__: ClassVar[Any] = STRICT

    table: Literal["input", "holding"]
    address: int
    description: str

    @property
    def registers(self) -> range:
        """Its address, as `ModbusPlace` gives those of a signal."""
        return range(self.address, self.address + 1)


@dataclass(frozen=True, kw_only=True)
class ModbusMap:
    """The register map: `magic` and `version` of its headers, its tables, the server's own registers."""

    __pydantic_config__: ClassVar[Any] = STRICT

    magic: str
    version: int
    unit_id: int
    word_order: Literal["high_first", "low_first"]
    tables: Mapping[Literal["input", "holding"], ModbusTable]
    services: Mapping[str, ServiceRegister] = field(default_factory=dict)


def frame_bits(length: int) -> int:
    """Longest possible CAN frame with a 29-bit identifier and `length` data bytes, interframe space included.

    Source: Davis, Burns, Bril, Lukkien: Controller Area Network (CAN) schedulability analysis: refuted,
    revisited and revised, Real-Time Systems 35 (2007), equation 1 with g = 54.
    """
    stuffed = 54 + 8 * length
    return stuffed + 13 + (stuffed - 1) // 4


def bus_load(bus: Bus) -> float:
    """Share of the bus's time that its messages take, every frame stuffed as badly as can be."""
    bits_per_second = sum(frame_bits(m.length) * 1000 / m.cycle_ms for m in bus.messages.values())
    return bits_per_second / bus.bit_rate


def check_frames(places: Iterable[tuple[str, CanPlace]], bus: Bus, where: str) -> None:
    """Raise InputError if two signals share a bit, or one leaves its frame."""
    taken: dict[tuple[str, int], str] = {}
    for name, place in places:
        message = bus.messages[place.message]
        for bit in sorted(place.bits):
            if not 0 <= bit < 8 * message.length:
                raise InputError(f"{where}: signal.{name}.can: bit {bit} lies outside {place.message}")
            if bit < message.first_bit:
                raise InputError(f"{where}: signal.{name}.can: bit {bit} of {place.message} protects it")
            other = taken.setdefault((place.message, bit), name)
            if other != name:
                raise InputError(f"{where}: signal.{name}.can: bit {bit} of {place.message} is {other}'s")


def sized(modbus: ModbusMap, places: Sequence[ModbusPlace | ServiceRegister]) -> ModbusMap:
    """The map with each table as long as the last of its `places` asks for."""
    ends = {name: [p.registers.stop for p in places if p.table == name] for name in modbus.tables}
    header = len(MODBUS_HEADER)
    tables = {
        name: replace(table, length=max([header, *ends[name]]) - header)
        for name, table in modbus.tables.items()
    }
    return replace(modbus, tables=tables)


def check_registers(
    places: Iterable[tuple[str, ModbusPlace | ServiceRegister]], modbus: ModbusMap, where: str
) -> None:
    """Raise InputError if two signals share a register, or one leaves its table's body."""
    taken: dict[tuple[str, int], str] = {}
    for name, place in places:
        body = modbus.tables[place.table].body
        for register in place.registers:
            if register not in body:
                raise InputError(f"{where}: {name}: {register} outside {body[0]}–{body[-1]}")
            other = taken.setdefault((place.table, register), name)
            if other != name:
                raise InputError(f"{where}: {name}: {place.table} {register} is {other}'s")
