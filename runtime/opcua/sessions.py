"""Sessions: whose they are, how many there may be, and that each stays with its own connection.

asyncua lets a connection take over a session, or its subscriptions, by numbers that anybody can guess, and
keeps a session whose connection has ended for minutes.  Here neither is moved: a client that lost its
connection makes a new session.
"""

import logging
from collections.abc import Awaitable, Callable
from contextvars import ContextVar
from typing import Any, ClassVar

from asyncua import ua as types
from asyncua.common.utils import ServiceError
from asyncua.server.internal_server import InternalServer
from asyncua.server.internal_session import InternalSession

ua: Any = types  # its declared types leave out much of what it takes

CODES = ua.StatusCodes
SESSIONS, KEPT = 32, 8  # of them for certificates with a role
SUBSCRIPTIONS = 16  # of a session
CONNECTIONS = 256
UNREAD_BYTES = 8 << 20  # that may wait for a client that does not take its answers
IDLE_S = 5.0  # for which a connection may be without a session
TIMEOUT_MS = 60_000.0  # for which a session may say nothing, one whose connection has ended among them
ACKNOWLEDGE = ua.NodeId(ua.ObjectIds.AcknowledgeableConditionType_Acknowledge)
CALLING: ContextVar[Any] = ContextVar("calling")  # the session that calls


class Session(InternalSession):
    """A session whose methods know who calls them, and whose subscriptions nobody else touches."""

    iserver: "Sessions"

    async def call(self, params: Any) -> Any:
        """asyncua's, with the session in CALLING; alarms are no nodes, and are acknowledged here."""
        CALLING.set(self)
        found: list[Any] = []
        for request in params:
            if request.MethodId == ACKNOWLEDGE:
                code = await self.iserver.acknowledge(self, request)
                found.append(ua.CallMethodResult(ua.StatusCode(code)))
            else:
                found += await super().call([request])
        return found

    async def write(self, params: Any) -> Any:
        """asyncua's, which refuses all of it; that is told."""
        found = await super().write(params)
        for wanted, code in zip(params.NodesToWrite, found, strict=False):
            if not code.is_good():
                self.iserver.tell(f"{client_of(self)} was refused to write {wanted.NodeId.to_string()}")
        return found

    def activate_session(self, params: Any, peer_certificate: bytes | None) -> Any:
        """asyncua's, while there is room for such a client."""
        if self not in self.iserver.active and not self.iserver.has_room(peer_certificate):
            raise ServiceError(CODES.BadMaxConnectionsReached)
        found = super().activate_session(params, peer_certificate)
        self.iserver.active.add(self)
        return found

    async def close_session(self, delete_subs: bool = True) -> None:
        """asyncua's; what the client commanded lapses with it."""
        self.iserver.active.discard(self)
        self.iserver.gone(self)
        await super().close_session(delete_subs)

    async def create_subscription(self, params: Any, callback: Any, request_callback: Any = None) -> Any:
        """asyncua's, up to so many."""
        known = self.subscription_service.subscriptions.values()
        if sum(s.session_id == self.session_id for s in known) >= SUBSCRIPTIONS:
            raise ServiceError(CODES.BadTooManySubscriptions)
        return await super().create_subscription(params, callback, request_callback)

    async def transfer_subscriptions(self, params: Any, callback: Any) -> Any:
        """None is."""
        raise ServiceError(CODES.BadServiceUnsupported)

    async def delete_subscriptions(self, ids: Any) -> Any:
        """asyncua's, of its own ones."""
        self._check(*ids)
        return await super().delete_subscriptions(ids)

    def modify_subscription(self, params: Any) -> Any:
        """asyncua's, of its own ones."""
        self._check(params.SubscriptionId)
        return super().modify_subscription(params)

    async def set_publishing_mode(self, params: Any) -> Any:
        """asyncua's, of its own ones."""
        self._check(*params.SubscriptionIds)
        return await super().set_publishing_mode(params)

    async def create_monitored_items(self, params: Any) -> Any:
        """asyncua's, in its own subscriptions."""
        self._check(params.SubscriptionId)
        return await super().create_monitored_items(params)

    async def modify_monitored_items(self, params: Any) -> Any:
        """asyncua's, in its own subscriptions."""
        self._check(params.SubscriptionId)
        return await super().modify_monitored_items(params)

    async def set_monitoring_mode(self, params: Any) -> Any:
        """asyncua's, in its own subscriptions."""
        self._check(params.SubscriptionId)
        return await super().set_monitoring_mode(params)

    async def delete_monitored_items(self, params: Any) -> Any:
        """asyncua's, in its own subscriptions."""
        self._check(params.SubscriptionId)
        return await super().delete_monitored_items(params)

    def republish(self, params: Any) -> Any:
        """asyncua's, of its own ones."""
        self._check(params.SubscriptionId)
        return super().republish(params)

    def _check(self, *ids: int) -> None:
        known = self.subscription_service.subscriptions
        if any(i not in known or known[i].session_id != self.session_id for i in ids):
            raise ServiceError(CODES.BadSubscriptionIdInvalid)


