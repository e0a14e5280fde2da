"""A policy outside over ROS 2, the process started for real: who commands, how old, what is refused."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.image import INPUT, Status
from runtime.interfaces import outside
from runtime.interfaces.outside import COMMANDS, LATE, OutsidePort
from runtime.interfaces.publish import ImagePort, create
from specs import ros2
from tests.runtime.interfaces.beside import Beside
from tests.runtime.ros2.peer import DOMAINS, Peer, until

pytest.importorskip("cyclonedds")
TOPIC, ROLE = "/slewright/policy", "/swing/policy"
U = INPUT.at("policy_u_slew")


class Both:
    """The control process's ports: the policy's and the images."""

    def __init__(self, folder: Path) -> None:
        self.outside, self.images = OutsidePort(outside.create(folder)), ImagePort(create(folder))

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        self.outside.receive(inputs, tick)
        self.images.receive(inputs, tick)

    def send(self, outputs: np.ndarray, tick: int) -> None:
        self.images.send(outputs, tick)


class Policy:
    """A node that publishes commands."""

    def __init__(self, domain: int, name: str = ROLE, kind: str = ros2.POLICY) -> None:
        from runtime.ros2.node import Node

        self.peer, self.beat = Peer(domain), 0
        self.node = Node(domain, name)
        self.node.publisher(TOPIC, kind)
        self.node.announce()

    def send(self, u: float = 0.5, age_s: float = 0.0, beats: bool = True) -> None:
        self.beat = (self.beat + beats) % 251
        self.node.publish(TOPIC, command(u, time.time_ns() - round(1e9 * age_s), self.beat))


def command(u: float, stamp_ns: int, beat: int) -> Any:
    from runtime.ros2.messages import header
    from runtime.ros2.wire import message

    return message(ros2.POLICY)(header(stamp_ns, "base"), u, 0.1, -0.1, beat)


@pytest.fixture
def run(tmp_path: Path):
    domain = next(DOMAINS)
    told = {"domain": domain, "commands": False, "simulated": True, "policy": ROLE, "bundle": "", "about": {}}
    with Beside("ros2", tmp_path, Both(tmp_path), **told) as served:
        yield served, domain


def u(served: Beside) -> tuple[float, int]:
    return float(served.inputs["value"][U]), int(served.inputs["status"][U])


def ticks(served: Beside, count: int, send: Callable[[], None] = lambda: None) -> None:
    """So many ticks; `send` at 10 Hz."""
    for tick in range(count):
        if tick % 5 == 0:
            send()
        served.publish()
        time.sleep(0.02)


def lines(peer: Peer) -> Callable[[str], bool]:
    """Whether something was said on /rosout."""
    log, said = peer.subscribe("/rosout", "rcl_interfaces/msg/Log", latched=True), []

    def told(what: str) -> bool:
        said.extend(m.msg for m in log.take(20))
        return any(what in line for line in said)

    return told


def test_the_node_with_the_role_commands_until_its_commands_are_stale(run: tuple[Beside, int]):
    served, domain = run
    policy = Policy(domain)
    told = lines(policy.peer)
    until(lambda: u(served) == (0.5, Status.OK), lambda: ticks(served, 5, policy.send))
    assert [float(v) for v in served.inputs["value"][outside.PLACES]][:3] == [0.5, 0.1, -0.1]
    until(lambda: told("has the right to command arm and slew"), served.publish)
    until(lambda: u(served)[1] != Status.OK, served.publish)
    until(lambda: told("lost the right to command arm and slew: no command that counts"), served.publish)
    until(lambda: u(served) == (0.0, Status.NEVER), served.publish)
    until(lambda: u(served) == (0.25, Status.OK), lambda: ticks(served, 5, lambda: policy.send(0.25)))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda p: p.send(float("nan")), "outside -1 … 1"),
        (lambda p: p.send(1.25), "policy_u_slew = 1.25: outside -1 … 1"),
        (lambda p: p.send(age_s=0.5), "s old"),
        (lambda p: p.send(age_s=-1.0), "in the future"),
        (lambda p: p.node.publish(TOPIC, command(0.5, 0, 7)), "says no time"),
    ],
)
def test_what_is_wrong_or_stale_does_not_count(
    run: tuple[Beside, int], wrong: Callable[[Policy], None], said: str
):
    served, domain = run
    policy = Policy(domain)
    told = lines(policy.peer)
    until(lambda: told(said), lambda: ticks(served, 5, lambda: wrong(policy)))
    assert u(served)[1] == Status.NEVER
    until(lambda: u(served) == (0.5, Status.OK), lambda: ticks(served, 5, policy.send))  # and it goes on


@pytest.mark.long
def test_a_heartbeat_that_stands_still_is_a_loss(run: tuple[Beside, int]):
    served, domain = run
    policy = Policy(domain)
    told = lines(policy.peer)
    until(lambda: u(served) == (0.5, Status.OK), lambda: ticks(served, 5, policy.send))
    until(
        lambda: told("policy_heartbeat stands still") and told("no command that counts"),
        lambda: ticks(served, 5, lambda: policy.send(beats=False)),
    )
    for _ in range(10):  # nor does it get the right anew
        ticks(served, 5, lambda: policy.send(beats=False))
        assert u(served)[1] == Status.NEVER


def test_another_node_and_another_type_are_refused_and_told(run: tuple[Beside, int]):
    served, domain = run
    other, text = Policy(domain, "/swing/other"), Policy(domain, kind="std_msgs/msg/String")
    told = lines(other.peer)
    until(lambda: told("the role is /swing/policy's"), lambda: ticks(served, 5, other.send))
    until(lambda: told("publishes std_msgs::msg::dds_::String_"), served.publish)
    assert u(served)[1] == Status.NEVER
    assert text


def test_a_second_commander_and_a_flood_displace_nobody(run: tuple[Beside, int]):
    served, domain = run
    first, second, stranger = Policy(domain), Policy(domain), Policy(domain, "/swing/other")
    told = lines(first.peer)
    until(lambda: u(served) == (0.5, Status.OK), lambda: ticks(served, 5, first.send))

    def all_send() -> None:
        first.send()
        second.send(-1.0)
        for _ in range(100):
            stranger.send(-1.0)

    for _ in range(20):
        ticks(served, 5, all_send)
        assert u(served)[0] in (0.5, 0.0)  # a busy computer may let the right lapse, to nobody
        if u(served)[1] != Status.OK:
            break

    def both_send() -> None:
        first.send()
        second.send(-1.0)

    def second_is_refused() -> bool:  # whichever of them has the right by now
        return told("/swing/policy was refused: publisher")

    until(second_is_refused, lambda: ticks(served, 5, both_send))
    until(lambda: told("the role is /swing/policy's"), served.publish)
    assert served.process.poll() is None


def test_who_follows_another_one_begins_with_a_tick_without_commands(tmp_path: Path):
    now = [10**9]
    cell = outside.create(tmp_path)
    port, inputs = OutsidePort(cell, lambda: now[0]), INPUT.new()
    state = np.zeros((), outside.COMMAND)
    for owner, expected in ((1, [Status.OK, Status.OK]), (2, [Status.NEVER, Status.OK]), (0, [Status.NEVER])):
        state["made_ns"], state["owner"], state["value"] = now[0], owner, [0.5] * len(COMMANDS)
        cell.write(state)
        for status in expected:
            port.receive(inputs, 0)
            assert inputs["status"][outside.PLACES].tolist() == [status] * len(COMMANDS)
    state["owner"] = 3
    cell.write(state)
    port.receive(inputs, 0)
    for ticks_old, status in ((LATE - 1, Status.OK), (LATE, Status.TIMEOUT)):
        now[0] = 10**9 + ticks_old * outside.PERIOD_NS
        port.receive(inputs, 0)
        assert (inputs["status"][U], inputs["age"][U]) == (status, ticks_old)
