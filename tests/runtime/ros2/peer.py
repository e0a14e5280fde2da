"""A ROS 2 node's side of DDS for the tests: publishers and subscribers in this process."""

import time
from collections.abc import Callable
from typing import Any

from deployment.hil.rig import free_domain
from runtime.ros2.loopback import settings
from runtime.ros2.wire import message, qos, topic_name
from specs import ros2

DOMAINS = iter(free_domain, None)


class Peer:
    """A participant of a domain."""

    def __init__(self, domain: int) -> None:
        settings()
        from cyclonedds.domain import DomainParticipant

        self.domain, self.participant = domain, DomainParticipant(domain)
        self._kept: list[Any] = []

    def subscribe(self, name: str, kind: str, **chosen: Any) -> Any:
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        topic = Topic(self.participant, topic_name(name), message(kind))
        self._kept.append(DataReader(self.participant, topic, qos(kind, depth=10, **chosen)))
        return self._kept[-1]

    def publisher(self, name: str, kind: str, like: Any = None, chosen: Any = None) -> Any:
        """Of a type, or of the class `like` instead; with the qualities of service `chosen`."""
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic

        topic = Topic(self.participant, topic_name(name), like or message(kind))
        return DataWriter(self.participant, topic, chosen or qos(kind))


def target(x: float, stamp_ns: int | None = None, y: float = 1.0) -> Any:
    """A command, stamped now."""
    at = time.time_ns() if stamp_ns is None else stamp_ns
    header = message("std_msgs/msg/Header")(
        stamp=message("builtin_interfaces/msg/Time")(sec=at // 10**9, nanosec=at % 10**9), frame_id="base"
    )
    return message(ros2.TARGET)(header, x, y, 4.0, True, 0.0, 1.0)


def until(true: Callable[[], Any], each: Callable[[], None], seconds: float = 60.0) -> Any:
    """Do `each` until something is true, and return that."""
    end = time.monotonic() + seconds
    while not (found := true()):
        each()
        assert time.monotonic() < end
        time.sleep(0.02)
    return found
