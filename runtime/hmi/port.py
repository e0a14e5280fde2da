"""The control process's side of the HMI: a `Port` of the scan, after those that bring the planner's targets.

It alone decides whose targets count and what is forced; the HMI only asks.  A planner that is alive, over CAN
or Modbus, is never displaced, and neither is a page that has the right.  When a page's right ends while its
targets are followed, nothing counts until automatic operation has ended: no other target slips in.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from runtime.hmi.cells import GRANT, HMI, MESSAGES, SEEN, Writer
from runtime.image import INPUT, OUTPUT, Flag, Status, forceable, timeout_ticks
from runtime.modbus.cells import HOLDING
from runtime.modbus.port import HEARTBEAT, PERIOD_NS
from runtime.shared import Cell
from runtime.statistics import Statistics
from specs.signals import signal

EVERY, PHASE = 5, 3  # ticks between two states of `seen`; not in the ticks of the policy
MODES = {text: number for number, text in signal("control_mode").values.items()}
STANDBY, FOLLOWING = MODES["standby"], (MODES["automatic"], MODES["hold"])


class HmiPort:
    """Brings in what the page asks for, as far as it may; shows it what goes on."""

    def __init__(
        self,
        cells: tuple[Cell, Cell, Cell],
        found: Statistics,
        claimed: Callable[[], bool] = lambda: False,
        unrecorded: Callable[[], int] = lambda: 0,
    ) -> None:
        """`claimed`: whether a Modbus client has the right to write, though it may not have written yet."""
        self._seen, self._grant, self._asked = cells
        self._found, self._claimed, self._unrecorded = found, claimed, unrecorded
        self._state = np.zeros((), SEEN)
        self._granted: dict[str, int] = dict.fromkeys(GRANT.names or (), 0)
        self._owner = self._heartbeat_ns = self._commits = self._stamp_ns = self._force_number = 0
        self._newest = np.zeros((), HMI)
        self._number = -1
        self._targets = np.array([INPUT.index[s.name] for s in HOLDING], dtype=np.intp)
        self._start = np.array([s.start for s in HOLDING])
        self._heartbeat, self._late = INPUT.index[HEARTBEAT.name], timeout_ticks(HEARTBEAT)
        self._may_be_forced = np.array([forceable(s) for s in INPUT.signals])
        self._heard = np.array(list(MESSAGES.values()), dtype=np.intp)
        self._frames = np.zeros(len(MESSAGES), dtype=np.int64)
        self._mode = 0
        self._ended = 0  # the claim whose right ended last
        self._draining = False  # its targets are still being followed
        self._inputs: np.ndarray | None = None

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Put targets and forced values into the image, if they count."""
        now = time.monotonic_ns()
        self._frames += inputs["age"][self._heard] == 0
        if self._asked.number != self._number and (found := self._asked.read()):
            self._take(*found)
        self._write(inputs, now)
        self._force(inputs, now)
        self._inputs = inputs

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Note the mode; show everything, if it is time."""
        self._mode = int(outputs["value"][MODE])
        if tick % EVERY == PHASE:
            self._show(outputs)

    def flags(self) -> int:
        """FORCED."""
        return Flag.FORCED * bool(self._granted["forcing"])

    def received_ns(self) -> int:
        """No sensor comes this way."""
        return 0

    def _take(self, number: int, state: bytes) -> None:
        """A state of hmi.cell; plain numbers of it are kept, for reading them from an array takes long."""
        self._number, self._newest = number, np.frombuffer(state, HMI)[0]
        targets: Any = self._newest["targets"]
        self._owner, self._commits = int(targets["owner"]), int(targets["commits"])
        self._heartbeat_ns, self._stamp_ns = int(targets["heartbeat_ns"]), int(targets["stamp_ns"])
        self._force_number = int(self._newest["force_number"])

    def _write(self, inputs: np.ndarray, now: int) -> None:
        writer = self._granted["writer"]
        owner, age = self._owner, (now - self._heartbeat_ns) // PERIOD_NS
        alive = bool(owner) and owner != self._ended and 0 <= age < self._late
        if writer == Writer.HMI and not (alive and owner == self._granted["owner"]):
            self._ended, self._draining, writer = self._granted["owner"], True, Writer.NOBODY
        self._draining = self._draining and self._mode in FOLLOWING
        if writer != Writer.HMI:
            other = self._claimed() or self._planner_alive(inputs)
            free = alive and not other and not self._draining
            writer = Writer.HMI if free else Writer.PLANNER if other else Writer.NOBODY
        self._tell(writer=writer, owner=owner if writer == Writer.HMI else 0)
        if writer == Writer.HMI or self._draining:
            follow = writer == Writer.HMI and self._commits
            self._fill(inputs, self._newest["targets"] if follow else None, age)

    def _planner_alive(self, inputs: np.ndarray) -> bool:
        place = self._heartbeat
        return inputs["status"][place] == Status.OK and 0 <= inputs["age"][place] < self._late

    def _fill(self, inputs: np.ndarray, targets: Any, age: int) -> None:
        if targets is None:
            inputs["value"][self._targets], inputs["age"][self._targets] = self._start, -1
            inputs["status"][self._targets] = Status.NEVER
        else:
            inputs["value"][self._targets], inputs["age"][self._targets] = targets["value"], age
            inputs["status"][self._targets] = Status.OK

    def _force(self, inputs: np.ndarray, now: int) -> None:
        number = self._force_number
        if not number and not self._granted["forcing"]:
            return
        stale = now - self._stamp_ns > self._late * PERIOD_NS
        ended = number == self._granted["force_ended"] or stale or self._mode != STANDBY
        if number and ended:
            self._tell(
                forcing=0, force_ended=number
            )  # it does not come back with STANDBY: a new one must be asked for
            return
        self._tell(forcing=number)
        chosen = self._newest["forced"].astype(bool) & self._may_be_forced
        inputs["value"][chosen] = self._newest["value"][chosen]
        inputs["age"][chosen], inputs["status"][chosen] = 0, Status.FORCED

    def _tell(self, **changes: int) -> None:
        if any(self._granted[key] != value for key, value in changes.items()):
            self._granted |= {key: int(value) for key, value in changes.items()}
            self._grant.write(np.array(tuple(self._granted.values()), GRANT))

    def _show(self, outputs: np.ndarray) -> None:
        state, work, found = self._state, self._state["work"], self._found
        state["stamp_ns"], state["day_ns"] = time.monotonic_ns(), time.time_ns()
        state["writer"], state["forcing"] = self._granted["writer"], self._granted["forcing"]
        for key in ("ticks", "overruns", "stolen", "skipped"):
            work[key] = getattr(found, key)
        work["unrecorded"] = self._unrecorded()
        work["late"], work["late_largest_ns"] = found.lateness.coarse, found.lateness.largest_ns
        ours, policy = found.other_work, found.policy_work
        work["work"] = [a + b for a, b in zip(ours.coarse, policy.coarse, strict=True)]
        work["work_largest_ns"] = max(ours.largest_ns, policy.largest_ns)
        work["heard"] = self._frames
        state["inputs"], state["outputs"] = self._inputs, outputs
        self._seen.write(state)


MODE = OUTPUT.index["control_mode"]
