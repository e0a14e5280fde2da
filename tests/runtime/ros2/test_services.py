"""Services of the ROS 2 process, started for real; requests made by hand as rmw_cyclonedds makes them."""

import json
import struct
import time
from pathlib import Path
from typing import Any

import pytest

from runtime.image import OUTPUT, Status
from specs import ros2
from tests.runtime.interfaces.beside import Beside
from tests.runtime.interfaces.both import Both
from tests.runtime.ros2.peer import DOMAINS, Peer, target, until
from tests.runtime.ros2.test_live import COMMAND, command, x

pytest.importorskip("cyclonedds")
typesys = pytest.importorskip("rosbags.typesys")
HEADER = struct.Struct("<4sQq")  # CDR little endian; client's id, number of the request
TEXTS = {  # as in ROS 2 Jazzy's packages
    "std_srvs/srv/Trigger": "---\nbool success\nstring message",
    "std_srvs/srv/SetBool": "bool data\n---\nbool success\nstring message",
    "rcl_interfaces/srv/ListParameters": "uint64 DEPTH_RECURSIVE=0\nstring[] prefixes\nuint64 depth\n---\n"
    "rcl_interfaces/ListParametersResult result",
    "rcl_interfaces/srv/GetParameters": "string[] names\n---\nrcl_interfaces/ParameterValue[] values",
    "rcl_interfaces/srv/GetParameterTypes": "string[] names\n---\nuint8[] types",
    "rcl_interfaces/srv/DescribeParameters": "string[] names\n---\n"
    "rcl_interfaces/ParameterDescriptor[] descriptors",
    "rcl_interfaces/srv/SetParameters": "rcl_interfaces/Parameter[] parameters\n---\n"
    "rcl_interfaces/SetParametersResult[] results",
    "rcl_interfaces/srv/SetParametersAtomically": "rcl_interfaces/Parameter[] parameters\n---\n"
    "rcl_interfaces/SetParametersResult result",
}
ENTRIES = {"pd_gain": {"value": 1.5, "unit": "1/s", "source": "tuned"}, "arm.rate": {"value": 0.2}}


@pytest.fixture(scope="module")
def store() -> Any:
    found = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for name, text in TEXTS.items():
        for part, half in zip(("Request", "Response"), text.split("---\n"), strict=True):
            fields = half.strip() or "uint8 structure_needs_at_least_one_member"
            found.register(typesys.get_types_from_msg(fields, f"{name.replace('/srv/', '/msg/')}_{part}"))
    return found


@pytest.fixture
def run(tmp_path: Path):
    (tmp_path / "parameters.json").write_text(json.dumps(ENTRIES))
    domain = next(DOMAINS)
    told = {"domain": domain, "commands": True, "simulated": True, "policy": "", "bundle": str(tmp_path)}
    about = {"controller": "pd", "shadow": False}
    with Beside("ros2", tmp_path, Both(tmp_path, "ros2"), **told, about=about) as served:
        yield served, Peer(domain)


def test_types_are_those_of_jazzys_srv_files_and_their_bytes_what_rosbags_writes(store: Any):
    from runtime.ros2.wire import message

    for name in (n for n in ros2.types() if "/srv/" in n):
        known = store.fielddefs[name.replace("/srv/", "/msg/")][1]
        assert [f for f, _ in ros2.types()[name]] == [f for f, _ in known], name
    ours = bytes(message("rcl_interfaces/srv/GetParameters_Request")(7, 9, ["pd_gain", "x"]).serialize())
    kind = "rcl_interfaces/msg/GetParameters_Request"
    theirs = bytes(store.serialize_cdr(store.types[kind](["pd_gain", "x"]), kind))
    assert HEADER.unpack_from(ours)[1:] == (7, 9)
    assert ours[20:].rstrip(b"\0") == theirs[4:].rstrip(b"\0")


class Client:
    """Calls a service; `guid` is its id."""

    def __init__(self, peer: Peer, name: str, kind: str, guid: int = 0x1122334455667788) -> None:
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        from runtime.ros2.wire import message, qos

        self._made, self._guid, self._seq = message(f"{kind}_Request"), guid, 0
        full = f"/slewright/controller/{name}"
        asked = Topic(peer.participant, f"rq{full}Request", self._made)
        answered = Topic(peer.participant, f"rr{full}Reply", message(f"{kind}_Response"))
        chosen = [qos(f"{kind}_{part}", 10, hashed=False) for part in ("Request", "Response")]
        self._writer = DataWriter(peer.participant, asked, chosen[0])
        self._reader = DataReader(peer.participant, answered, chosen[1])

    def __call__(self, served: Beside, *fields: Any) -> Any:
        """The reply; asks again while nobody is there, as a client that waits for the service."""
        found: list[Any] = []

        def ask() -> None:
            self._seq += 1
            self._writer.write(self._made(self._guid, self._seq, *fields))
            end = time.monotonic() + 0.5
            while not found and time.monotonic() < end:
                served.publish()
                found.extend(r for r in self._reader.take(10) if (r.guid, r.seq) == (self._guid, self._seq))
                time.sleep(0.02)

        return until(lambda: found, ask)[0]


