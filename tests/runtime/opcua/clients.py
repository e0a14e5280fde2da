"""Clients of the OPC UA server beside a machine that ticks, and the ports of its control process."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.image import INPUT, Status
from runtime.interfaces import seats
from runtime.interfaces.port import Asked, SeatsPort
from runtime.interfaces.publish import create
from runtime.shared import Cell
from specs.opcua import NAMESPACE
from tests.runtime.bundles import core
from tests.runtime.interfaces.beside import Beside


class Both:
    """The control process's ports: seats and images."""

    def __init__(self, folder: Path) -> None:
        from runtime.interfaces.publish import ImagePort

        seats.create(folder, ("opcua",))
        granted = seats.join_granted(folder)
        assert granted
        self.granted: Cell = granted
        self.seats = SeatsPort([Asked(1, seats.join(folder, "opcua"))], granted, core("pd").library)
        self.images = ImagePort(create(folder))

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        places = [INPUT.at(s.name) for s in seats.HOLDING]
        inputs["status"][places], inputs["age"][places] = Status.NEVER, -1  # no planner over CAN
        self.seats.receive(inputs, tick)
        self.images.receive(inputs, tick)

    def send(self, outputs: np.ndarray, tick: int) -> None:
        self.seats.send(outputs, tick)
        self.images.send(outputs, tick)


@asynccontextmanager
async def connected(served: Beside, papers: dict[str, Any], who: str = ""):
    """A client, with the certificate of `who` or none; the machine ticks meanwhile."""
    asyncua: Any = pytest.importorskip("asyncua")
    client = asyncua.Client(f"opc.tcp://127.0.0.1:{served.ready}/slewright")
    client.application_uri = "urn:test:client"
    if who:
        certificate, key = papers[who]
        pem = key.with_suffix(".key.pem")  # asyncua goes by the ending
        pem.write_bytes(key.read_bytes())
        await client.set_security_string(f"Basic256Sha256,SignAndEncrypt,{certificate},{pem}")
    beating = asyncio.ensure_future(ticking(served))
    try:
        async with client:
            yield client, await client.get_namespace_index(NAMESPACE)
    finally:
        beating.cancel()


async def ticking(served: Beside) -> None:
    while True:
        served.publish()
        await asyncio.sleep(0.02)


async def until(true: Callable[[], Awaitable[Any]]) -> Any:
    end = time.monotonic() + 60
    while not (found := await true()):
        assert time.monotonic() < end
        await asyncio.sleep(0.05)
    return found


def told(served: Beside) -> str:
    """What the interface has told, in lines."""
    from runtime.interfaces.told import Listener

    return "\n".join(event["what"] for event in Listener(served.folder, "opcua").new())
