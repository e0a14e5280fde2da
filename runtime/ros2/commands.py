"""Targets from a ROS 2 publisher: who it is, how old its message is, whether it may command."""

import time
from collections.abc import Callable, Iterable
from typing import Any

from runtime.interfaces.seats import Seat
from runtime.modbus.holding import LAPSE_NS
from runtime.ros2.messages import COMMAND
from runtime.ros2.node import Node, Peer
from runtime.ros2.wire import topic_name
from specs import ros2

TAKEN = 32  # messages of one look; older ones of a flood are lost
AHEAD_NS = 100_000_000  # for which a stamp may lie in the future
SELDOM_NS = 5_000_000_000  # between two complaints about one publisher


class Commands:
    """Reads the topic and asks at the seat; a publisher's messages are its sign of life."""

    def __init__(self, node: Node, seat: Seat, tell: Callable[[str], None]) -> None:
        self._seat = seat
        self._reader = node.subscriber(COMMAND, ros2.TARGET)
        self._names: dict[int, str] = {}
        self._refused: dict[int, str] = {}
        self._complaints = Complaints(tell)
        self.dropped = 0

    def work(self, peers: Iterable[Peer]) -> None:
        """Take what came; `peers`: publishers that came or went."""
        now, day = time.monotonic_ns(), time.time_ns()
        for peer in peers:
            if peer.gone:
                self._leave(peer.handle)
            elif peer.topic == topic_name(COMMAND):
                name, refused = f"publisher {peer.key}", peer.wrong(ros2.TARGET)
                self._names[peer.handle], self._refused[peer.handle] = name, refused
                if refused:
                    self._complaints.say(name, refused, now)
        newest: dict[int, Any] = {}
        for sample in self._reader.take(TAKEN):
            newest[sample.sample_info.publication_handle] = sample
        for handle, sample in newest.items():
            self._take(handle, sample, now, day)
        self._seat.beat(now)

    def _take(self, handle: int, sample: Any, now: int, day: int) -> None:
        name = self._names.get(handle)
        if name is None:
            return  # not told of yet: the next message counts
        reason = self._refused.get(handle, "") or stale(sample.header.stamp, day)
        if not reason:
            values = {s.name: float(getattr(sample, s.name)) for s in ros2.targets()}
            reason = self._seat.ask(name, values, now)
        if reason:
            self.dropped += 1
            self._complaints.say(name, reason, now)

    def stop(self, why: str) -> bool:
        """End the right of whoever has it, or asks for it; whether somebody did."""
        client = self._seat.client
        self._seat.release(client, f"lost the right to command: {why}")
        self._seat.beat(time.monotonic_ns())
        return bool(client)

    def _leave(self, handle: int) -> None:
        name = self._names.pop(handle, "")
        self._refused.pop(handle, None)
        self._seat.release(name, "lost the right to command: it is gone")


class Complaints:
    """Says why somebody is refused, not for every message of a flood."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._told: dict[str, int] = {}

    def say(self, name: str, reason: str, now: int) -> None:
        """Say it, unless something was said of that one a moment ago."""
        if now - self._told.get(name, -SELDOM_NS) >= SELDOM_NS:
            if len(self._told) > 64:
                self._told.clear()
            self._told[name] = now
            self._tell(f"{name} was refused: {reason}")


def stale(stamp: Any, day: int, limit_ns: int = LAPSE_NS) -> str:
    """Why a message's stamp is not of now; "" if it is, or if there is none."""
    age = day - (stamp.sec * 10**9 + stamp.nanosec)
    if not stamp.sec and not stamp.nanosec:
        return ""
    if age > limit_ns:
        return f"its message is {age / 1e9:.2f} s old"
    return f"its message is {-age / 1e9:.2f} s in the future" if age < -AHEAD_NS else ""
