"""The control process's side of the HMI: a `Port` of the scan, after those that bring the planner's targets.

It alone decides whose targets count and what is forced; the HMI only asks.  A planner that is alive, over CAN
or Modbus, is never displaced, and neither is a page that has the right.  When a page's right ends while its
targets are followed, nothing counts until automatic operation has ended: no other target slips in.

It costs a cycle next to nothing while pages only look: frames are counted, one number is compared, and in
every fifth tick one state is written.  What is shown is worked out in the HMI's own process.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from runtime.hmi.cells import ASKED_HEAD, GRANT, HMI, LADDER, MESSAGES, SEEN_HEAD, Writer
from runtime.image import INPUT, OUTPUT, Flag, Status, forceable, timeout_ticks
from runtime.modbus.cells import HOLDING
from runtime.modbus.port import HEARTBEAT, PERIOD_NS
from runtime.shared import Cell, flat
from runtime.statistics import Histogram, Statistics
from specs.signals import signal

EVERY, PHASE = 5, 3  # ticks between two states of `seen`; not in the ticks of the policy
MODES = {text: number for number, text in signal("control_mode").values.items()}
STANDBY, FOLLOWING = MODES["standby"], (MODES["automatic"], MODES["hold"])
MODE = OUTPUT.index["control_mode"]
FORCED, OK = int(Flag.FORCED), int(Status.OK)
NOBODY, PLANNER, PAGE = int(Writer.NOBODY), int(Writer.PLANNER), int(Writer.HMI)
VALUES_AT = ASKED_HEAD.size  # of the targets, in a state of hmi.cell
NUMBER_AT = (HMI.fields or {})["force_number"][1]
HEARD = np.array(list(MESSAGES.values()), dtype=np.intp)
TARGETS = np.array([INPUT.index[s.name] for s in HOLDING], dtype=np.intp)


NONE_REFUSED = flat(np.zeros(2 * len(MESSAGES), np.int64))


class HmiPort:
    """Brings in what the page asks for, as far as it may; shows it what goes on."""

    def __init__(
        self,
        cells: tuple[Cell, Cell, Cell],
        found: Statistics,
        claimed: Callable[[], bool] = lambda: False,
        unrecorded: Callable[[], int] = lambda: 0,
        refused: Callable[[], memoryview] = lambda: NONE_REFUSED,
        ladder: Callable[[np.ndarray, np.ndarray], None] = lambda inputs, told: None,
    ) -> None:
        """`claimed`: whether a Modbus client has the right to write, though it may not have written yet.

        `refused`: frames refused and repeated, by message (NativePort.refused); `ladder`: ControlCore.ladder.
        """
        self._refused, self._ladder = refused, ladder
        self._told = np.zeros((), LADDER)
        self.seen, self._grant, self.asked = cells
        self._found, self._claimed, self._unrecorded = found, claimed, unrecorded
        self._counts = [_bytes(h) for h in (found.lateness, found.policy_work, found.other_work)]
        self._granted: dict[str, int] = dict.fromkeys(GRANT.names or (), 0)
        self._owner = self._heartbeat_ns = self._commits = self._stamp_ns = self._force_number = 0
        self._newest = np.zeros((), HMI).tobytes()
        self._number = -1
        self._start = np.array([s.start for s in HOLDING])
        self._heartbeat, self._late = INPUT.index[HEARTBEAT.name], timeout_ticks(HEARTBEAT)
        self._may_be_forced = np.array([forceable(s) for s in INPUT.signals])
        self.frames = np.zeros(len(MESSAGES), dtype=np.int64)
        self._next = 0  # tick of the next state
        self._ended = 0  # the claim whose right ended last
        self._draining = False  # its targets are still being followed
        self._quiet = True  # pages only look: nothing is asked for, nothing is granted
        self._look_at(INPUT.new())
        self._outputs, self._sent = OUTPUT.new(), memoryview(b"")

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Put targets and forced values into the image, if they count."""
        if inputs is not self._inputs:
            self._look_at(inputs)
        self.frames += self._age[HEARD] == 0
        if self.asked.number != self._number and (found := self.asked.read()):
            self._take(*found)
        if not self._quiet:
            self._decide(time.monotonic_ns())

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Show everything, if it is time."""
        if outputs is not self._outputs:
            self.see(outputs)
        if tick >= self._next:  # later where ticks were skipped
            self._next = tick + EVERY - (tick - PHASE) % EVERY
            self._show()

    def flags(self) -> int:
        """FORCED."""
        return FORCED if self._granted["forcing"] else 0

    def received_ns(self) -> int:
        """No sensor comes this way."""
        return 0

    def settle(self) -> None:
        """Say whether a planner is there, while nobody asks for anything."""
        if self._quiet:
            self._tell(writer=PLANNER if self._other() else NOBODY)

    @property
    def standing(self) -> tuple[bool, int, int]:
        """Whether there is something to decide in every tick; who commands; the forcing in force."""
        return not self._quiet, self._granted["writer"], self._granted["forcing"]

    @property
    def next_state(self) -> int:
        """Tick of the next state that is shown."""
        return self._next

    def see(self, outputs: np.ndarray) -> None:
        """Outputs that are written anew in each tick, where not `send` brings them."""
        self._outputs, self._sent = outputs, flat(outputs)

    def commands(self) -> bool:
        """Whether a page commands, or what it commanded is still followed."""
        return self._granted["writer"] == PAGE or self._draining

    def twin(self, cells: tuple[Cell, Cell, Cell], found: Statistics) -> "HmiPort":
        """Another one that is asked the same and shows it in other cells (runtime/rehearsal.py)."""
        return HmiPort((cells[0], cells[1], self.asked), found, self._claimed)

    def follow(self, other: "HmiPort") -> None:
        """Stand where another one stands, so that the same comes next."""
        self._granted, self._ended, self._draining = dict(other._granted), other._ended, other._draining
        self._number, self._newest, self._quiet = other._number, other._newest, other._quiet
        self._owner, self._heartbeat_ns, self._commits = other._owner, other._heartbeat_ns, other._commits
        self._stamp_ns, self._force_number = other._stamp_ns, other._force_number
        self._next = other._next

    def _look_at(self, inputs: np.ndarray) -> None:
        """Keep what is needed of an image: finding it takes longer than using it."""
        self._inputs, self._came = inputs, flat(inputs)
        self._value, self._age, self._status = inputs["value"], inputs["age"], inputs["status"]

    def _take(self, number: int, state: bytes) -> None:
        """A state of hmi.cell."""
        self._number, self._newest = number, state
        self._stamp_ns, self._heartbeat_ns, self._commits, self._owner = ASKED_HEAD.unpack_from(state)
        self._force_number = int.from_bytes(state[NUMBER_AT : NUMBER_AT + 4], "little")
        self._quiet = self._quiet and not (self._owner or self._force_number)

    def _decide(self, now: int) -> None:
        """Who writes, and what is forced."""
        mode = int(self._outputs["value"][MODE])  # of the last tick
        self._write(now, mode)
        self._force(now, mode)
        granted = self._granted["writer"] == PAGE or self._granted["forcing"] or self._draining
        self._quiet = not (granted or self._owner or self._force_number)

    def _write(self, now: int, mode: int) -> None:
        writer = self._granted["writer"]
        owner, age = self._owner, (now - self._heartbeat_ns) // PERIOD_NS
        alive = bool(owner) and owner != self._ended and 0 <= age < self._late
        if writer == PAGE and not (alive and owner == self._granted["owner"]):
            self._ended, self._draining, writer = self._granted["owner"], True, NOBODY
        self._draining = self._draining and mode in FOLLOWING
        if writer != PAGE:
            other = self._other()
            free = alive and not other and not self._draining
            writer = PAGE if free else PLANNER if other else NOBODY
        self._tell(writer=writer, owner=owner if writer == PAGE else 0)
        if writer == PAGE or self._draining:
            self._fill(writer == PAGE and self._commits > 0, age)

    def _other(self) -> bool:
        """Whether a planner is alive, or a Modbus client has the right to be one."""
        place = self._heartbeat
        return self._claimed() or bool(self._status[place] == OK and 0 <= self._age[place] < self._late)

    def _fill(self, follow: bool, age: int) -> None:
        value, status = self._start, Status.NEVER
        if follow:
            value, status = np.frombuffer(self._newest, "<f8", len(HOLDING), VALUES_AT), Status.OK
        self._value[TARGETS], self._status[TARGETS] = value, status
        self._age[TARGETS] = age if follow else -1

    def _force(self, now: int, mode: int) -> None:
        number = self._force_number
        if not number and not self._granted["forcing"]:
            return
        stale = now - self._stamp_ns > self._late * PERIOD_NS
        ended = number == self._granted["force_ended"] or stale or mode != STANDBY
        if number and ended:  # it does not come back with STANDBY: a new one must be asked for
            self._tell(forcing=0, force_ended=number)
            return
        self._tell(forcing=number)
        asked: Any = np.frombuffer(self._newest, HMI)[0]
        chosen = asked["forced"].astype(bool) & self._may_be_forced
        self._value[chosen] = asked["value"][chosen]
        self._age[chosen], self._status[chosen] = 0, Status.FORCED

    def _tell(self, **changes: int) -> None:
        if any(self._granted[key] != value for key, value in changes.items()):
            self._granted |= {key: int(value) for key, value in changes.items()}
            self._grant.write(np.array(tuple(self._granted.values()), GRANT))

    def _show(self) -> None:
        found, granted = self._found, self._granted
        self.settle()
        head = SEEN_HEAD.pack(
            time.monotonic_ns(),
            time.time_ns(),
            granted["writer"],
            granted["forcing"],
            found.ticks,
            found.overruns,
            found.stolen,
            found.skipped,
            self._unrecorded(),
            found.lateness.largest_ns,
            max(found.other_work.largest_ns, found.policy_work.largest_ns),
        )
        self._ladder(self._inputs, self._told)
        counted = (*self._counts, flat(self.frames), self._refused())
        self.seen.write(b"".join((head, *counted, flat(self._told), self._came, self._sent)))


def _bytes(times: Histogram) -> memoryview:
    """The counts for a display, as they lie in memory."""
    return memoryview(times.coarse).cast("B")
