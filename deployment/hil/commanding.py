"""Who commands beside CAN and Modbus, in a process of its own: the operator's page, or a ROS 2 publisher.

`python -m deployment.hil.commanding page PORT TOKEN` or `… ros2 DOMAIN`: asks for one target and gives its
signs of life ten times a second until it is ended.
"""

import json
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from deployment.hil.rig import HOST, Rig
from runtime.helpers import ROOT
from runtime.hmi.cells import GRANT, Writer, join_grant, state_of
from runtime.interfaces.seats import granted, join_granted
from specs import ros2
from specs.errors import RunError

PAGE, ROS2 = "page", "ros2"
KINDS = (PAGE, ROS2)
BEAT_S = 0.1
TARGET = {"target_x": 6.0, "target_y": 7.0, "target_z": 4.0}
WAIT_S = 10.0


@contextmanager
def commanding(rig: Rig, kind: str) -> Iterator[None]:
    """The process; RunError if it does not have the right to command from the beginning to the end."""
    setting, supervisor = rig.setting, rig.supervisor
    at = (str(setting.hmi), supervisor.tokens["operator"]) if kind == PAGE and supervisor else ()
    at = at or (str(setting.interfaces.domain if setting.interfaces else 0),)
    process = subprocess.Popen([sys.executable, "-m", "deployment.hil.commanding", kind, *at], cwd=ROOT)
    try:
        rig.await_true(lambda: commands(rig, kind), f"the right to command of {kind}")
        yield
        if not commands(rig, kind):
            raise RunError(f"{kind} lost the right to command")
    finally:
        process.kill()
        process.wait()


def commands(rig: Rig, kind: str) -> bool:
    """Whether that client has the right to command."""
    cell = join_grant(rig.shared) if kind == PAGE else join_granted(rig.shared)
    if cell is None:
        return False
    try:
        found = state_of(cell, GRANT) if kind == PAGE else None
        return bool(found["writer"] == Writer.HMI) if found is not None else granted(cell) != (0, 0)
    finally:
        cell.close()


def page(port: int, token: str) -> None:
    """What the page sends."""

    def ask(path: str, body: Any, session: str = "") -> Any:
        head = {"Content-Type": "application/json", "Authorization": f"Bearer {session}"}
        request = urllib.request.Request(f"http://{HOST}:{port}/api/{path}", json.dumps(body).encode(), head)
        with urllib.request.urlopen(request, timeout=WAIT_S) as answer:
            return json.loads(answer.read())

    session = ask("session", {"token": token, "name": "bench"})["session"]
    ask("control", {}, session)
    ask("target", TARGET, session)
    while True:
        ask("beat", {}, session)
        time.sleep(BEAT_S)


def publisher(domain: int) -> None:
    """Targets of a ROS 2 node, which are its signs of life."""
    from runtime.ros2 import loopback

    loopback.settings()
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from runtime.ros2.wire import message, qos, topic_name

    participant = DomainParticipant(domain)
    topic = Topic(participant, topic_name("/slewright/target"), message(ros2.TARGET))
    writer = DataWriter(participant, topic, qos(ros2.TARGET))
    loopback.confine()
    stamp = message("builtin_interfaces/msg/Time")(sec=0, nanosec=0)  # none: taken as of now
    header = message("std_msgs/msg/Header")(stamp=stamp, frame_id="base")
    while True:
        writer.write(message(ros2.TARGET)(header, *TARGET.values(), True, 0.0, 1.0))
        time.sleep(BEAT_S)


if __name__ == "__main__":
    if sys.argv[1] == PAGE:
        page(int(sys.argv[2]), sys.argv[3])
    else:
        publisher(int(sys.argv[2]))