class Sessions(InternalServer):
    """Makes our sessions; `gone` is told of each that ends, `acknowledge` of each call of that method."""

    gone: Callable[[Any], None] = staticmethod(lambda session: None)
    acknowledge: Callable[[Any, Any], Awaitable[int]]

    def __init__(self, users: Any, tell: Callable[[str], None]) -> None:
        """`users`: who clients are (runtime/opcua/security.py); `tell` is told who is refused."""
        super().__init__(user_manager=users)
        self.tell, self._users = tell, users
        self.active: set[Session] = set()
        self.max_connections, self.max_pending_activation_seconds = CONNECTIONS, IDLE_S
        self.max_session_timeout_ms = TIMEOUT_MS
        self.bind_condition_methods = 200  # ConditionRefresh, with events of this severity
        InternalSession.max_connections = SESSIONS

    async def tidy(self) -> None:
        """End connections whose clients do not take their answers, and sessions without a connection."""
        there = {transport.get_extra_info("peername") for transport in self.asyncio_transports}
        for session in [s for s in self.active if s.name not in there]:
            await session.close_session()
        for transport in [*self.asyncio_transports]:
            if transport.get_write_buffer_size() > UNREAD_BYTES:
                transport.abort()
                self.tell("a connection was ended: its client does not take its answers")

    def create_session(self, name: str, user: Any = None, external: bool = False) -> Session:
        """asyncua's."""
        return Session(self, self.aspace, self.subscription_service, name, user=user, external=external)

    def lookup_external_session(self, auth_token: Any) -> None:
        """None: no session moves to another connection."""

    def register_server(self, server: Any, conf: Any = None) -> None:
        """Refused: this is no discovery server, and would keep what anybody sends."""
        raise ServiceError(CODES.BadServiceUnsupported)

    def has_room(self, certificate: bytes | None) -> bool:
        """Whether there is a place for one more session of such a client; that there is none is told."""
        places = SESSIONS if self._users.has_role(certificate) else SESSIONS - KEPT
        if len(self.active) < places:
            return True
        self.tell(f"a client was refused: all {places} sessions for its kind are in use")
        return False


class Unheard(logging.Handler):
    """Tells what asyncua only logs: whose messages or connections come to nothing."""

    WHY: ClassVar[dict[str, str]] = {
        "Refusing connection": f"a connection was refused: all {CONNECTIONS} are in use",
        "Closing idle connection": f"a connection was ended: no session within {IDLE_S:g} s",
        "Inbound queue full": "a connection was ended: it asks more than is answered",
        "Unauthenticated": "a connection was ended: a channel of its kind is not offered",
    }
    SOURCES = ("asyncua.server.binary_server_asyncio", "asyncua.server.uaprocessor")

    def __init__(self, tell: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell
        for name in self.SOURCES:
            logger = logging.getLogger(name)
            logger.addHandler(self)
            logger.setLevel(logging.WARNING)
            logger.propagate = False

    def emit(self, record: logging.LogRecord) -> None:
        """Always in the same words: who tries again and again fills no log."""
        said = next((text for begin, text in self.WHY.items() if str(record.msg).startswith(begin)), "")
        wrong = record.exc_info[1] if record.exc_info else None
        if said:
            self._tell(said)
        elif type(wrong).__name__ == "InvalidSignature":
            self._tell("a client was refused: it does not have the key of its certificate")
        elif wrong is not None or str(record.msg).startswith("Got malformed"):
            self._tell("a client's message cannot be read")


def client_of(session: Any) -> str:
    """A session's client for people and for the seat: its certificate's name and the session's number."""
    return f"{getattr(session.user, 'name', '?')} (session {session.session_id.Identifier})"