def test_parameters_are_read_and_not_set(run: tuple[Beside, Peer]):
    from runtime.ros2.wire import message

    served, peer = run
    of = lambda name, kind: Client(peer, name, f"rcl_interfaces/srv/{kind}")  # noqa: E731
    every = of("list_parameters", "ListParameters")
    assert set(every(served, [], 0).result.names) == {"pd_gain", "arm.rate", "controller", "shadow"}
    assert every(served, ["arm"], 0).result.names == ["arm.rate"]
    assert set(every(served, [], 1).result.names) == {"pd_gain", "controller", "shadow"}
    get = of("get_parameters", "GetParameters")
    values = get(served, ["pd_gain", "controller", "shadow"]).values
    assert [v.type for v in values] == [3, 4, 1]
    assert (values[0].double_value, values[1].string_value, values[2].bool_value) == (1.5, "pd", False)
    assert get(served, ["no_such"]).values == []
    assert list(of("get_parameter_types", "GetParameterTypes")(served, ["pd_gain"]).types) == [3]
    (told,) = of("describe_parameters", "DescribeParameters")(served, ["pd_gain"]).descriptors
    assert (told.name, told.description, told.additional_constraints) == ("pd_gain", "tuned", "[1/s]")
    assert told.read_only
    new = message("rcl_interfaces/msg/Parameter")(
        "pd_gain", message("rcl_interfaces/msg/ParameterValue")(3, False, 0, 2.0, "", [], [], [], [], [])
    )
    (refused,) = of("set_parameters", "SetParameters")(served, [new]).results
    assert (refused.successful, refused.reason.split(":")[0]) == (False, "read-only")
    whole = of("set_parameters_atomically", "SetParametersAtomically")(served, [new]).result
    assert not whole.successful
    assert get(served, ["pd_gain"]).values[0].double_value == 1.5


@pytest.mark.long
def test_mode_is_told_enabling_refused_and_a_stop_ends_who_commands(run: tuple[Beside, Peer]):
    served, peer = run
    modes = {text: n for n, text in OUTPUT.signals[OUTPUT.at("control_mode")].values.items()}
    served.outputs["value"][OUTPUT.at("control_mode")] = modes["automatic"]
    mode = Client(peer, "mode", "std_srvs/srv/Trigger")
    until(lambda: mode(served, 0).message == "automatic, fault none", served.publish)
    enable = Client(peer, "enable", "std_srvs/srv/SetBool")(served, True)
    assert (enable.success, "enabling switch" in enable.message) == (False, True)
    stop = Client(peer, "stop", "std_srvs/srv/Trigger")
    assert not stop(served, 0).success
    served.outputs["value"][OUTPUT.at("control_mode")] = modes["armed"]
    writer = peer.publisher(COMMAND, ros2.TARGET)
    until(lambda: x(served) == (8.0, Status.OK), lambda: command(writer, served, 1))
    served.outputs["value"][OUTPUT.at("control_mode")] = modes["automatic"]
    writer.write(target(8.0))
    assert stop(served, 0).success
    for _ in range(20):  # its publisher goes on: nothing counts until automatic operation has ended
        command(writer, served, 5)
        assert x(served)[1] == Status.NEVER


def test_a_client_of_another_type_is_refused_and_told_and_a_flood_is_survived(run: tuple[Beside, Peer]):
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from runtime.ros2.wire import message, qos

    served, peer = run
    log = peer.subscribe("/rosout", "rcl_interfaces/msg/Log", latched=True)
    kind = "std_msgs/msg/String"
    topic = Topic(peer.participant, "rq/slewright/controller/stopRequest", message(kind))
    writer = DataWriter(peer.participant, topic, qos(kind))
    lines: list[str] = []

    def told() -> bool:
        lines.extend(m.msg for m in log.take(20))
        return any("it sends std_msgs::msg::dds_::String_" in line for line in lines)

    until(told, served.publish)
    mode, other = (Client(peer, "mode", "std_srvs/srv/Trigger", guid) for guid in (1, 2))
    for n in range(1000):
        other._writer.write(other._made(2, n, 0))
    assert mode(served, 0).message
    assert served.process.poll() is None
    assert writer
