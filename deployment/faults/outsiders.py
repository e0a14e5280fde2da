"""Clients that attack the interfaces: `python -m deployment.faults.outsiders FOXGLOVE OPCUA DOMAIN NAME`.

As attacks.py does with Modbus: for each line on standard input an attack begins, and what went wrong in it is
said in a line (empty: nothing).  Who attacks ROS 2 asks for a target that is nobody else's: ASKED.
"""

import asyncio
import os
import random
import socket
import struct
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, suppress
from typing import Any

from deployment.faults.attacks import Attack, attacker
from deployment.hil.rig import HOST, Interfaces
from deployment.hil.watchers import Heard, foxglove
from specs import ros2

ASKED = 3.21875  # m, target_x
CONNECTIONS, FLOOD = 60, 2000
PATIENCE_S = 20.0  # for another client to be answered, on a computer that does other things
UPGRADE = (
    b"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
)


def outsider(at: Interfaces, name: str) -> AbstractContextManager[Attack]:
    """The process that attacks."""
    return attacker(at.foxglove, at.opcua, at.domain, name, module=__name__)


def _connect(port: int, stack: ExitStack) -> socket.socket:
    return stack.enter_context(socket.create_connection((HOST, port), timeout=PATIENCE_S))


def hello(port: int) -> bytes:
    """OPC UA's first message."""
    url = f"opc.tcp://{HOST}:{port}/slewright".encode()
    body = struct.pack("<5I", 0, 65536, 65536, 0, 0) + struct.pack("<I", len(url)) + url
    return b"HELF" + struct.pack("<I", 8 + len(body)) + body


def _opcua_answers(at: Interfaces, stack: ExitStack) -> str:
    end = _connect(at.opcua, stack)
    end.sendall(hello(at.opcua))
    return "" if end.recv(64)[:3] == b"ACK" else "another OPC UA client was not answered"


def _foxglove_answers(at: Interfaces) -> str:
    heard = Heard()

    async def look() -> str:
        task = asyncio.ensure_future(foxglove(at.foxglove, "other", heard))
        end = time.monotonic() + PATIENCE_S
        while not heard.counts and time.monotonic() < end and not task.done():
            await asyncio.sleep(0.02)
        task.cancel()
        return "" if heard.counts else "another Foxglove client heard nothing"

    return asyncio.run(look())


def _half_open(at: Interfaces, stack: ExitStack) -> str:
    for _ in range(CONNECTIONS):
        _connect(at.opcua, stack)
    return _opcua_answers(at, stack)


def _storm(at: Interfaces, stack: ExitStack) -> str:
    for _ in range(CONNECTIONS):
        with socket.create_connection((HOST, at.opcua), timeout=PATIENCE_S) as end:
            end.sendall(hello(at.opcua))
    return _opcua_answers(at, stack)


def _malformed(at: Interfaces, stack: ExitStack) -> str:
    for begin in (b"", b"HELF", b"OPNF", b"MSGF", hello(at.opcua)):
        end = _connect(at.opcua, stack)
        with suppress(OSError):  # it hangs up
            end.sendall(begin + random.randbytes(random.randrange(1, 4000)))
    return _opcua_answers(at, stack)


def _slow_reader(at: Interfaces, stack: ExitStack) -> str:
    for _ in range(5):
        end = _connect(at.foxglove, stack)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        end.sendall(UPGRADE)
        wanted = b'{"op":"subscribe","subscriptions":[{"id":1,"channelId":1},{"id":2,"channelId":2}]}'
        end.sendall(bytes([0x81, 0x80 | len(wanted)]) + bytes(4) + wanted)
    return _foxglove_answers(at)


def _bad_frames(at: Interfaces, stack: ExitStack) -> str:
    for _ in range(5):
        end = _connect(at.foxglove, stack)
        with suppress(OSError):
            end.sendall(UPGRADE + random.randbytes(random.randrange(1, 4000)))
    return _foxglove_answers(at)


def _publish(of: Callable[[], Any], kind: str, count: int, apart_s: float) -> Callable[..., str]:
    """An attack over ROS 2: so many messages."""

    def attack(at: Interfaces, stack: ExitStack) -> str:
        writer = _writer(at.domain, kind)
        for _ in range(count):
            writer.write(of())
            time.sleep(apart_s)
        return ""

    return attack


_kept: dict[str, Any] = {}


def _writer(domain: int, kind: str) -> Any:
    """A publisher, once made, on the topic that commands."""
    from runtime.ros2 import loopback

    loopback.settings()
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from runtime.ros2.wire import message, qos

    if kind not in _kept:
        participant = DomainParticipant(domain)
        loopback.confine()
        topic = Topic(participant, "rt/slewright/target", message(kind))
        _kept[kind] = DataWriter(participant, topic, qos(kind, reliable=False))
        time.sleep(0.3)
    return _kept[kind]


def _target(late_s: float = 0.0) -> Callable[[], Any]:
    def made() -> Any:
        from runtime.ros2.messages import header
        from runtime.ros2.wire import message

        now = header(time.time_ns() - round(1e9 * late_s), "base")
        return message(ros2.TARGET)(now, ASKED, 1.0, 4.0, True, 0.0, 1.0)

    return made


def _text() -> Any:
    from runtime.ros2.wire import message

    return message("std_msgs/msg/String")("go")


ATTACKS: dict[str, Callable[[Interfaces, ExitStack], str]] = {
    "opcua_half_open": _half_open,
    "opcua_storm": _storm,
    "opcua_malformed": _malformed,
    "foxglove_slow_reader": _slow_reader,
    "foxglove_malformed": _bad_frames,
    "ros2_flood": _publish(_target(), ros2.TARGET, FLOOD, 0.0),
    "ros2_second_writer": _publish(_target(), ros2.TARGET, 8, 0.1),
    "ros2_stale": _publish(_target(5.0), ros2.TARGET, 8, 0.1),
    "ros2_wrong_type": _publish(_text, "std_msgs/msg/String", 8, 0.1),
}

OVER_ROS2: dict[str, str] = {
    **dict.fromkeys(("ros2_flood", "ros2_second_writer", "ros2_stale"), ros2.TARGET),
    "ros2_wrong_type": "std_msgs/msg/String",
}


def main(at: Interfaces, name: str) -> None:
    """Attack for each line that comes."""
    os.nice(19)
    stack = ExitStack()
    if name in OVER_ROS2:
        _writer(at.domain, OVER_ROS2[name])  # before the attack: loading it keeps a small computer busy
    print("ready", flush=True)
    for _ in sys.stdin:
        stack.close()
        try:
            said = ATTACKS[name](at, stack)
        except OSError as error:
            said = f"the attack ended: {error}"
        print(said, flush=True)


if __name__ == "__main__":
    main(Interfaces(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])), sys.argv[4])
