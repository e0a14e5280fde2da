"""All interfaces beside a real run on a local bus: each serves what the cycle does, and each comes back."""

import asyncio
import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest

from deployment.hil.rig import free_port
from runtime.supervisor import Supervisor
from specs import ros2
from tests.runtime.foxglove.client import Client
from tests.runtime.ros2.peer import DOMAINS, Peer
from tests.runtime.test_helpers import until
from tests.runtime.test_supervisor import machine as machine

pytest.importorskip("foxglove")
pytest.importorskip("cyclonedds")
asyncua = pytest.importorskip("asyncua")
pytestmark = pytest.mark.long


@pytest.fixture
def ports(machine: Path) -> dict[str, int]:
    """Free ports, written into the configuration."""
    found = {name: free_port() for name in ("foxglove", "opcua")}
    told = "".join(f"[{n}]\nport = {p}\n" for n, p in found.items())
    found["ros2"] = next(DOMAINS)
    machine.write_text(machine.read_text() + told + f"[ros2]\ndomain = {found['ros2']}\ncommands = true\n")
    return found


async def foxglove_ticks(port: int) -> None:
    client = await Client(port).open()
    await client.until(lambda: "/tick" in client.channels)
    await client.subscribe("/tick")
    await client.until(lambda: len(client.messages.get("/tick", ())) > 20)
    client.close()


async def opcua_beats(port: int) -> None:
    async with asyncua.Client(f"opc.tcp://127.0.0.1:{port}/slewright") as client:
        node: Any = client.get_node(
            f"ns={await client.get_namespace_index('urn:slewright:machine')};s=Status.controller_heartbeat"
        )
        first = await node.read_value()
        while await node.read_value() == first:
            await asyncio.sleep(0.05)


def test_each_serves_and_one_that_was_killed_comes_back(machine: Path, ports: dict[str, int]):
    with Supervisor(machine) as supervisor:
        until(lambda: supervisor.watch() is None and supervisor.now().ticks > 0)
        asyncio.run(foxglove_ticks(ports["foxglove"]))
        asyncio.run(opcua_beats(ports["opcua"]))
        reader = Peer(ports["ros2"]).subscribe("/slewright/signals", ros2.SIGNALS)
        until(lambda: reader.take(1))
        for name in ("foxglove", "opcua", "ros2"):
            helper = next(h for h in supervisor.helpers if h.name == name)
            before = helper.pid
            os.kill(before, signal.SIGKILL)
            ticks = supervisor.now().ticks
            until(lambda h=helper, b=before: supervisor.watch() is None and h.pid != b)
            until(lambda t=ticks: supervisor.now().ticks > t)  # the cycle went on
        found = supervisor.run(lambda _: None, stop=lambda: True)
    assert found["restarts"]["foxglove"] == found["restarts"]["opcua"] == found["restarts"]["ros2"] == 1
    assert json.dumps(found)
