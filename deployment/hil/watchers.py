"""Ten clients of the interfaces, in a process of their own, while the runtime's timing is measured.

`python -m deployment.hil.watchers FOXGLOVE OPCUA DOMAIN`: ports of both servers, domain of ROS 2.  It says
`ready` once every client has heard something; when its input ends, how much each heard since.
"""

import asyncio
import base64
import json
import logging
import os
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from deployment.hil.rig import HOST
from runtime.helpers import ROOT
from runtime.interfaces.view import SIGNALS
from specs import ros2
from specs.errors import RunError
from specs.opcua import NAMESPACE, node

FOXGLOVE, OPCUA, ROS2 = 4, 3, 3  # clients of each
POLL_S = 0.02
TEXT, BINARY, MASKED = 0x81, 0x82, 0x80  # of a WebSocket frame


@contextmanager
def watching(foxglove: int, opcua: int, domain: int) -> Iterator[dict[str, Any]]:
    """The process; in the end what its clients heard."""
    command = [sys.executable, "-m", "deployment.hil.watchers", *map(str, (foxglove, opcua, domain))]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    found: dict[str, Any] = {}
    try:
        if not process.stdout or not process.stdin or process.stdout.readline() != "ready\n":
            raise RunError("the clients of the interfaces did not start")
        yield found
        process.stdin.close()
        found |= json.loads(process.stdout.readline() or "{}")
    finally:
        process.kill()
        process.wait()


class Heard:
    """Messages by client."""

    def __init__(self) -> None:
        self.counts: dict[str, int] = {}

    def add(self, client: str, count: int = 1) -> None:
        """`client` heard so many more."""
        self.counts[client] = self.counts.get(client, 0) + count


async def foxglove(port: int, name: str, heard: Heard) -> None:
    """A client of the WebSocket that takes every topic."""
    reader, writer = await asyncio.open_connection(HOST, port)
    key = base64.b64encode(os.urandom(16)).decode()
    lines = (
        "GET / HTTP/1.1", f"Host: {HOST}:{port}", "Upgrade: websocket", "Connection: Upgrade",
        f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Protocol: foxglove.sdk.v1",
    )  # fmt: skip
    writer.write("\r\n".join((*lines, "", "")).encode())
    await reader.readuntil(b"\r\n\r\n")
    while True:
        kind, data = await _frame(reader)
        if kind == BINARY:
            heard.add(name)
        elif kind == TEXT and (told := json.loads(data))["op"] == "advertise":
            wanted = [{"id": c["id"], "channelId": c["id"]} for c in told["channels"]]
            writer.write(_masked(json.dumps({"op": "subscribe", "subscriptions": wanted}).encode()))


async def _frame(reader: asyncio.StreamReader) -> tuple[int, bytes]:
    kind, length = await reader.readexactly(2)
    if length == 126:
        (length,) = struct.unpack(">H", await reader.readexactly(2))
    elif length == 127:
        (length,) = struct.unpack(">Q", await reader.readexactly(8))
    return kind, await reader.readexactly(length)


def _masked(data: bytes) -> bytes:
    """A text frame of a client; a mask of zeros changes nothing."""
    return bytes([TEXT, MASKED | 126]) + struct.pack(">H", len(data)) + bytes(4) + data


async def opcua(port: int, name: str, heard: Heard) -> None:
    """A client that subscribes to every node."""
    from asyncua.client.client import Client

    class Handler:
        def datachange_notification(self, node: Any, value: Any, data: Any) -> None:
            heard.add(name)

    logging.getLogger("asyncua").setLevel(logging.ERROR)
    async with Client(f"opc.tcp://{HOST}:{port}/slewright") as client:
        index = await client.get_namespace_index(NAMESPACE)
        subscription = await client.create_subscription(100, Handler())  # type: ignore[arg-type]
        await subscription.subscribe_data_change(
            [client.get_node(f"ns={index};s={node(s)}") for s in SIGNALS]
        )
        await asyncio.Event().wait()


async def ros(domain: int, heard: Heard) -> None:
    """Subscribers of every signal, each a participant of its own."""
    from runtime.ros2 import loopback

    loopback.settings()
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    from runtime.ros2.wire import message, qos, topic_name

    readers = []
    for _ in range(ROS2):
        participant = DomainParticipant(domain)
        topic = Topic(participant, topic_name("/slewright/signals"), message(ros2.SIGNALS))
        readers.append(DataReader(participant, topic, qos(ros2.SIGNALS, 10)))
    loopback.confine()
    while True:
        for number, reader in enumerate(readers):
            heard.add(f"ros2 {number}", len(reader.take(10)))
        await asyncio.sleep(POLL_S)


async def run(ports: tuple[int, int, int]) -> dict[str, int]:
    """All clients until the input ends."""
    heard = Heard()
    tasks = [asyncio.ensure_future(foxglove(ports[0], f"foxglove {n}", heard)) for n in range(FOXGLOVE)]
    tasks += [asyncio.ensure_future(opcua(ports[1], f"opcua {n}", heard)) for n in range(OPCUA)]
    tasks.append(asyncio.ensure_future(ros(ports[2], heard)))
    while sum(count > 0 for count in heard.counts.values()) < FOXGLOVE + OPCUA + ROS2:
        if failed := next((t for t in tasks if t.done()), None):
            failed.result()
        await asyncio.sleep(POLL_S)
    print("ready", flush=True)
    before = dict(heard.counts)
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    for task in tasks:
        task.cancel()
    with suppress(asyncio.CancelledError):
        await asyncio.gather(*tasks, return_exceptions=True)
    return {name: count - before[name] for name, count in heard.counts.items()}


if __name__ == "__main__":
    os.nice(10)
    found = asyncio.run(run((int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))))
    print(json.dumps({"heard": found}), flush=True)
