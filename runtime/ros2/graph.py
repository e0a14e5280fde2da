"""ROS 2's graph: which node a publisher is of, as the nodes' participants say (`ros_discovery_info`)."""

from collections import OrderedDict
from uuid import UUID

from runtime.ros2.node import GRAPH, Node
from runtime.ros2.reader import Reader
from runtime.ros2.wire import qos

PARTICIPANTS = 64  # whose nodes are kept; the one heard of longest ago is forgotten
TOPIC = "ros_discovery_info"


class Graph:
    """Names of nodes by the publishers that they say are theirs.

    Nobody proves a name: on this computer any process can take any.  It keeps apart, it does not keep out.
    """

    def __init__(self, node: Node) -> None:
        quality = qos(GRAPH, PARTICIPANTS, latched=True, hashed=False)
        self._reader = Reader(node.participant, TOPIC, GRAPH, quality)
        self._nodes: OrderedDict[bytes, dict[bytes, str]] = OrderedDict()

    def look(self) -> None:
        """Take what is new."""
        for told in self._reader.take(PARTICIPANTS):
            participant = bytes(told.gid.data)
            self._nodes[participant] = _publishers(told)
            self._nodes.move_to_end(participant)
        while len(self._nodes) > PARTICIPANTS:
            self._nodes.popitem(last=False)

    def node_of(self, publisher: UUID) -> str:
        """Full name of the node that a publisher is of; "" if nobody said so."""
        return next((n[publisher.bytes] for n in self._nodes.values() if publisher.bytes in n), "")


def _publishers(told: object) -> dict[bytes, str]:
    found = {}
    for node in told.node_entities_info_seq:  # type: ignore[attr-defined]
        name = f"{node.node_namespace.rstrip('/')}/{node.node_name}"
        found |= {bytes(gid.data): name for gid in node.writer_gid_seq}
    return found
