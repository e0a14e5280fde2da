"""A policy outside: commands of arm and slew from one ROS 2 node, for as long as they are fresh.

Who commands is decided here: the node that has the role, one publisher at a time.  How old its newest command
may be is judged once more in the control process (runtime/interfaces/outside.py), which does not rely on this
process, and the core's gate comes after that as after every controller.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from secrets import randbits
from typing import Any

import numpy as np

from runtime.hmi.alarms import Level
from runtime.interfaces.outside import COMMAND, COMMANDS, HEARTBEAT, LIMIT_NS
from runtime.ros2.commands import Complaints, stale
from runtime.ros2.graph import Graph
from runtime.ros2.messages import POLICY
from runtime.ros2.node import Node, Peer
from runtime.ros2.wire import topic_name
from runtime.shared import Cell
from specs import ros2

TAKEN = 64  # messages of one look, and as many may wait: a flood loses its older ones, and others' with it
FLOOD = 16  # messages of one publisher in a look
UNKNOWN_NS = 2_000_000_000  # for which a publisher's node may be unknown without a complaint


@dataclass
class Publisher:
    """One that publishes commands."""

    peer: Peer
    wrong: str  # about its type
    since_ns: int
    node: str = ""

    @property
    def name(self) -> str:
        """For people."""
        return f"publisher {self.peer.key} of {self.node or 'no known node'}"


class Right:
    """Who commands, and with what: writes the cell; no clock, no sockets."""

    def __init__(self, cell: Cell, tell: Callable[[str, Level], None]) -> None:
        self._cell, self._tell = cell, tell
        self._claims = randbits(31)  # a process that was started again must not repeat one that is over
        self.handle, self._name = 0, ""
        self._counted_ns, self._newest = 0, (0, -1.0)  # handle and heartbeat of what counted last
        self._state = np.zeros((), COMMAND)
        self._cell.write(self._state)

    def take(self, handle: int, name: str, values: dict[str, float], made_ns: int, now: int) -> str:
        """Commands of a publisher, made at `made_ns`; "" or why they do not count."""
        if reason := invalid(values):
            return reason
        if self.handle not in (0, handle):
            return f"{self._name} has the right to command"
        beat = values[HEARTBEAT.name]
        if (handle, beat) == self._newest:
            return f"its {HEARTBEAT.name} stands still at {beat:g}"
        if not self.handle:
            self._claims += 1
            self.handle, self._name = handle, name
            self._tell(f"{name} has the right to command arm and slew", Level.NOTE)
        self._counted_ns, self._newest = now, (handle, beat)
        self._state["made_ns"], self._state["owner"] = made_ns, self._claims
        self._state["value"] = [values[s.name] for s in COMMANDS]
        self._cell.write(self._state)
        return ""

    def lapse(self, now: int) -> None:
        """End the right of a publisher whose commands stopped to count."""
        if self.handle and now - self._counted_ns >= LIMIT_NS:
            self.end(f"no command that counts for {LIMIT_NS / 1e9:g} s")

    def end(self, why: str) -> None:
        """The right ends; nothing counts before somebody has it anew."""
        name, self.handle, self._name = self._name, 0, ""
        self._state["owner"] = 0
        self._cell.write(self._state)
        self._tell(f"{name} lost the right to command arm and slew: {why}", Level.WARNING)


class PolicyCommands:
    """Reads the topic; `role` is the full name of the node that may command."""

    def __init__(self, node: Node, role: str, cell: Cell, tell: Callable[..., None]) -> None:
        self._role, self._graph = role, Graph(node)
        self._reader = node.subscriber(POLICY, ros2.POLICY, TAKEN)
        self._right, self._complaints = Right(cell, tell), Complaints(tell)
        self._publishers: dict[int, Publisher] = {}

    def work(self, peers: Iterable[Peer]) -> None:
        """Take what came; `peers`: publishers that came or went."""
        now = time.monotonic_ns()
        self._graph.look()
        for peer in peers:
            if peer.gone:
                self._leave(peer.handle)
            elif peer.topic == topic_name(POLICY):
                self._publishers[peer.handle] = Publisher(peer, peer.wrong(ros2.POLICY), now)
        for publisher in self._publishers.values():
            if refused := self._refused(publisher, now):
                self._complaints.say(publisher.name, refused, now)
        self._take_all(now)
        self._right.lapse(time.monotonic_ns())

    def _refused(self, publisher: Publisher, now: int) -> str:
        """Why nothing of a publisher counts, as far as that is known by now."""
        if publisher.wrong or not publisher.peer.key:
            return publisher.wrong
        publisher.node = publisher.node or self._graph.node_of(publisher.peer.key)
        if publisher.node in ("", self._role):
            late = not publisher.node and now - publisher.since_ns > UNKNOWN_NS
            return "nobody says which node it is of" if late else ""
        return f"the role is {self._role}'s"

    def _take_all(self, now: int) -> None:
        newest: dict[int, tuple[int, Any]] = {}
        for sample in self._reader.take(TAKEN):
            handle = sample.sample_info.publication_handle
            if handle in self._publishers:
                newest[handle] = newest.get(handle, (0, None))[0] + 1, sample
        for handle, (count, sample) in newest.items():
            publisher = self._publishers[handle]
            if publisher.node != self._role or publisher.wrong:
                continue  # said of it already
            reason = self._take(handle, publisher, sample, now)
            if count >= FLOOD:
                reason = reason or f"{count} commands at once, of which the newest counts"
            if reason:
                self._complaints.say(publisher.name, reason, now)

    def _take(self, handle: int, publisher: Publisher, sample: Any, now: int) -> str:
        stamp, day = sample.header.stamp, time.time_ns()
        if not stamp.sec and not stamp.nanosec:
            return "its command says no time"
        if reason := stale(stamp, day, LIMIT_NS):
            return reason
        age = max(0, day - (stamp.sec * 10**9 + stamp.nanosec))
        values = {s.name: float(getattr(sample, s.name)) for s in COMMANDS}
        return self._right.take(handle, publisher.name, values, now - age, now)

    def stop(self, why: str) -> bool:
        """End the right of whoever has it; whether somebody did."""
        had = bool(self._right.handle)
        if had:
            self._right.end(why)
        return had

    def _leave(self, handle: int) -> None:
        self._publishers.pop(handle, None)
        if handle == self._right.handle:
            self._right.end("it is gone")


def invalid(values: dict[str, float]) -> str:
    """Why commands are refused: no number, or outside its range; "" if they are right."""
    return next((reason for s in COMMANDS if (reason := s.wrong(values[s.name]))), "")
