"""The master's side of each device: found, identified, set up, started, watched; `canopen` does SDO and NMT.

A device counts once all of that is done: a number in `canopen-accepted.cell` says so to the control process,
which reads PDOs, heartbeats and emergencies itself, in its cycle (runtime/core/canopen.c).
"""

import struct
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import canopen
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from runtime.canopen import emergency
from runtime.canopen.eds import Identity
from runtime.hmi.alarms import Level
from specs.canopen import EMERGENCY, Node, definition
from specs.canopen_eds import DEVICE_TYPE, IDENTITY, Download, downloads

RESET, TO_PREOPERATIONAL, START = 0x81, 0x80, 0x01  # NMT commands
OPERATIONAL = 5
ANSWER_S = 0.3  # for an SDO
BOOT_S, STARTED_S = 2.0, 1.0  # for a device to start anew, and to say that it is operational
AGAIN_S, REFUSED_S = 1.0, 10.0  # before a device that did not answer, or was refused, is tried again
LOOK_S = 0.01
KEPT = 16  # emergencies of a device that wait to be told
Tell = Callable[[str, Level], None]


class RefusedError(Exception):
    """Why a device is not taken."""


class Slave:
    """One device; what its heartbeats say comes in another thread, and is only kept there."""

    def __init__(self, node: Node, identity: Identity, zeros: Mapping[str, float], network: Any) -> None:
        self.node, self.number = node, 0  # of the setting in force; 0: none
        self.boots, self.state, self.beat_s = 0, -1, float("-inf")
        self.emergencies: deque[bytes] = deque(maxlen=KEPT)
        self.due_s, self.asked = 0.0, False  # when it is to start anew, whether it was told to
        self._identity, self._downloads = identity, downloads(node, zeros)
        self._done_boots = 0  # boot-ups that the last setting came after
        self._remote = canopen.RemoteNode(node.id, canopen.ObjectDictionary())
        self._remote.sdo.RESPONSE_TIMEOUT = ANSWER_S
        # before the library's own, which gives up on one that is too short
        network.subscribe(EMERGENCY + node.id, lambda _, data, at: self.emergencies.append(bytes(data)))
        network.add_node(self._remote)
        self._remote.nmt.add_heartbeat_callback(self._heard)

    def _heard(self, state: int) -> None:
        self.state, self.beat_s = state, time.monotonic()
        self.boots += state == 0

    @property
    def restarted(self) -> bool:
        """Whether it has started anew since it was set up."""
        return self.boots != self._done_boots

    def silent(self, now_s: float, lost_s: float) -> bool:
        """Whether its heartbeat is late."""
        return now_s - self.beat_s > lost_s

    def adopt(self, number: int, now_s: float) -> None:
        """It was set up before this process: give it time to show that it is alive."""
        self.number, self.beat_s, self.state = number, now_s, OPERATIONAL

    def restart(self, now_s: float) -> None:
        """Tell it to start anew; its boot-up message says when it has."""
        self._command(RESET)
        self.asked, self.due_s = True, now_s + BOOT_S

    def set_up(self) -> None:
        """All that lets it count, after a boot-up; RefusedError says why it may not."""
        self._done_boots, self.asked = self.boots, False
        self._command(TO_PREOPERATIONAL)
        self._identify()
        for wanted in self._downloads:
            self._write(wanted)
        for wanted in {d.shown: d for d in self._downloads}.values():
            if (found := self._read(wanted.index, wanted.sub)) != int.from_bytes(wanted.data, "little"):
                raise RefusedError(
                    f"object {wanted.shown} says 0x{found:X} after 0x{wanted.value:X} was written"
                )
        self._command(START)
        self._await(lambda: self.state == OPERATIONAL, STARTED_S, "it does not become operational")
        if self.restarted:
            raise RefusedError("started anew while it was set up")

    def _identify(self) -> None:
        profile = self._read(DEVICE_TYPE, 0) & 0xFFFF
        if profile != self.node.device.profile:
            raise RefusedError(f"wrong device: profile {profile}, not {self.node.device.profile}")
        found = Identity(*(self._read(IDENTITY, sub) for sub in (1, 2, 3)))
        if wrong := self._identity.differs(found):
            raise RefusedError(f"wrong device: {', '.join(wrong)}")

    def _read(self, index: int, sub: int) -> int:
        try:
            return int.from_bytes(self._remote.sdo.upload(index, sub), "little")
        except SdoAbortedError as error:
            raise RefusedError(f"object 0x{index:04X}:{sub} cannot be read: {error}") from None

    def _write(self, wanted: Download) -> None:
        try:
            self._remote.sdo.download(wanted.index, wanted.sub, wanted.data)
        except SdoAbortedError as error:
            said = f"object {wanted.shown} = 0x{wanted.value:X} is not taken: {error}"
            raise RefusedError(said) from None

    def _command(self, command: int) -> None:
        self._remote.nmt.send_command(command)

    def _await(self, true: Callable[[], bool], seconds: float, otherwise: str) -> None:
        end = time.monotonic() + seconds
        while not true():
            if time.monotonic() > end:
                raise SdoCommunicationError(otherwise)
            time.sleep(LOOK_S)


