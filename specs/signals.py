"""Every signal of the machine, as `specs/signals.toml` defines it: one entry, all its places.

Kinds: command, target, reference (of a policy outside), sensor and status cross a wire; estimate is computed
by the controller; internal runs between nominal models; true is a simulation's true state; disturbance is
injected into a simulation.
Only the first five have a place on CAN and Modbus.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

from specs.errors import InputError, nearest
from specs.schema import ROOT, STRICT, read_toml, shown_path, validate
from specs.units import UNITS
from specs.wire import Bus, CanPlace, Message, ModbusMap, ModbusPlace, check_frames, check_registers, sized

PATH = ROOT / "signals.toml"
Kind = Literal[
    "command", "target", "reference", "sensor", "status", "estimate", "internal", "true", "disturbance"
]
WIRED: tuple[Kind, ...] = ("command", "target", "reference", "sensor", "status")
FIRST_VR, LAST_VR = 1, 999  # parameters have 1000–2999


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

    def wrong(self, value: float) -> str:
        """Why a value cannot be this signal's: no number, or outside its range; "" if it can."""
        low, high = (
            (-math.inf if self.min is None else self.min),
            (math.inf if self.max is None else self.max),
        )
        if math.isfinite(value) and low <= value <= high:
            return ""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.name} = {value:g}{unit}: outside {low:g} … {high:g}"

    def causality(self, side: Literal["machine", "controller"]) -> Literal["input", "output"] | None:
        """FMI causality in an FMU of the machine or of a controller; None if it does not occur there."""
        if self.can and self.kind == "status":  # both sides report: its message tells whose it is
            sender = definition().bus.messages[self.can.message].sender
            return "output" if (sender == "Controller") == (side == "controller") else "input"
        return KINDS[self.kind][side == "controller"]


# causality in (a machine FMU, a controller FMU)
KINDS: dict[str, tuple[Literal["input", "output"] | None, Literal["input", "output"] | None]] = {
    "command": ("input", "output"),
    "target": (None, "input"),
    "reference": (None, "input"),
    "sensor": ("output", "input"),
    "status": ("output", "input"),
    "estimate": ("output", "input"),
    "internal": ("output", None),
    "true": ("output", None),
    "disturbance": ("input", None),
}


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
    data, where = read_toml(path), shown_path(path)
    for key in ("can", "modbus", "signal"):
        if not isinstance(data.get(key), dict):
            raise InputError(f"{where}: missing table [{key}]")
    bus = _bus(data["can"], where)
    modbus = validate(ModbusMap, data["modbus"], f"{where}: modbus")
    found = [_signal(name, entry, modbus, where) for name, entry in data["signal"].items()]
    retired = validate(dict[int, str], data.get("retired", {}), f"{where}: retired")
    _check_references(found, retired, where)
    for s in found:
        _check_signal(s, bus, f"{where}: signal.{s.name}")
    check_frames([(s.name, s.can) for s in found if s.can], bus, where)
    registers = [
        *((f"signal.{s.name}.modbus", s.modbus) for s in found if s.modbus),
        *modbus.services.items(),
    ]
    modbus = sized(modbus, [place for _, place in registers])
    check_registers(registers, modbus, where)
    return Definition(signals={s.name: s for s in found}, retired=retired, bus=bus, modbus=modbus)


def _bus(data: Mapping[str, Any], where: str) -> Bus:
    nodes = validate(dict[str, int], data.get("nodes", {}), f"{where}: can.nodes")
    messages = {}
    for name, entry in data.get("message", {}).items():
        at = f"{where}: can.message.{name}"
        sender = entry.get("sender")
        for node in (sender, *entry.get("receivers", ())):
            if node not in nodes:
                raise InputError(f"{at}: unknown node {node}; {nearest(str(node), nodes)}")
        messages[name] = validate(Message, {"name": name, "source": nodes[sender], **entry}, at)
    ids = [m.frame_id for m in messages.values()]
    if len(set(ids)) < len(ids):
        raise InputError(f"{where}: can.message: an identifier is used twice")
    ids = [m.data_id for m in messages.values() if m.data_id is not None]
    if len(set(ids)) < len(ids):
        raise InputError(f"{where}: can.message: a data_id is used twice")
    plain = {key: value for key, value in data.items() if key != "message"}
    return validate(Bus, {**plain, "messages": messages}, f"{where}: can")


def _signal(name: str, entry: Any, modbus: ModbusMap, where: str) -> Signal:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: signal.{name}: expected a table")
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
    if s.unit not in UNITS:
        raise InputError(f"{where}.unit: unknown unit '{s.unit}'; {nearest(s.unit, UNITS)}")
    if (s.min is not None and s.start < s.min) or (s.max is not None and s.start > s.max):
        raise InputError(f"{where}.start: {s.start:g} outside {s.min} … {s.max}")
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
