"""The DDS side: a participant that looks like a ROS 2 node, its publishers and subscriber."""

from collections.abc import Iterator
from dataclasses import dataclass
from secrets import token_bytes
from typing import Any
from uuid import UUID

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import DDSException
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.topic import Topic

from runtime.ros2.loopback import confine
from runtime.ros2.reader import Reader
from runtime.ros2.wire import message, qos, service_topics, topic_name
from specs.ros2 import dds_type, type_hash

CONTROLLER = "/slewright/controller"  # our node
GRAPH = "rmw_dds_common/msg/ParticipantEntitiesInfo"
TYPE_HASH = "typehash="
DEPTH = 8  # targets that may wait; a publisher that floods loses the older ones
SERVICE_DEPTH = 10  # as of ROS 2's services
PEERS = 64  # that came or went, in one look
ALIVE = 16  # of an instance: its writer is there


@dataclass(frozen=True)
class Peer:
    """A publisher of somebody on the domain, as it announces itself; all empty once it is gone."""

    handle: int
    key: UUID | None = None
    topic: str = ""
    type: str = ""
    told: str = ""  # its type's hash, among others
    apart: str = ""  # why DDS may bring nothing of it: what sets its quality of service apart
    gone: bool = False

    def wrong(self, kind: str) -> str:
        """Why its messages are not ours: another type, or another version of it; "" if they are."""
        if self.type != dds_type(kind):
            return f"it publishes {self.type}, not {dds_type(kind)}"
        hashes = [p[len(TYPE_HASH) :] for p in self.told.split(";") if p.startswith(TYPE_HASH)]
        if hashes and hashes[0] != type_hash(kind):
            return f"its {kind} is of another version ({hashes[0][:15]}…, not {type_hash(kind)[:15]}…)"
        return ""


class Node:
    """The participant; what cannot be written is left out, nobody is waited for."""

    def __init__(self, domain: int, name: str = CONTROLLER) -> None:
        """`name`: of the node, in full; `loopback.settings()` comes before the first one of a process."""
        self.name = name
        self.participant = DomainParticipant(domain, Qos(Policy.Userdata(b"enclave=/;")))
        confine()
        self._writers: dict[str, Any] = {}
        self.readers: list[Reader] = []
        self._peers = BuiltinDataReader(self.participant, BuiltinTopicDcpsPublication)
        self.unsent = self.garbled = 0  # messages; announcements that could not be read

    def publisher(self, name: str, kind: str, latched: bool = False, depth: int = 1) -> None:
        """Publish on a topic from now on; `depth`: messages that wait for readers that are slow."""
        topic = Topic(self.participant, topic_name(name), message(kind))
        self._writers[name] = DataWriter(self.participant, topic, qos(kind, depth, latched))

    def subscriber(self, name: str, kind: str, depth: int = DEPTH) -> Reader:
        """Subscribe to a topic: best effort, which takes what reliable publishers send, too."""
        return self._reader(topic_name(name), kind, qos(kind, depth, reliable=False))

    def _reader(self, topic: str, kind: str, quality: Qos) -> Reader:
        self.readers.append(Reader(self.participant, topic, kind, quality))
        return self.readers[-1]

    def service(self, name: str, kind: str) -> tuple[Reader, Any]:
        """Serve `kind`, PACKAGE/srv/NAME, under a name: reader of requests and writer of replies.

        Clients of rmw_cyclonedds know by an id that both belong together.
        """
        asked, answered = service_topics(name)
        told = f"serviceid={'.'.join(f'{b:x}' for b in token_bytes(16))};"
        request, response = f"{kind}_Request", f"{kind}_Response"
        quality = [qos(k, SERVICE_DEPTH, hashed=False, told=told) for k in (request, response)]
        reader = self._reader(asked, request, quality[0])
        topic = Topic(self.participant, answered, message(response))
        self._writers[answered] = writer = DataWriter(self.participant, topic, quality[1])
        return reader, writer

    def publish(self, name: str, data: Any) -> None:
        """Write; a message that finds no room is lost."""
        try:
            self._writers[name].write(data)
        except DDSException:
            self.unsent += 1

    def announce(self) -> None:
        """Tell ROS 2's graph which node this is, and what it has (`ros2 node info`)."""
        gid = message("rmw_dds_common/msg/Gid")
        topic = Topic(self.participant, "ros_discovery_info", message(GRAPH))
        self._graph = DataWriter(self.participant, topic, qos(GRAPH, latched=True, hashed=False))
        space, _, plain = self.name.rpartition("/")
        node = message("rmw_dds_common/msg/NodeEntitiesInfo")(
            node_namespace=space or "/", node_name=plain,
            reader_gid_seq=[gid(_bytes(r.entity)) for r in self.readers],
            writer_gid_seq=[gid(_bytes(w)) for w in self._writers.values()],
        )  # fmt: skip
        told = message(GRAPH)(gid=gid(_bytes(self.participant)), node_entities_info_seq=[node])
        self._graph.write(told)

    def peers(self) -> list[Peer]:
        """Publishers that came or went since the last call."""
        found = []
        for sample in self._announced():
            info = sample.sample_info
            if info.instance_state != ALIVE or not info.valid_data:
                found.append(Peer(info.instance_handle, gone=True))
                continue
            told = next((p.data for p in sample.qos if isinstance(p, Policy.Userdata)), b"")
            said = sample.topic_name, sample.type_name, told.decode("ascii", "replace")
            found.append(Peer(info.instance_handle, sample.key, *said, apart=_apart(sample.qos)))
        return found

    def _announced(self) -> Iterator[Any]:
        """What DDS says of publishers: each by itself, as one that cannot be read takes others with it."""
        for _ in range(PEERS):
            try:
                taken = self._peers.take(1)
            except DDSException:
                raise
            except Exception:  # noqa: BLE001 - text that is no UTF-8: the library raises just this
                self.garbled += 1
                continue
            if not taken:
                return
            yield taken[0]


def _apart(quality: Qos) -> str:
    """What keeps the messages of a publisher from ROS 2's subscribers, as far as it shows."""
    for policy in quality:
        if isinstance(policy, Policy.Partition) and any(policy.partitions):
            return f"it is in DDS's partition {', '.join(policy.partitions)}"
        if isinstance(policy, Policy.DataRepresentation) and not policy.use_cdrv0_representation:
            return "it sends XCDR2 only, ROS 2 has XCDR1"
    return ""


def _bytes(entity: Any) -> list[int]:
    """An entity's GUID."""
    return list(entity.guid.bytes)
