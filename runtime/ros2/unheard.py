"""Whom nobody hears, and why: DDS says nothing of a publisher whose messages it does not bring."""

from collections.abc import Callable, Iterable

from runtime.ros2.commands import Complaints
from runtime.ros2.node import Node, Peer
from runtime.ros2.reader import Reader

FITS_NS = 2_000_000_000  # that both sides may take to find each other
UNKNOWN = "its quality of service or the fields of its type do not fit"


class Unheard:
    """Looks at publishers on the node's topics; another type is for those to refuse who read them."""

    def __init__(self, node: Node, tell: Callable[[str], None]) -> None:
        self._node, self._complaints = node, Complaints(tell)
        self._new: dict[int, tuple[Peer, int]] = {}  # publishers, and since when they are known
        self._names: dict[int, str] = {}
        self._garbled = 0

    def work(self, peers: Iterable[Peer], now: int) -> None:
        """Say of whom nothing comes, or nothing that can be read; `peers`: who came or went."""
        topics = {reader.topic: reader for reader in self._node.readers}
        for peer in peers:
            self._new.pop(peer.handle, None)
            self._names.pop(peer.handle, None)
            if peer.topic in topics:
                self._new[peer.handle] = peer, now
                self._names[peer.handle] = f"publisher {peer.key}"
        for peer, since in [*self._new.values()]:
            if now - since >= FITS_NS:
                del self._new[peer.handle]
                self._judge(peer, topics[peer.topic], now)
        for reader in topics.values():
            for handle, why in reader.unreadable().items():
                name = self._names.get(handle, "a publisher that is gone")
                self._complaints.say(name, f"its message on {reader.topic} cannot be read: {why}", now)
        if more := self._node.garbled - self._garbled:
            self._garbled += more
            self._complaints.say("a publisher", "its announcement cannot be read: text that is no UTF-8", now)

    def _judge(self, peer: Peer, reader: Reader, now: int) -> None:
        if not (peer.wrong(reader.kind) or reader.hears(peer.handle)):
            said = f"nothing of it comes on {reader.topic}: {peer.apart or UNKNOWN}"
            self._complaints.say(f"publisher {peer.key}", said, now)
