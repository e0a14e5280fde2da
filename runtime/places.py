"""Places for connections, on Modbus and at the operator's page: who must leave when all are taken.

Whoever stays quiet holds a place only until another one needs it, the longest quiet first; so connections that
do nothing lock nobody out.  Some places are kept for those nearer to the machine: this computer and, on
Modbus, whoever may write.  Who is in the middle of something, the writer above all, is never sent away.
"""

from collections.abc import Collection
from typing import Protocol, TypeVar

KEEPALIVE = (30, 10, 3)  # s without news, s between probes, probes: then a peer that is gone is noticed


class Guest(Protocol):
    """A connection."""

    near: bool  # of this computer, or with a right to write
    heard: int  # when it last asked for something
    busy: bool  # it keeps its place


G = TypeVar("G", bound=Guest)


def leaves(guests: Collection[G], newcomer: G, places: int, kept: int) -> G | None:
    """Who must leave so that `newcomer` may stay: None if nobody, the newcomer if there is no other way."""
    far = [g for g in guests if not g.near]
    if len(guests) < places and (newcomer.near or len(far) < places - kept):
        return None
    idle = [g for g in (guests if newcomer.near else far) if not g.busy]
    return min(idle, key=lambda g: (g.near, g.heard), default=newcomer)