class Master:
    """All devices; `step` does what is to be done now."""

    def __init__(
        self,
        network: Any,
        identities: Mapping[str, Identity],
        zeros: Mapping[str, float],
        tell: Tell,
        publish: Callable[[list[int]], None],
    ) -> None:
        self._network, self._tell, self._publish = network, tell, publish
        self.slaves = [Slave(n, identities[n.name], zeros, network) for n in definition().nodes]
        self._lost_s = definition().bus.lost_ms / 1000
        self._number = 0

    def adopt(self, accepted: list[int], spent: list[int]) -> None:
        """What a process before this one has set up goes on as it is."""
        self._number = max([0, *accepted, *spent])
        for slave, number, over in zip(self.slaves, accepted, spent, strict=True):
            if number and number != over:
                slave.adopt(number, time.monotonic())
        self._say()

    def step(self, spent: list[int]) -> None:
        """Look at every device once; `spent`: settings that the control process no longer believes in."""
        for slave, over in zip(self.slaves, spent, strict=True):
            while slave.emergencies:
                self._tell(f"{slave.node.name}: {emergency.text(slave.emergencies.popleft())}", Level.WARNING)
            now = time.monotonic()
            if slave.number and (why := self._lost(slave, over, now)):
                self._drop(slave)
                self._tell(f"{slave.node.name}: {why}; it is set up anew", Level.WARNING)
            if not slave.number and slave.restarted:
                self._set_up(slave)
            elif not slave.number and now >= slave.due_s:
                if slave.asked:
                    self._tell(f"{slave.node.name} is missing: no boot-up message", Level.WARNING)
                slave.restart(now)

    def stop(self) -> None:
        """All devices back to pre-operational: nobody sends them commands any more."""
        self._network.nmt.send_command(TO_PREOPERATIONAL)

    def _lost(self, slave: Slave, over: int, now_s: float) -> str:
        """Why a device that counted does not any more; "" if it does."""
        if slave.restarted:
            return "it started anew by itself"
        if slave.silent(now_s, self._lost_s):
            return f"no heartbeat for {1000 * self._lost_s:.0f} ms"
        if slave.state != OPERATIONAL:
            return "it is no longer operational"
        return "the controller missed its heartbeat" if over == slave.number else ""

    def _set_up(self, slave: Slave) -> None:
        try:
            slave.set_up()
        except RefusedError as error:
            slave.due_s = time.monotonic() + REFUSED_S
            self._tell(f"{slave.node.name} is refused: {error}", Level.WARNING)
        except (SdoCommunicationError, struct.error, ValueError, LookupError) as error:  # or answers nonsense
            slave.due_s = time.monotonic() + AGAIN_S
            self._tell(f"{slave.node.name} does not answer: {error}", Level.WARNING)
        else:
            self._number += 1
            slave.number = self._number
            self._say()
            self._tell(f"{slave.node.name} is set up and operational", Level.NOTE)

    def _drop(self, slave: Slave) -> None:
        slave.number, slave.due_s = 0, 0.0
        self._say()

    def _say(self) -> None:
        self._publish([slave.number for slave in self.slaves])
