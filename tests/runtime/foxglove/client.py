"""Foxglove's WebSocket protocol as a client of our own speaks it, over tornado: none of the SDK's code.

Source: github.com/foxglove/ws-protocol, docs/spec.md (version 1): text frames are JSON with `op`; binary
frames begin with an opcode: 1 message data (subscription u32, time u64, payload),
4 asset (request u32, status u8).
"""

import asyncio
import json
import struct
from collections.abc import Callable
from typing import Any

from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClientConnection, websocket_connect

PROTOCOLS = ["foxglove.sdk.v1"]


class Client:
    """A connection: channels by topic, messages by topic, texts of the server."""

    def __init__(self, port: int) -> None:
        self._url = f"ws://127.0.0.1:{port}"
        self.channels: dict[str, Any] = {}
        self.messages: dict[str, list[bytes]] = {}
        self.assets: dict[int, tuple[int, bytes]] = {}
        self.told: list[dict[str, Any]] = []
        self._topics: dict[int, str] = {}
        self._connection: WebSocketClientConnection | None = None

    async def open(self) -> "Client":
        self._connection = await websocket_connect(HTTPRequest(self._url), subprotocols=PROTOCOLS)
        return self

    async def send(self, **message: Any) -> None:
        await self.raw(json.dumps(message))

    async def raw(self, data: str | bytes) -> None:
        assert self._connection
        await self._connection.write_message(data, binary=isinstance(data, bytes))

    async def subscribe(self, *topics: str) -> None:
        wanted = [{"id": i + 1, "channelId": self.channels[t]["id"]} for i, t in enumerate(topics)]
        self._topics = {i + 1: t for i, t in enumerate(topics)}
        await self.send(op="subscribe", subscriptions=wanted)

    async def read(self) -> bool:
        """Take the next frame; False when the connection has ended."""
        assert self._connection
        frame = await self._connection.read_message()
        if frame is None:
            return False
        if isinstance(frame, str):
            self._text(json.loads(frame))
        elif frame[0] == 1:
            subscription, _ = struct.unpack_from("<IQ", frame, 1)
            self.messages.setdefault(self._topics[subscription], []).append(frame[13:])
        elif frame[0] == 4:
            request, status, error = struct.unpack_from("<IBI", frame, 1)
            self.assets[request] = status, frame[10 + error :]
        return True

    def _text(self, told: dict[str, Any]) -> None:
        self.told.append(told)
        if told["op"] == "advertise":
            self.channels |= {c["topic"]: c for c in told["channels"]}

    async def until(self, true: Callable[[], Any], each: Callable[[], None] = lambda: None) -> Any:
        """Read frames until something is true; `each` is done again and again meanwhile."""

        async def beat() -> None:
            while True:
                each()
                await asyncio.sleep(0.02)

        beating = asyncio.ensure_future(beat())
        try:
            while not (found := true()):
                assert await asyncio.wait_for(self.read(), 60), "the server hung up"
        finally:
            beating.cancel()
        return found

    def close(self) -> None:
        if self._connection:
            self._connection.close()
