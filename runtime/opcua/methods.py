"""The methods that command: who calls decides whether they do anything (runtime/opcua/security.py)."""

import asyncio
import time
from collections.abc import Callable
from typing import Any

from asyncua import ua as types

from runtime.interfaces.seats import Seat
from runtime.opcua.sessions import CALLING, client_of
from specs.opcua import METHODS, Method

ua: Any = types  # its declared types leave out much of what it takes

CODES = ua.StatusCodes
ANSWER_S = 0.5  # for which a claim waits for the control process


class Methods:
    """Links the methods to the seat."""

    def __init__(self, seat: Seat, tell: Callable[[str], None]) -> None:
        self._seat, self._tell = seat, tell

    def link(self, server: Any, nodes: dict[str, Any]) -> None:
        """Give each node of a method its action."""
        for method in METHODS:
            server.link_method(nodes[method.name], self._action(method))

    def gone(self, session: Any) -> None:
        """A session ended."""
        self._seat.release(client_of(session), "lost the right to command: its session ended")

    def _action(self, method: Method) -> Callable[..., Any]:
        async def act(parent: Any, *given: Any) -> Any:
            session = CALLING.get(None)
            if session is None or not getattr(session.user, "commands", False):
                who = getattr(session.user, "name", "somebody") if session else "somebody"
                self._tell(f"{who} was refused {method.name}: its role does not command")
                return ua.StatusCode(CODES.BadUserAccessDenied)
            return await self._do(method, client_of(session), given)

        return act

    async def _do(self, method: Method, client: str, given: tuple[Any, ...]) -> Any:
        now = time.monotonic_ns()
        if method.name == "Release":
            self._seat.release(client, "gave the right to command back")
            return []
        if method.name == "Heartbeat":
            return self._answer(method, client, self._seat.live(client, now))
        if len(given) != len(method.arguments):
            return ua.StatusCode(CODES.BadArgumentsMissing)
        if any(v.VariantType != ua.VariantType.Double or v.is_array for v in given):
            return ua.StatusCode(CODES.BadTypeMismatch)
        values = dict(zip(method.arguments, (v.Value for v in given), strict=True))
        if reason := self._seat.ask(client, values, now):
            return self._answer(method, client, reason)
        return self._answer(method, client, await self._granted(client))

    async def _granted(self, client: str) -> str:
        """Wait until the control process has given the right; why not."""
        end = time.monotonic() + ANSWER_S
        while not self._seat.has_right:
            if self._seat.client != client:  # this process was held up, and the claim has lapsed
                return "busy: its claim lapsed before it was answered"
            if time.monotonic() > end:
                why = self._seat.why_not()
                self._seat.release(client, f"was not given the right to command: {why}")
                return f"busy: {why}"
            await asyncio.sleep(0.01)
        return ""

    def _answer(self, method: Method, client: str, reason: str) -> Any:
        if not reason:
            return []
        self._tell(f"{client} was refused {method.name}: {reason}")
        busy = reason.startswith("busy") or method.name == "Heartbeat"
        return ua.StatusCode(CODES.BadUserAccessDenied if busy else CODES.BadOutOfRange)
