"""The Modbus process: `python -m runtime.modbus.process '{"folder": …, "host": …, "port": …, "tls": …}'`.

It joins the cells in `folder` (runtime/modbus/cells.py) and serves until SIGTERM.  Port 0 takes any; the
ports had are written to the file `ports` as JSON: {"plain": …, "tls": …}.
"""

import asyncio
import json
import logging
import signal
from pathlib import Path

from runtime.helpers import end_with, run, told_to_end
from runtime.hmi.cells import join_grant
from runtime.interfaces.seats import join_granted
from runtime.modbus.cells import BEAT_S, join
from runtime.modbus.roles import context
from runtime.modbus.server import Desk, Server
from runtime.modbus.told import Teller, open_told, to_console


def main(text: str) -> None:
    """Serve until told to end."""
    end_with(signal.SIGTERM)
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # who sends nonsense must not fill our disk
    told = json.loads(text)
    asyncio.run(_serve(told))


async def _serve(told: dict) -> None:
    tls = told.get("tls")
    secure = context(Path(tls["certificate"]), Path(tls["key"]), Path(tls["authority"])) if tls else None
    folder = Path(told["folder"])
    teller = Teller(open_told(folder), to_console)
    desk = Desk(*join(folder), join_grant(folder), teller, join_granted(folder))
    server = Server(desk, told["host"], told["port"], tls["port"] if tls else 0, secure)
    ports = await server.listen()
    if told.get("ports"):
        Path(told["ports"]).write_text(json.dumps(dict(zip(("plain", "tls"), ports, strict=False))))
    stop = asyncio.Event()
    watching = asyncio.ensure_future(_watch(stop))
    await server.serve(stop)
    watching.cancel()


async def _watch(stop: asyncio.Event) -> None:
    """The signal only leaves a note, and may come before the loop is there."""
    while not told_to_end():
        await asyncio.sleep(BEAT_S)
    stop.set()


if __name__ == "__main__":
    run(main)
