"""Clients of the OPC UA server beside a machine that ticks."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest

from specs.opcua import NAMESPACE
from tests.runtime.interfaces.beside import Beside


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
