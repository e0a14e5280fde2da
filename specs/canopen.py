"""The CANopen devices of the machine, as `specs/canopen.toml` defines them: objects, PDOs, what is written.

A node sends its signals in TPDO 1 and takes others in RPDO 1, in the order of the file, with the identifiers
of the predefined connection set (CiA 301, 7.3.5).
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal

from specs.errors import InputError, nearest
from specs.schema import ROOT, STRICT, read_toml, shown_path, validate
from specs.signals import Signal, signals

PATH = ROOT / "canopen.toml"
Type = Literal["INTEGER8", "INTEGER16", "INTEGER32", "UNSIGNED8", "UNSIGNED16", "UNSIGNED32"]
TYPES = {  # number of a type in an EDS (CiA 301, 7.4.7), bits, whether it has a sign
    "INTEGER8": (0x02, 8, True),
    "INTEGER16": (0x03, 16, True),
    "INTEGER32": (0x04, 32, True),
    "UNSIGNED8": (0x05, 8, False),
    "UNSIGNED16": (0x06, 16, False),
    "UNSIGNED32": (0x07, 32, False),
}
UNITS = {"turn": 2 * math.pi, "turn/s": 2 * math.pi, "degree": math.pi / 180, "1": 1.0}  # in SI
EMERGENCY, TPDO1, RPDO1, HEARTBEAT = 0x080, 0x180, 0x200, 0x700  # plus the node's id
PDO_BYTES, HIGHEST_ID = 8, 126  # 127 is left to a tool that is plugged in
ZERO_OF = "zero of "


@dataclass(frozen=True, kw_only=True)
class Entry:
    """An object or a part of one: value in SI = (raw - zero) * unit / counts; `value`: what it has to be."""

    __pydantic_config__: ClassVar[Any] = STRICT

    index: int
    sub: int
    name: str
    type: Type
    access: Literal["ro", "rw"]
    pdo: bool = False
    unit: Literal["turn", "turn/s", "degree", "1"] = "1"
    counts: int = 1
    zero: int = 0
    value: int | None = None

    @property
    def bits(self) -> int:
        """How many it takes in a PDO."""
        return TYPES[self.type][1]

    @property
    def signed(self) -> bool:
        """Whether its numbers have a sign."""
        return TYPES[self.type][2]

    @property
    def scale(self) -> float:
        """SI for a count."""
        return UNITS[self.unit] / self.counts

    @property
    def raw_limits(self) -> tuple[int, int]:
        """Smallest and largest number that it holds."""
        half = 1 << (self.bits - 1)
        return (-half, half - 1) if self.signed else (0, 2 * half - 1)

    @property
    def shown(self) -> str:
        """As people write it: 0x6300:1."""
        return f"0x{self.index:04X}:{self.sub}"

    def raw(self, value: float) -> int:
        """The number of a value in SI."""
        return round(value / self.scale) + self.zero

    def si(self, raw: int) -> float:
        """The value of a number."""
        return (raw - self.zero) * self.scale


@dataclass(frozen=True, kw_only=True)
class Device:
    """A kind of device: identity (objects 0x1000 and 0x1018) and its objects by key."""

    __pydantic_config__: ClassVar[Any] = STRICT

    name: str
    description: str
    profile: int
    type: int
    vendor: int
    product: int
    revision: int
    object: Mapping[str, Entry]

    def entry(self, key: str, where: str) -> Entry:
        """An object by its key; raises InputError with the nearest ones."""
        if key not in self.object:
            raise InputError(f"{where}: {self.name} has no object {key}; {nearest(key, self.object)}")
        return self.object[key]


@dataclass(frozen=True)
class Place:
    """A signal's place in a PDO."""

    signal: Signal
    entry: Entry
    start: int  # bit

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest value that the signal has, half a count aside for rounding."""
        half = 0.5 * self.entry.scale
        return (self.signal.min or 0.0) - half, (self.signal.max or 0.0) + half


@dataclass(frozen=True)
class Node:
    """A device on the bus."""

    name: str
    id: int
    device: Device
    sends: tuple[Place, ...]  # TPDO 1
    takes: tuple[Place, ...]  # RPDO 1
    write: Mapping[str, int | str] = field(default_factory=dict)

    @property
    def is_actuator(self) -> bool:
        """Whether it takes commands: without it the machine is not ready."""
        return bool(self.takes)

    @cached_property
    def mapped(self) -> tuple[tuple[int, tuple[Place, ...]], ...]:
        """Its PDOs: identifier and places."""
        pdos = ((TPDO1 + self.id, self.sends), (RPDO1 + self.id, self.takes))
        return tuple((cob, places) for cob, places in pdos if places)

    def written(self, zeros: Mapping[str, float]) -> list[tuple[Entry, int]]:
        """Objects and what is written to them, with the commissioning record's zeros [SI]."""
        fixed = [
            (e, e.value) for e in self.device.object.values() if e.access == "rw" and e.value is not None
        ]
        own = [(self.device.object[key], self._number(key, text, zeros)) for key, text in self.write.items()]
        return fixed + own

    def _number(self, key: str, text: int | str, zeros: Mapping[str, float]) -> int:
        if isinstance(text, int):
            return text
        place = next(p for p in self.sends if p.signal.name == text.removeprefix(ZERO_OF))
        return -round(zeros.get(place.signal.name, 0.0) / place.entry.scale)


@dataclass(frozen=True, kw_only=True)
class Bus:
    """Times in ms; `sync` is the identifier of SYNC, which the controller sends each tick."""

    __pydantic_config__: ClassVar[Any] = STRICT

    bit_rate: int
    sync: int
    heartbeat_ms: int
    lost_ms: int
    stale_ms: int


