"""Sessions and places: nobody enters another's, spoils it, or keeps others out; who is refused is told."""

import asyncio
import time
from contextlib import suppress
from typing import Any

import pytest

from tests.runtime.interfaces.beside import Beside
from tests.runtime.opcua.clients import connected, told

asyncua = pytest.importorskip("asyncua")
ua: Any = asyncua.ua
pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    "data", [b"HELF" + bytes(60), bytes(range(256)) * 20, b"HELF\xff\xff\xff\x7f" + bytes(200)]
)
def test_nonsense_ends_its_own_connection_only(served: Beside, papers: dict[str, Any], data: bytes):
    import socket

    with socket.create_connection(("127.0.0.1", int(served.ready))) as raw:
        raw.sendall(data)
        time.sleep(0.2)

    async def look() -> None:
        async with connected(served, papers) as (client, index):
            assert await client.get_node(f"ns={index};s=Status.control_mode").read_browse_name()

    asyncio.run(look())


async def accepted(client: Any, token: int) -> bool:
    """Whether a connection of its own can take part in the session of this token."""
    request = ua.ActivateSessionRequest()
    request.Parameters.UserIdentityToken = ua.UserNameIdentityToken(UserName="x", Password=b"x")
    client.uaclient.protocol.authentication_token = ua.NodeId(token)
    with suppress(ua.UaStatusCodeError):
        await client.uaclient.protocol.send_request(request)
    try:
        await client.get_node(ua.NodeId(ua.ObjectIds.Server_ServerStatus_State)).read_value()
    except ua.UaStatusCodeError:
        return False
    return True


def test_nobody_takes_over_the_session_of_another(served: Beside, papers: dict[str, Any]):
    """asyncua numbers sessions, and an unfinished take-over had left the planner's to whoever tried."""

    async def look() -> None:
        async with connected(served, papers, "planner"):
            # ten at a time: the server ends a connection without a session after a while
            for first in range(1000, 1100, 10):
                client = asyncua.Client(f"opc.tcp://127.0.0.1:{served.ready}/slewright")
                await client.connect_socket()
                await client.send_hello()
                await client.open_secure_channel()
                try:
                    assert not [t for t in range(first, first + 10) if await accepted(client, t)]
                finally:
                    client.disconnect_socket()

    asyncio.run(look())


def test_nobody_touches_the_subscription_of_another(served: Beside, papers: dict[str, Any]):
    class Heard:
        def datachange_notification(self, node: Any, given: Any, data: Any) -> None:
            pass

    async def look() -> None:
        async with (
            connected(served, papers, "operator") as (operator, _),
            connected(served, papers) as (other, _),
        ):
            mine = await operator.create_subscription(100, Heard())
            number = mine.subscription_id
            protocol = other.uaclient
            with pytest.raises(ua.UaStatusCodeError, match="BadSubscriptionIdInvalid"):
                await protocol.delete_subscriptions([number])
            with pytest.raises(ua.UaStatusCodeError, match="BadServiceUnsupported"):
                await protocol.transfer_subscriptions(ua.TransferSubscriptionsParameters([number], True))
            for _ in range(16):
                await other.create_subscription(100, Heard())
            with pytest.raises(ua.UaStatusCodeError, match="BadTooManySubscriptions"):
                await other.create_subscription(100, Heard())
            await mine.subscribe_data_change(operator.get_node(ua.ObjectIds.Server_ServerStatus_CurrentTime))
            await mine.delete()

    asyncio.run(look())


def test_clients_without_a_role_leave_places_and_cut_ones_give_them_back(
    served: Beside, papers: dict[str, Any]
):
    class Heard:
        def datachange_notification(self, node: Any, given: Any, data: Any) -> None:
            pass

    async def entered(client: Any) -> bool:
        try:
            await client.connect()
        except ua.UaStatusCodeError:
            return False
        return True

    async def look() -> None:
        client = lambda: asyncua.Client(f"opc.tcp://127.0.0.1:{served.ready}/slewright")  # noqa: E731
        clients = [client() for _ in range(25)]
        found = [await entered(c) for c in clients]
        assert found == [True] * 24 + [False]
        async with connected(served, papers, "planner"):
            pass
        for c in clients[:24]:
            await c.create_subscription(500, Heard())  # such a session would outlive its connection
            c.uaclient.protocol.transport.abort()
        end, late = time.monotonic() + 20, client()  # sooner than they would end by themselves
        while not await entered(late):
            assert time.monotonic() < end
            await asyncio.sleep(0.2)
            late = client()
        await late.disconnect()

    asyncio.run(look())
    assert "all 24 sessions for its kind are in use" in told(served)


def test_who_takes_no_answers_is_ended(served: Beside, papers: dict[str, Any]):
    """What waits for a client must not fill the memory."""

    async def look() -> None:
        async with connected(served, papers) as (client, _):
            protocol, request = client.uaclient.protocol, ua.ReadRequest()
            large = ua.NodeId(ua.ObjectIds.OpcUa_XmlSchema)
            request.Parameters.NodesToRead = [ua.ReadValueId(NodeId=large, AttributeId=ua.AttributeIds.Value)]
            protocol.transport.pause_reading()
            said, end = "", time.monotonic() + 60
            while "does not take its answers" not in said:
                assert time.monotonic() < end
                protocol._send_request(request)
                await asyncio.sleep(0.05)
                said = told(served)

    with suppress(ConnectionError, TimeoutError):  # as the client takes leave
        asyncio.run(look())
    assert "its client does not take its answers" in told(served)


def test_who_is_refused_is_told(served: Beside, papers: dict[str, Any]):
    """A write by nobody in particular; a certificate without its key."""

    async def look() -> None:
        async with connected(served, papers) as (client, index):
            with pytest.raises(ua.UaStatusCodeError):
                await client.get_node(f"ns={index};s=Commands.u_slew").write_value(1.0)
        false = {**papers, "thief": (papers["planner"][0], papers["viewer"][1])}
        with pytest.raises((ua.UaError, ConnectionError, TimeoutError)):
            async with connected(served, false, "thief"):
                pass

    asyncio.run(look())
    said = told(served)
    assert "was refused to write ns=2;s=Commands.u_slew" in said
    assert "a client was refused: it does not have the key of its certificate" in said
