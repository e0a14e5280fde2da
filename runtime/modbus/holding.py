"""The registers that a client writes, and who may: no sockets, no clock.

One client writes at a time, and none while somebody writes at the HMI (runtime/hmi). It becomes the writer by
its first write, or by writing a number of its own to `claim`; a write by anybody else is answered busy as
long as the writer's connection is there and its heartbeat goes on, whatever number comes with it.  The number
is a secret: no register shows it.  It is good for one thing: when the connection has ended, it keeps the
right for whoever comes with the same number on a new one.  Coming from the same peer (computer and, over
TLS, certificate), that is the writer itself, and it goes on.  From any other it is a takeover: all that was
written before lapses, and the drive stops.

The right ends when the writer gives it back (`claim` 0), when its heartbeat has stood still for the time
after which targets count as lost, and, of a writer without a number, with its connection. Then all it wrote
lapses: nothing counts before the next writer has committed something itself.

Written values take effect when `commit` changes, all together, after all have been checked; only the
heartbeat takes effect by itself.  A request that is refused changes nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from math import isfinite
from typing import Protocol

import numpy as np

from runtime.image import TICK_S, timeout_ticks
from runtime.modbus.cells import HOLDING, TARGETS, placed
from specs.signals import Signal, definition, signal
from specs.tables import header_values
from specs.wire import MODBUS_HEADER, ModbusPlace

PLACES = tuple(place for _, place in placed("holding"))
SERVICES = definition().modbus.services
COMMIT, CLAIM = SERVICES["commit"].address, SERVICES["claim"].address
HEARTBEAT = next(p.address for s, p in placed("holding") if s.name == "planner_heartbeat")
HIGHEST_HEARTBEAT = int(signal("planner_heartbeat").max or 0)
LAPSE_NS = round(timeout_ticks(signal("planner_heartbeat")) * TICK_S * 1e9)
UNNAMED = 0xFFFF  # the number shown for a writer that claimed without one
GUESSES = 3  # wrong numbers after which the right no longer passes on to a new connection
SMALLEST_NORMAL = float(np.finfo(np.float32).tiny)


class Refusal(IntEnum):
    """Why a write is refused, as Modbus exception codes."""

    FUNCTION = 1  # the client's role does not write
    ADDRESS = 2
    VALUE = 3
    BUSY = 6  # another client writes


class Client(Protocol):
    """A connection."""

    writes: bool  # whether its role may


class Event(StrEnum):
    """What happens to the right to write, and to those who lack it."""

    CLAIMED = "claimed the right to write"
    BACK = "came back on a new connection and goes on"
    TAKEN = "took the right to write over: what was written before has lapsed"
    GIVEN_BACK = "gave the right to write back"
    LAPSED = "lost the right to write: its heartbeat stood still"
    LEFT = "lost the right to write: its connection ended"
    HMI = "lost the right to write: somebody else, at the page or an interface, has it"
    REFUSED = "was refused a write"


@dataclass
class Owner:
    """The client that writes."""

    client: Client | None  # None: its connection ended
    peer: str  # where it is
    secret: int  # the number it claimed with; 0: none
    number: int  # that is shown: another one for each that claims with a number
    since_ns: int  # of its claim, or of its last heartbeat
    wrong: int = 0  # numbers tried by others since its connection ended


class Holding:
    """The table and its writer; `publish` is given every new state (cells.TARGETS)."""

    def __init__(
        self,
        publish: Callable[[np.ndarray], None],
        taken: Callable[[], bool] = lambda: False,
        tell: Callable[[Event, Client | None, str], None] = lambda event, client, why: None,
    ) -> None:
        """`taken`: whether somebody else, at the HMI or an interface, has the right to write; `tell`
        is told what happens.
        """
        self._publish, self._taken, self._tell = publish, taken, tell
        self._claims = 0
        self._last: Client | None = None  # that wrote last, for who lapses without a connection
        self.owner: Owner | None = None
        self.refused = 0
        self.registers: list[int] = []
        self.state = np.zeros((), TARGETS)
        self._clear()

    def _clear(self) -> None:
        """As it is before anybody wrote."""
        self.registers = self._fresh()
        for key in ("heartbeat_ns", "commits", "owner"):
            self.state[key] = 0
        self.state["value"] = [s.start for s in HOLDING]

    @staticmethod
    def _fresh() -> list[int]:
        table = definition().modbus.tables["holding"]
        found = [*header_values(table), *[0] * table.length]
        for s, place in zip(HOLDING, PLACES, strict=True):
            found[place.address : place.registers.stop] = encode(place, s.start)
        return found

    def write(self, client: Client, address: int, values: list[int], now: int) -> Refusal | None:
        """Write registers from `address` on at `now` [ns]; None if that was done."""
        refusal = self._write(client, address, values, now)
        self.refused += refusal is not None
        if refusal:
            self._tell(Event.REFUSED, client, refusal.name.lower())
        return refusal

    def _write(self, client: Client, address: int, values: list[int], now: int) -> Refusal | None:
        if not client.writes:
            return Refusal.FUNCTION
        if address < len(MODBUS_HEADER) or address + len(values) > len(self.registers):
            return Refusal.ADDRESS
        self.lapse(now)
        if self._taken():
            return Refusal.BUSY
        written = range(address, address + len(values))
        secret = values[CLAIM - address] if CLAIM in written else None
        if secret == UNNAMED or (secret == 0 and len(values) > 1):  # giving back stands alone
            return Refusal.VALUE
        if secret == 0:
            return self._give_back(client)
        if not self._may(client, secret or 0):
            return Refusal.BUSY
        before = self._fresh() if self._changes_hands(client) else self.registers
        wanted = before.copy()
        wanted[address : address + len(values)] = values
        wanted[CLAIM] = 0  # nobody reads it
        if not self._valid(before, wanted, COMMIT in written):
            return Refusal.VALUE
        self._own(client, secret or 0, now)
        self._take(wanted, now)
        return None

    def _changes_hands(self, client: Client) -> bool:
        owner = self.owner
        return owner is None or (owner.client is not client and owner.peer != peer_of(client))

    def _may(self, client: Client, secret: int) -> bool:
        owner = self.owner
        if owner is None or owner.client is client:
            return True
        if owner.client is not None or not secret:  # it is there, and lapse() saw that it beats
            return False
        if secret == owner.secret and owner.wrong < GUESSES:
            return True
        owner.wrong += 1
        return False

    def _own(self, client: Client, secret: int, now: int) -> None:
        if self._changes_hands(client):
            event = Event.TAKEN if self.owner else Event.CLAIMED
            self._clear()
            self._claims = self._claims % (UNNAMED - 1) + 1
            self.state["owner"] = self._claims
            self.owner = Owner(client, peer_of(client), secret, self._claims if secret else UNNAMED, now)
            self._tell(event, client, "")
        elif self.owner:
            if self.owner.client is not client:
                self.owner.client, self.owner.wrong = client, 0
                self._tell(Event.BACK, client, "")
            self.owner.secret = secret or self.owner.secret
        self._last = client

    def _valid(self, before: list[int], wanted: list[int], commits: bool) -> bool:
        if wanted[HEARTBEAT] > HIGHEST_HEARTBEAT:
            return False
        if not commits:
            return True
        if wanted[COMMIT] == 0 or (wanted[COMMIT] == before[COMMIT] and self._waits(wanted)):
            return False  # it would be answered as done, and nothing would have taken effect
        return all(
            self._in_range(decode(place, wanted), s.min, s.max) and not swapped(s, place, wanted)
            for s, place in zip(HOLDING, PLACES, strict=True)
        )

    def _waits(self, wanted: list[int]) -> bool:
        """Whether something is written that did not take effect."""
        return any(
            s.name != "planner_heartbeat" and decode(place, wanted) != value
            for s, place, value in zip(HOLDING, PLACES, self.state["value"].tolist(), strict=True)
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
        self._release(Event.GIVEN_BACK)
        return None

    def _release(self, why: Event) -> None:
        self.owner = None
        self._clear()
        self._tell(why, self._last, "")

    def lapse(self, now: int) -> None:
        """End the right of a writer whose heartbeat stands still, or who came a moment after the HMI."""
        if self.owner and now - self.owner.since_ns >= LAPSE_NS:
            self._release(Event.LAPSED if self.owner.client else Event.LEFT)
        elif self.owner and self._taken():
            self._release(Event.HMI)

    def left(self, client: Client) -> None:
        """A connection ended."""
        if self.owner and self.owner.client is client:
            self.owner.client = None
            if not self.owner.secret:
                self._release(Event.LEFT)

    def beat(self, now: int) -> None:
        """Publish the present state."""
        self.state["stamp_ns"] = now
        self._publish(self.state)


def peer_of(client: Client) -> str:
    """Where a client is, for those that are somewhere."""
    return getattr(client, "peer", "")


def swapped(s: Signal, place: ModbusPlace, registers: list[int]) -> bool:
    """Whether a float32 came low word first: next to nothing that way, a value the other."""
    if place.type != "float32":
        return False
    size = abs(decode(place, registers))
    if size < SMALLEST_NORMAL:
        return size > 0.0
    step = s.can.scale if s.can else 0.0
    first, second = registers[place.address : place.registers.stop]
    other = decode(place, [0] * place.address + [second, first])
    sensible = step <= abs(other) and (s.min is None or other >= s.min) and (s.max is None or other <= s.max)
    return size < step and sensible


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
