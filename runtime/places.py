"""Places for connections, on Modbus and at the operator's page: who must leave when all are taken.

Whoever stays quiet holds a place only until another one needs it, the longest quiet first; so connections
that do nothing lock nobody out.  Some places are kept for those nearer to the machine: this computer and, on
Modbus, whoever may write.  Who is in the middle of something, the writer above all, is never sent away.
"""

import socket
from collections.abc import Collection
from ipaddress import ip_address
from typing import Any, Protocol, TypeVar

KEEPALIVE = (30, 10, 3)  # s without news, s between probes, probes: then a peer that is gone is noticed


class Guest(Protocol):
    """A connection."""

    @property
    def near(self) -> bool:
        """Whether it is of this computer, or may write."""
        ...

    @property
    def heard(self) -> int:
        """When it last asked for something."""
        ...

    @property
    def busy(self) -> bool:
        """Whether it keeps its place."""
        ...


G = TypeVar("G", bound=Guest)


def is_near(address: str) -> bool:
    """Whether an address is this computer's."""
    return ip_address(address.split("%")[0]).is_loopback


def keep_alive(connection: Any) -> None:
    """Notice a peer that is gone without a word; `connection` is a socket, or asyncio's stand-in for one."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    names = ("TCP_KEEPIDLE", "TCP_KEEPINTVL", "TCP_KEEPCNT")
    for option, value in zip(names, KEEPALIVE, strict=True):
        if hasattr(socket, option):
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)


def leaves(guests: Collection[G], newcomer: G, places: int, kept: int) -> G | None:
    """Who must leave so that `newcomer` may stay: None if nobody, the newcomer if there is no other way."""
    far = [g for g in guests if not g.near]
    if len(guests) < places and (newcomer.near or len(far) < places - kept):
        return None
    many = not newcomer.near and len(far) >= places - kept
    idle = [g for g in (far if many else guests) if not g.busy]
    return min(idle, key=lambda g: g.heard, default=newcomer)
