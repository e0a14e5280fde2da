"""The registers that a client writes, and who may: no sockets, no clock.

One client writes at a time, and none while somebody writes at the HMI (runtime/hmi). It becomes the writer by
its first write, or by writing a number of its own to `claim`; a write by anybody else is answered busy. Who
claimed with a number stays the writer when its connection ends: the same number on a new connection takes the
right over. The right ends when the writer gives it back (`claim` 0), when its heartbeat has stood still for
the time after which targets count as lost, and, of a writer without a number, with its connection. Then all
it wrote lapses: nothing counts before the next writer has committed something itself.

Written values take effect when `commit` changes, all together, after all have been checked; only the
heartbeat takes effect by itself.  A request that is refused changes nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from math import isfinite
from typing import Protocol

import numpy as np

from runtime.image import TICK_S, timeout_ticks
from runtime.modbus.cells import HOLDING, TARGETS, placed
from specs.signals import definition, signal
from specs.tables import header_values
from specs.wire import MODBUS_HEADER, ModbusPlace

PLACES = tuple(place for _, place in placed("holding"))
SERVICES = definition().modbus.services
COMMIT, CLAIM = SERVICES["commit"].address, SERVICES["claim"].address
HEARTBEAT = next(p.address for s, p in placed("holding") if s.name == "planner_heartbeat")
HIGHEST_HEARTBEAT = int(signal("planner_heartbeat").max or 0)
LAPSE_NS = round(timeout_ticks(signal("planner_heartbeat")) * TICK_S * 1e9)
UNNAMED = 0xFFFF  # the number shown for a writer that claimed without one


class Refusal(IntEnum):
    """Why a write is refused, as Modbus exception codes."""

    FUNCTION = 1  # the client's role does not write
    ADDRESS = 2
    VALUE = 3
    BUSY = 6  # another client writes


class Client(Protocol):
    """A connection."""

    writes: bool  # whether its role may


@dataclass
class Owner:
    """The client that writes."""

    client: Client | None
    number: int
    since_ns: int  # of its claim, or of its last heartbeat


class Holding:
    """The table and its writer; `publish` is given every new state (cells.TARGETS)."""

    def __init__(
        self, publish: Callable[[np.ndarray], None], taken: Callable[[], bool] = lambda: False
    ) -> None:
        """`taken`: whether somebody else, at the HMI, has the right to write."""
        self._publish, self._taken = publish, taken
        self.owner: Owner | None = None
        self.refused = 0
        self.registers: list[int] = []
        self.state = np.zeros((), TARGETS)
        self._clear()

    def _clear(self) -> None:
        """As it is before anybody wrote."""
        table = definition().modbus.tables["holding"]
        self.registers = [*header_values(table), *[0] * table.length]
        for s, place in zip(HOLDING, PLACES, strict=True):
            self.registers[place.address : place.registers.stop] = encode(place, s.start)
        for key in ("heartbeat_ns", "commits", "owner"):
            self.state[key] = 0
        self.state["value"] = [s.start for s in HOLDING]

    def write(self, client: Client, address: int, values: list[int], now: int) -> Refusal | None:
        """Write registers from `address` on at `now` [ns]; None if that was done."""
        refusal = self._write(client, address, values, now)
        self.refused += refusal is not None
        return refusal

    def _write(self, client: Client, address: int, values: list[int], now: int) -> Refusal | None:
        if not client.writes:
            return Refusal.FUNCTION
        if address < len(MODBUS_HEADER) or address + len(values) > len(self.registers):
            return Refusal.ADDRESS
        self.lapse(now)
        if self._taken():
            return Refusal.BUSY
        wanted = self.registers.copy()
        wanted[address : address + len(values)] = values
        claims = address <= CLAIM < address + len(values)
        number = wanted[CLAIM] if claims else 0
        if number == UNNAMED:
            return Refusal.VALUE
        if claims and number == 0:
            return self._give_back(client) if len(values) == 1 else Refusal.VALUE
        if self.owner and self.owner.client is not client and (not number or number != self.owner.number):
            return Refusal.BUSY
        if not self._valid(wanted):
            return Refusal.VALUE
        self._own(client, number, now)
        self._take(wanted, now)
        return None

    def _own(self, client: Client, number: int, now: int) -> None:
        if self.owner is None:
            self.owner = Owner(client, number or UNNAMED, now)
        elif number:
            self.owner.client, self.owner.number = client, number
        self.state["owner"] = self.owner.number

    def _valid(self, wanted: list[int]) -> bool:
        if wanted[HEARTBEAT] > HIGHEST_HEARTBEAT:
            return False
        return wanted[COMMIT] == self.registers[COMMIT] or all(
            self._in_range(decode(place, wanted), s.min, s.max)
            for s, place in zip(HOLDING, PLACES, strict=True)
        )

    @staticmethod
    def _in_range(value: float, low: float | None, high: float | None) -> bool:
        return isfinite(value) and (low is None or value >= low) and (high is None or value <= high)

    def _take(self, wanted: list[int], now: int) -> None:
        beats = wanted[HEARTBEAT] != self.registers[HEARTBEAT]
        commits = wanted[COMMIT] != self.registers[COMMIT]
        self.registers = wanted
        if beats and self.owner:
            self.owner.since_ns = now
            self.state["heartbeat_ns"] = now
            self.state["value"][_index("planner_heartbeat")] = wanted[HEARTBEAT]
        if commits:
            self.state["commits"] += 1
            self.state["value"] = [decode(place, wanted) for place in PLACES]
        self.beat(now)

    def _give_back(self, client: Client) -> Refusal | None:
        if self.owner is None or self.owner.client is not client:
            return Refusal.BUSY if self.owner else None
        self._release()
        return None

    def _release(self) -> None:
        self.owner = None
        self._clear()

    def lapse(self, now: int) -> None:
        """End the right of a writer whose heartbeat stands still, or who came a moment after the HMI."""
        if self.owner and (now - self.owner.since_ns >= LAPSE_NS or self._taken()):
            self._release()

    def left(self, client: Client) -> None:
        """A connection ended."""
        if self.owner and self.owner.client is client:
            self.owner.client = None
            if self.owner.number == UNNAMED:
                self._release()

    def beat(self, now: int) -> None:
        """Publish the present state."""
        self.state["stamp_ns"] = now
        self._publish(self.state)


def encode(place: ModbusPlace, value: float) -> list[int]:
    """The registers of a value in SI."""
    if place.type == "float32":
        words = np.array([value / place.scale], dtype=">f4").view(">u2").tolist()
        return words if place.word_order == "high_first" else words[::-1]
    number = round(value / place.scale)
    if place.type == "uint32":
        words = [number >> 16 & 0xFFFF, number & 0xFFFF]
        return words if place.word_order == "high_first" else words[::-1]
    return [number & 0xFFFF]


def decode(place: ModbusPlace, registers: list[int]) -> float:
    """The value in SI that registers (of a whole table) hold."""
    words = registers[place.address : place.registers.stop]
    if len(words) == 2:
        high, low = words if place.word_order == "high_first" else words[::-1]
        bits = np.array([high << 16 | low], dtype=np.uint32)
        return float(bits.view(np.float32)[0] if place.type == "float32" else bits[0]) * place.scale
    number = words[0] - (words[0] >> 15 << 16) if place.type == "int16" else words[0]
    return number * place.scale


def _index(name: str) -> int:
    return next(i for i, s in enumerate(HOLDING) if s.name == name)
