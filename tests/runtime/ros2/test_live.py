"""The ROS 2 process, started for real: its topics, who may command, and that it stays on this computer."""

import time
from pathlib import Path
from typing import Any

import pytest

from runtime.image import INPUT, OUTPUT, Status
from specs import ros2
from tests.runtime.interfaces.beside import Beside, drawn, value
from tests.runtime.interfaces.both import Both
from tests.runtime.ros2.peer import DOMAINS, Peer, target, until

pytest.importorskip("cyclonedds")
COMMAND = "/slewright/target"
X = INPUT.at("target_x")


@pytest.fixture
def run(tmp_path: Path):
    domain = next(DOMAINS)
    with Beside(
        "ros2",
        tmp_path,
        Both(tmp_path, "ros2"),
        domain=domain,
        commands=True,
        simulated=True,
        policy="",
        bundle="",
        about={},
    ) as served:
        yield served, Peer(domain)


def x(served: Beside) -> tuple[float, int]:
    return float(served.inputs["value"][X]), int(served.inputs["status"][X])


def command(writer: Any, served: Beside, ticks: int, of: Any = None) -> None:
    """Send a target at 10 Hz for so many ticks."""
    for tick in range(ticks):
        if tick % 5 == 0:
            writer.write(of() if of else target(8.0))
        served.publish()
        time.sleep(0.02)


def test_signals_model_clock_and_log(run: tuple[Beside, Peer]):
    served, peer = run
    signals = peer.subscribe("/slewright/signals", ros2.SIGNALS)
    clock = peer.subscribe("/clock", "rosgraph_msgs/msg/Clock", reliable=False)
    model = peer.subscribe("/robot_description", "std_msgs/msg/String", latched=True)
    log = peer.subscribe("/rosout", "rcl_interfaces/msg/Log", latched=True)
    graph = peer.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    images = drawn(1)
    images[1]["value"][OUTPUT.at("control_mode")] = 5
    served.publish(images)
    found = until(lambda: signals.take(1), served.publish)[0]
    for s in (*INPUT.signals, *OUTPUT.signals):
        if s.kind != "target":
            assert getattr(found, s.name) == value(images, s.name), s.name
    assert "<robot" in until(lambda: model.take(1), served.publish)[0].data
    assert until(lambda: clock.take(1), served.publish)[0].clock.sec > 0
    lines: list[str] = []

    def read() -> bool:
        lines.extend(m.msg for m in log.take(10))
        return "mode: fault" in lines

    until(read, served.publish)
    assert until(lambda: graph.take(1), served.publish)[0].status


def test_ros_2s_graph_sees_a_node(run: tuple[Beside, Peer]):
    served, peer = run
    kind = "rmw_dds_common/msg/ParticipantEntitiesInfo"
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    from runtime.ros2.wire import message, qos

    topic = Topic(peer.participant, "ros_discovery_info", message(kind))
    reader = DataReader(peer.participant, topic, qos(kind, latched=True, hashed=False))
    node = until(lambda: reader.take(1), served.publish)[0].node_entities_info_seq[0]
    assert (node.node_namespace, node.node_name) == ("/slewright", "controller")
    assert len(node.writer_gid_seq) > 8
    assert len(node.reader_gid_seq) == 1 + 9  # targets, requests of services


def test_a_late_subscriber_gets_every_line_that_is_kept():
    from runtime.ros2.node import Node
    from runtime.ros2.wire import message

    kind, early = "rcl_interfaces/msg/Log", Peer(next(DOMAINS))
    node = Node(early.domain, "/late/log")
    node.publisher("/rosout", kind, latched=True, depth=4)
    stamp = message("builtin_interfaces/msg/Time")(1, 0)
    for text in "abcde":
        node.publish("/rosout", message(kind)(stamp, 20, "late", text, "", "", 0))
    log, said = early.subscribe("/rosout", kind, latched=True), []
    until(lambda: said and said[-1] == "e", lambda: said.extend(m.msg for m in log.take(10)))
    assert said == ["b", "c", "d", "e"]


@pytest.mark.long
def test_a_publisher_commands_until_it_is_silent_and_nobody_displaces_it(run: tuple[Beside, Peer]):
    served, peer = run
    first, second = peer.publisher(COMMAND, ros2.TARGET), Peer(peer.domain).publisher(COMMAND, ros2.TARGET)
    until(lambda: x(served) == (8.0, Status.OK), lambda: command(first, served, 1))
    for _ in range(8):
        second.write(target(3.0))
        command(first, served, 5)
        assert x(served) == (8.0, Status.OK)
    until(lambda: x(served)[1] == Status.NEVER, served.publish)
    until(lambda: x(served) == (3.0, Status.OK), lambda: command(second, served, 1, lambda: target(3.0)))


@pytest.mark.parametrize(
    "of",
    [
        lambda: target(float("nan")),
        lambda: target(26.0),
        lambda: target(8.0, time.time_ns() - 10**9),  # a second old
        lambda: target(8.0, time.time_ns() + 10**9),
    ],
)
def test_what_is_wrong_or_stale_does_not_count(run: tuple[Beside, Peer], of: Any):
    served, peer = run
    writer = peer.publisher(COMMAND, ros2.TARGET)
    command(writer, served, 40, of)
    assert x(served)[1] == Status.NEVER
    until(lambda: x(served) == (8.0, Status.OK), lambda: command(writer, served, 1))  # and it goes on


def test_another_type_or_version_is_refused_and_told(run: tuple[Beside, Peer]):
    from cyclonedds.qos import Policy, Qos

    from runtime.ros2.wire import qos

    served, peer = run
    log = peer.subscribe("/rosout", "rcl_interfaces/msg/Log", latched=True)
    other = peer.publisher(COMMAND, "std_msgs/msg/String")
    hashed = Qos(
        *(p for p in qos(ros2.TARGET) if not isinstance(p, Policy.Userdata)),
        Policy.Userdata(b"typehash=RIHS01_00;"),
    )
    elder = Peer(peer.domain).publisher(COMMAND, ros2.TARGET, chosen=hashed)
    lines: list[str] = []

    def told(what: str) -> bool:
        lines.extend(m.msg for m in log.take(10))
        return any(what in line for line in lines)

    until(lambda: told("is of another version"), lambda: command(elder, served, 1))
    until(lambda: told("publishes std_msgs::msg::dds_::String_"), served.publish)
    assert x(served)[1] == Status.NEVER
    assert other


@pytest.mark.long
def test_a_flood_neither_stops_the_process_nor_displaces_the_planner(run: tuple[Beside, Peer]):
    served, peer = run
    first, flood = peer.publisher(COMMAND, ros2.TARGET), Peer(peer.domain).publisher(COMMAND, ros2.TARGET)
    signals = peer.subscribe("/slewright/signals", ros2.SIGNALS, reliable=False)
    until(lambda: x(served) == (8.0, Status.OK), lambda: command(first, served, 1))
    for _ in range(20):
        for _ in range(100):
            flood.write(target(3.0))
        command(first, served, 5)
        assert x(served)[0] in (8.0, 0.0)  # a busy computer may let the right lapse, to nobody
    assert until(lambda: signals.take(5), served.publish)
    assert served.process.poll() is None
