"""Every signal of the machine, as `specs/signals.toml` defines it: one entry, all its places.

Kinds: command, target, sensor and status cross a wire; estimate is computed by the controller; internal
runs between nominal models; true is a simulation's true state; disturbance is injected into a simulation.
Only the first four have a place on CAN and Modbus.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

from specs.errors import InputError, nearest
from specs.schema import ROOT, STRICT, read_toml, shown, validate
from specs.units import unit as find_unit

PATH = ROOT / "signals.toml"
Kind = Literal["command", "target", "sensor", "status", "estimate", "internal", "true", "disturbance"]
WIRED: tuple[Kind, ...] = ("command", "target", "sensor", "status")
FIRST_VR, LAST_VR = 1, 999  # parameters have 1000–2999
REGISTERS = {"float32": 2, "uint16": 1, "int16": 1, "uint32": 2}


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
        return 0, (1 << self.length) - 3 if self.length > 1 else 1

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value in SI that the field can carry."""
        low, high = (raw * self.scale + self.offset for raw in self.raw_limits)
        return low, high


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
    def count(self) -> int:
        """Number of 16-bit registers."""
        return REGISTERS[self.type]


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One signal in SI `unit`; `rate_hz` is how often it is sent, `timeout_s` when it counts as lost."""

    __pydantic_config__: ClassVar[Any] = STRICT

    name: str
    description: str
    unit: str
    kind: Kind
    vr: int
    min: float | None = None
    max: float | None = None
    nominal: float | None = None
    start: float = 0.0
    rate_hz: float | None = None
    timeout_s: float | None = None
    can: CanPlace | None = None
    modbus: ModbusPlace | None = None
    values: Mapping[int, str] = field(default_factory=dict)  # of an enumeration or flag

    @property
    def wired(self) -> bool:
        """True if the signal crosses a wire of the machine."""
        return self.kind in WIRED

    def causality(self, side: Literal["machine", "controller"]) -> Literal["input", "output"] | None:
        """FMI causality in an FMU of the machine or of a controller; None if it does not occur there."""
        return KINDS[self.kind][side == "controller"]


# causality in (a machine FMU, a controller FMU)
KINDS: dict[str, tuple[Literal["input", "output"] | None, Literal["input", "output"] | None]] = {
    "command": ("input", "output"),
    "target": (None, "input"),
    "sensor": ("output", "input"),
    "status": ("output", "input"),
    "estimate": ("output", "input"),
    "internal": ("output", None),
    "true": ("output", None),
    "disturbance": ("input", None),
}


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

    @property
    def frame_id(self) -> int:
        """The 29-bit identifier: priority, parameter group number, source address."""
        return self.priority << 26 | self.pgn << 8 | self.source


@dataclass(frozen=True, kw_only=True)
class Bus:
    """The CAN bus: bit rate [bit/s], nodes with their J1939 addresses, messages by name."""

    bit_rate: int
    nodes: Mapping[str, int]
    messages: Mapping[str, Message]


@dataclass(frozen=True, kw_only=True)
class ModbusTable:
    """One register table: it starts with magic (2 registers), model id, map version and body length."""

    __pydantic_config__: ClassVar[Any] = STRICT

    model_id: int
    length: int  # registers after the header
    description: str


@dataclass(frozen=True, kw_only=True)
class ModbusMap:
    """The register map: `magic` and `version` of its headers, and its two tables by name."""

    __pydantic_config__: ClassVar[Any] = STRICT

    magic: str
    version: int
    unit_id: int
    word_order: Literal["high_first", "low_first"]
    tables: Mapping[Literal["input", "holding"], ModbusTable]


MODBUS_HEADER = 5  # registers: magic 2, model id, version, length


@dataclass(frozen=True, kw_only=True)
class Definition:
    """All of `signals.toml`."""

    signals: Mapping[str, Signal]
    retired: Mapping[int, str]  # value references of former signals, never given out again
    bus: Bus
    modbus: ModbusMap


def signal(name: str) -> Signal:
    """Return the signal `name`; raises InputError with the nearest names."""
    known = signals()
    if name not in known:
        raise InputError(f"unknown signal '{name}'; {nearest(name, known)}")
    return known[name]


def signals() -> dict[str, Signal]:
    """All signals by name, in the order of the file."""
    return dict(definition().signals)


def select(*kinds: Kind) -> list[Signal]:
    """The signals of these kinds, in the order of the file."""
    return [s for s in definition().signals.values() if s.kind in kinds]


@cache
def definition(path: Path = PATH) -> Definition:
    """Read and check a signal file; raises InputError naming file and key."""
    data, where = read_toml(path), shown(path)
    for key in ("can", "modbus", "signal"):
        if not isinstance(data.get(key), dict):
            raise InputError(f"{where}: missing table [{key}]")
    bus = _bus(data["can"], where)
    modbus = validate(ModbusMap, data["modbus"], f"{where}: modbus")
    found = [_signal(name, entry, modbus, where) for name, entry in data["signal"].items()]
    retired = {int(vr): name for vr, name in data.get("retired", {}).items()}
    _check_references(found, retired, where)
    for s in found:
        _check_signal(s, bus, f"{where}: signal.{s.name}")
    return Definition(signals={s.name: s for s in found}, retired=retired, bus=bus, modbus=modbus)


def _bus(data: Mapping[str, Any], where: str) -> Bus:
    nodes = data.get("nodes", {})
    messages = {}
    for name, entry in data.get("message", {}).items():
        at = f"{where}: can.message.{name}"
        if entry.get("sender") not in nodes:
            raise InputError(f"{at}.sender: unknown node; {nearest(str(entry.get('sender')), nodes)}")
        for receiver in entry.get("receivers", ()):
            if receiver not in nodes:
                raise InputError(f"{at}.receivers: unknown node {receiver}; {nearest(receiver, nodes)}")
        messages[name] = validate(Message, {"name": name, "source": nodes[entry["sender"]], **entry}, at)
    ids = [m.frame_id for m in messages.values()]
    if len(set(ids)) < len(ids):
        raise InputError(f"{where}: can.message: an identifier is used twice")
    return Bus(bit_rate=int(data.get("bit_rate", 0)), nodes=nodes, messages=messages)


def _signal(name: str, entry: Any, modbus: ModbusMap, where: str) -> Signal:
    found = validate(Signal, {"name": name, **entry}, f"{where}: signal.{name}")
    if found.modbus and "word_order" not in entry["modbus"]:
        found = replace(found, modbus=replace(found.modbus, word_order=modbus.word_order))
    return found


def _check_references(found: Iterable[Signal], retired: Mapping[int, str], where: str) -> None:
    owners = dict(retired)
    for s in found:
        if not FIRST_VR <= s.vr <= LAST_VR:
            raise InputError(f"{where}: signal.{s.name}.vr: {s.vr} outside {FIRST_VR}–{LAST_VR}")
        if s.vr in owners:
            raise InputError(f"{where}: signal.{s.name}.vr: {s.vr} already belongs to {owners[s.vr]}")
        owners[s.vr] = s.name


def _check_signal(s: Signal, bus: Bus, where: str) -> None:
    find_unit(s.unit)
    low = s.min if s.min is not None else float("-inf")
    high = s.max if s.max is not None else float("inf")
    if not low <= s.start <= high:
        raise InputError(f"{where}.start: {s.start:g} outside {low:g} … {high:g}")
    if s.wired != (s.can is not None):
        raise InputError(f"{where}.can: a {s.kind} signal has {'a' if s.wired else 'no'} CAN place")
    if s.wired != (s.modbus is not None):
        raise InputError(f"{where}.modbus: a {s.kind} signal has {'a' if s.wired else 'no'} Modbus place")
    if s.can:
        _check_can(s, s.can, bus, where)


def _check_can(s: Signal, can: CanPlace, bus: Bus, where: str) -> None:
    if can.message not in bus.messages:
        raise InputError(f"{where}.can.message: {nearest(can.message, bus.messages)}")
    if s.min is None or s.max is None or s.timeout_s is None:
        raise InputError(f"{where}: a signal on CAN needs min, max and timeout_s")
    rate = 1000.0 / bus.messages[can.message].cycle_ms
    if s.rate_hz != rate:
        raise InputError(f"{where}.rate_hz: {s.rate_hz} but its message is sent at {rate:g} Hz")
    low, high = can.limits
    slack = 1e-9 * max(abs(low), abs(high))
    if s.min < low - slack or s.max > high + slack:
        raise InputError(f"{where}.can: carries {low:g} … {high:g}, not {s.min:g} … {s.max:g}")
