"""Services of the node: what it says of itself, a stop, and its parameters, read-only.

A request and its reply are messages on two topics, each with the client's id and the request's number before
the fields, as rmw_cyclonedds has them (ROS 2's other middlewares put both elsewhere: their clients find no
service here).
"""

from collections.abc import Callable, Iterable
from typing import Any

from cyclonedds.core import DDSException

from runtime.ros2.commands import Complaints
from runtime.ros2.node import CONTROLLER, Node, Peer
from runtime.ros2.parameters import Parameters
from runtime.ros2.reader import Reader
from runtime.ros2.wire import message, service_topics
from specs.ros2 import dds_type

TAKEN = 4  # requests of a service in one look
TRIGGER, SET_BOOL = "std_srvs/srv/Trigger", "std_srvs/srv/SetBool"
SWITCH = "the operator's enabling switch alone enables the machine"
Answer = Callable[[Any], dict[str, Any]]  # a request's reply, by field


class Services:
    """Serves; `work` is to be called often, and answers a few requests each time."""

    def __init__(
        self,
        node: Node,
        parameters: Parameters,
        mode: Callable[[], str],
        stop: Callable[[], bool],
        tell: Callable[[str], None],
    ) -> None:
        """`mode`: the controller's, for people; `stop`: end who commands, whether there was one."""
        self._mode, self._stop, self._tell = mode, stop, tell
        self._complaints, self.unsent = Complaints(tell), 0
        own: dict[str, tuple[str, Answer]] = {
            "mode": (TRIGGER, self._say_mode),
            "enable": (SET_BOOL, self._refuse_enabling),
            "stop": (TRIGGER, self._end_commanding),
        }
        self._served: list[tuple[str, Reader, Any, Answer]] = []
        self._types: dict[str, str] = {}
        for name, (kind, answer) in {**own, **parameters.services}.items():
            full = f"{CONTROLLER}/{name}"
            self._served.append((kind, *node.service(full, kind), answer))
            self._types[service_topics(full)[0]] = dds_type(f"{kind}_Request")

    def work(self, peers: Iterable[Peer], now: int) -> None:
        """Answer what came; `peers`: publishers that came or went."""
        for peer in peers:
            wanted = self._types.get(peer.topic, peer.type)
            if peer.type != wanted:
                self._complaints.say(f"client {peer.key}", f"it sends {peer.type}, not {wanted}", now)
        for kind, reader, writer, answer in self._served:
            for request in reader.take(TAKEN):
                self._reply(kind, writer, request, answer(request))

    def _reply(self, kind: str, writer: Any, request: Any, fields: dict[str, Any]) -> None:
        try:
            writer.write(message(f"{kind}_Response")(guid=request.guid, seq=request.seq, **fields))
        except DDSException:
            self.unsent += 1  # nobody is waited for

    def _say_mode(self, request: Any) -> dict[str, Any]:
        mode = self._mode()
        return {"success": bool(mode), "message": mode or "the control process does not publish"}

    def _refuse_enabling(self, request: Any) -> dict[str, Any]:
        self._tell(f"{CONTROLLER}/enable was refused: {SWITCH}")
        return {"success": False, "message": SWITCH}

    def _end_commanding(self, request: Any) -> dict[str, Any]:
        if self._stop():
            return {"success": True, "message": "whoever commanded over ROS 2 has lost the right"}
        return {"success": False, "message": "nobody commands over ROS 2"}