@dataclass(frozen=True, kw_only=True)
class _Wiring:
    __pydantic_config__: ClassVar[Any] = STRICT

    id: int
    device: str
    sends: Mapping[str, str] = field(default_factory=dict)
    takes: Mapping[str, str] = field(default_factory=dict)
    write: Mapping[str, int | str] = field(default_factory=dict)


@dataclass(frozen=True)
class Definition:
    """All of `canopen.toml`."""

    bus: Bus
    devices: Mapping[str, Device]
    nodes: tuple[Node, ...]

    def node(self, name: str) -> Node:
        """A node by name; raises InputError with the nearest ones."""
        found = {n.name: n for n in self.nodes}
        if name not in found:
            raise InputError(f"no CANopen node '{name}'; {nearest(name, found)}")
        return found[name]


@cache
def definition(path: Path = PATH) -> Definition:
    """Read and check the file; raises InputError naming file and key."""
    data, where = read_toml(path), shown_path(path)
    for key in ("bus", "device", "node"):
        if not isinstance(data.get(key), dict):
            raise InputError(f"{where}: missing table [{key}]")
    bus = validate(Bus, data["bus"], f"{where}: bus")
    devices = {name: _device(name, d, f"{where}: device.{name}") for name, d in data["device"].items()}
    nodes = tuple(_node(name, d, devices, f"{where}: node.{name}") for name, d in data["node"].items())
    _check_apart(nodes, where)
    return Definition(bus, devices, nodes)


def _device(name: str, data: Mapping[str, Any], where: str) -> Device:
    objects = {
        key: {**_numbered(key, f"{where}.object"), **entry} for key, entry in data.get("object", {}).items()
    }
    found = validate(Device, {"name": name, **data, "object": objects}, where)
    for key, entry in found.object.items():
        low, high = entry.raw_limits
        if entry.value is not None and not low <= entry.value <= high:
            raise InputError(f"{where}.object.{key}.value = {entry.value}: {low} to {high}")
        if entry.counts < 1:
            raise InputError(f"{where}.object.{key}.counts = {entry.counts}: 1 or more")
    if found.type & 0xFFFF != found.profile:
        raise InputError(f"{where}.type: its lower half says profile {found.type & 0xFFFF}")
    return found


def _numbered(key: str, where: str) -> dict[str, int]:
    index, _, sub = key.partition("sub")
    try:
        return {"index": int(index, 16), "sub": int(sub or "0", 16)}
    except ValueError:
        raise InputError(f"{where}: '{key}' is no index such as 6004 or 6300sub1") from None


def _node(name: str, data: Any, devices: Mapping[str, Device], where: str) -> Node:
    wired = validate(_Wiring, data, where)
    if wired.device not in devices:
        raise InputError(f"{where}.device: {nearest(wired.device, devices)}")
    if not 1 <= wired.id <= HIGHEST_ID:
        raise InputError(f"{where}.id = {wired.id}: 1 to {HIGHEST_ID}")
    device = devices[wired.device]
    sends = tuple(_places(device, wired.sends, ("sensor",), f"{where}.sends"))
    takes = tuple(_places(device, wired.takes, ("command",), f"{where}.takes"))
    for key, text in wired.write.items():
        if device.entry(key, f"{where}.write").access != "rw":
            raise InputError(f"{where}.write: object {key} is read-only")
        known = [f"{ZERO_OF}{p.signal.name}" for p in sends]
        if isinstance(text, str) and text not in known:
            raise InputError(f"{where}.write.{key}: a number, or {nearest(text, known)}")
    return Node(name, wired.id, device, sends, takes, wired.write)


def _places(device: Device, wanted: Mapping[str, str], kinds: tuple[str, ...], where: str) -> Iterator[Place]:
    start, known = 0, {n: s for n, s in signals().items() if s.kind in kinds}
    for key, name in wanted.items():
        entry = device.entry(key, where)
        if name not in known:
            raise InputError(f"{where}.{key}: no {' or '.join(kinds)} '{name}'; {nearest(name, known)}")
        if not entry.pdo:
            raise InputError(f"{where}.{key}: the object cannot be in a PDO")
        place = Place(known[name], entry, start)
        for limit in (place.signal.min or 0.0, place.signal.max or 0.0):
            if not entry.raw_limits[0] <= entry.raw(limit) <= entry.raw_limits[1]:
                raise InputError(f"{where}.{key}: {entry.type} cannot carry {name} = {limit:g}")
        yield place
        start += entry.bits
    if start > 8 * PDO_BYTES:
        raise InputError(f"{where}: {start} bits; a PDO has {8 * PDO_BYTES}")


def _check_apart(nodes: tuple[Node, ...], where: str) -> None:
    used: set[int | str] = set()
    for what in [*(n.id for n in nodes), *(p.signal.name for n in nodes for p in n.sends)]:
        if what in used:
            raise InputError(f"{where}: node: {what} is used twice")
        used.add(what)


def sent() -> dict[str, tuple[Node, Place]]:
    """Signals that a device sends, by name."""
    return {p.signal.name: (n, p) for n in definition().nodes for p in n.sends}


def taken() -> dict[str, list[tuple[Node, Place]]]:
    """Signals that devices take, by name; one may be for several."""
    found: dict[str, list[tuple[Node, Place]]] = {}
    for node in definition().nodes:
        for place in node.takes:
            found.setdefault(place.signal.name, []).append((node, place))
    return found
