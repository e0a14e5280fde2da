"""The OPC UA process: `python -m runtime.opcua.process JSON`, started by the supervisor.

It shows what `image.cell` holds ten times a second, takes commands through its seat (runtime/interfaces/
seats.py) and serves until SIGTERM.
"""

import asyncio
import json
import logging
import os
import signal
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from runtime.helpers import end_with, run, told_to_end
from runtime.hmi.alarms import Level
from runtime.interfaces import seats
from runtime.interfaces.beside import NICE, library, ready
from runtime.interfaces.news import Line, News
from runtime.interfaces.told import Teller
from runtime.interfaces.view import Seen, View
from specs.errors import InputError
from specs.version import VERSION

SHOWN_S = 0.1  # between two states of the nodes
BEAT_S = 0.02
MESSAGE_BYTES = 1 << 20  # of one request or answer


class Served:
    """One server: nodes, events, methods."""

    def __init__(self, told: dict[str, Any]) -> None:
        folder = Path(told["folder"])
        self.told, self.view, self.news = told, View.join(folder), News()
        self.lines: list[Line] = []
        self._teller = Teller(folder, "opcua")
        granted = seats.join_granted(folder)
        if granted is None:
            raise InputError(f"opcua: {folder} has no cell of who has the right to command")
        self.seat = seats.Seat("opcua", seats.join(folder, "opcua"), granted, self.tell)
        self._last: Seen | None = None
        self._lost = False

    def tell(self, text: str, level: Level = Level.WARNING) -> None:
        """Something happened: on the console, in the HMI's alarms, and as an event."""
        if self._teller.tell(text, level):
            self.lines.append(Line("interface", level, text))

    async def serve(self) -> None:
        """Serve until told to end."""
        from asyncua.server.server import Server

        from runtime.opcua.alarms import Events
        from runtime.opcua.methods import Methods
        from runtime.opcua.security import Users
        from runtime.opcua.sessions import Sessions, Unheard
        from runtime.opcua.space import Space

        security = self.told.get("security")
        users = Users(Path(security["authority"]) if security else None, self.tell)
        sessions = Sessions(users, self.tell)
        Unheard(self.tell)
        server = Server(iserver=sessions)
        await server.init()
        await self._set_up(server, users, security)
        space, methods = Space(), Methods(self.seat, self.tell)
        events = Events(self.tell, self._teller.acknowledge)
        await space.build(server)
        await events.build(server, space.machine)
        methods.link(server, space.methods)
        sessions.gone, sessions.acknowledge = methods.gone, events.acknowledge
        try:
            await server.start()
        except OSError as error:
            at = f"port {self.told['port']} of {self.told['host']}"
            raise InputError(f"opcua: {at} cannot be had: {error.strerror}") from None
        try:
            ready(self.told["ready"], _port(server))
            await self._go_on(space, events, sessions)
        finally:
            await server.stop()

    async def _set_up(self, server: Any, users: Any, security: dict[str, str] | None) -> None:
        from asyncua import ua as types

        ua: Any = types
        await server.set_application_uri("urn:slewright:runtime")
        server.set_server_name("Slewright")
        server.set_endpoint(f"opc.tcp://{self.told['host']}:{self.told['port']}/slewright")
        server.set_identity_tokens([ua.AnonymousIdentityToken])  # who somebody is says its channel
        server.limits.max_message_size = MESSAGE_BYTES
        server.limits.max_chunk_count = MESSAGE_BYTES // server.limits.max_recv_buffer + 1
        policies = [] if self.told["closed"] else [ua.SecurityPolicyType.NoSecurity]
        if security:
            policies.append(ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt)
            await server.load_certificate(security["certificate"], "pem")
            await server.load_private_key(security["key"], format="pem")
            server.set_certificate_validator(users.validate)
        server.set_security_policy(policies)
        await server.set_build_info("urn:slewright", "Slewright", "slewright", VERSION, "", datetime.now(UTC))

    async def _go_on(self, space: Any, events: Any, sessions: Any) -> None:
        due = 0.0
        while not told_to_end():
            self.seat.beat(time.monotonic_ns())
            await sessions.tidy()
            seen = self.view.new()
            if seen:
                self._last, self._lost = seen, False
                self.lines += self.news.of(seen)
            if seen and time.monotonic() >= due:
                due = time.monotonic() + SHOWN_S
                await space.show(seen)
            await self._look_for_loss(space)
            while self.lines:
                await events.tell(self.lines.pop(0))
            await asyncio.sleep(BEAT_S)

    async def _look_for_loss(self, space: Any) -> None:
        if self._last and self.view.stale and not self._lost:
            self._lost = True
            self.lines.append(Line("lost", Level.CRITICAL, "the control process no longer publishes"))
            await space.lost(self._last)


def _port(server: Any) -> int:
    return server.bserver._server.sockets[0].getsockname()[1]


def main(text: str) -> None:
    """Serve until told to end."""
    end_with(signal.SIGTERM)
    library("asyncua", "asyncua", "opcua")
    for name in ("asyncua", "asyncio"):  # who sends nonsense must not fill our disk
        logging.getLogger(name).setLevel(logging.CRITICAL)
    os.nice(NICE)
    asyncio.run(Served(json.loads(text)).serve())


if __name__ == "__main__":
    run(main)
