"""A policy outside for the faults: `python -m deployment.faults.policies DOMAIN NAME`.

NAME is a fault.  A node that is well commands until a line comes on standard input; then it does what the
fault says.  Where the fault is somebody else's, a second process attacks: `--other`.
"""

import math
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from deployment.hil.punctual import LATE, Punctual
from runtime.interfaces.outside import HEARTBEAT
from runtime.ros2 import loopback
from specs import ros2

TOPIC, ROLE, STRANGER = "/slewright/policy", "/swing/policy", "/swing/stranger"
ASKED = 0.71875  # policy_u_slew of attackers, and of nobody else
SWAY, SWAY_S = 0.3, 4.0  # joystick of the one that is well, to and fro
BEATS, FLOOD, PERIOD_S = 251, 2000, 0.1
ATTACK_S = 0.8


def node(domain: int, name: str, kind: str = ros2.POLICY) -> Any:
    """A node that publishes on the topic."""
    from runtime.ros2.node import Node

    made = Node(domain, name)
    made.publisher(TOPIC, kind)
    made.announce()
    return made


def command(u: float, beat: int, age_s: float = 0.0) -> Any:
    """A command, made `age_s` ago."""
    from runtime.ros2.messages import header
    from runtime.ros2.wire import message

    stamp = header(time.time_ns() - round(1e9 * age_s), "base")
    return message(ros2.POLICY)(stamp, u, 0.0, 0.0, beat % BEATS)


def well(beat: int) -> Any:
    """The command of a policy that is well."""
    return command(SWAY * math.sin(2.0 * math.pi * beat * PERIOD_S / SWAY_S), beat)


def _wrong(beat: int) -> Any:
    return command((math.nan, 1.5, math.inf, -2.0)[beat % 4], beat)


ILL: dict[str, Callable[[int, int], Any]] = {  # (beat, beat at which it began) -> command
    "policy_stale": lambda beat, begun: command(SWAY, beat, 1.0),
    "policy_hangs": lambda beat, begun: command(SWAY, begun),
    "policy_wrong_message": lambda beat, begun: _wrong(beat),
}


def commanding(domain: int, name: str) -> None:
    """Command at 10 Hz, and say when it was late; a line makes the node ill, if the fault is its own."""
    own, ill = node(domain, ROLE), threading.Event()
    print("ready", flush=True)
    threading.Thread(target=_listen, args=(ill,), daemon=True).start()
    punctual = Punctual(HEARTBEAT)
    beat = begun = 0
    due = time.monotonic()
    while True:
        begun = begun if ill.is_set() else beat
        own.publish(TOPIC, ILL[name](beat, begun) if ill.is_set() and name in ILL else well(beat))
        if punctual.was_late():
            print(LATE, flush=True)
        beat, due = beat + 1, due + PERIOD_S
        time.sleep(max(0.0, due - time.monotonic()))


def _listen(ill: threading.Event) -> None:
    for _ in sys.stdin:
        ill.set()
    os._exit(0)  # who started it has gone


def attacking(domain: int, name: str) -> None:
    """For each line, attack for a while, and say so."""
    os.nice(19)
    kind = "std_msgs/msg/String" if name == "policy_wrong_type" else ros2.POLICY
    names = (STRANGER, ROLE) if name == "policy_second_commander" else (STRANGER,)
    nodes = [node(domain, n, kind) for n in names]
    print("ready", flush=True)
    for _ in sys.stdin:
        _attack(nodes, name)
        print("", flush=True)


def _attack(nodes: list[Any], name: str) -> None:
    from runtime.ros2.wire import message

    if name == "policy_flood":
        for beat in range(FLOOD):
            nodes[0].publish(TOPIC, command(ASKED, beat))
        return
    end, beat = time.monotonic() + ATTACK_S, 0
    while time.monotonic() < end:
        beat += 1
        text = name == "policy_wrong_type"
        for each in nodes:
            each.publish(TOPIC, message("std_msgs/msg/String")("go") if text else command(ASKED, beat))
        time.sleep(PERIOD_S)


if __name__ == "__main__":
    loopback.settings()
    (attacking if "--other" in sys.argv else commanding)(int(sys.argv[1]), sys.argv[2])
