"""Publishers of which nothing comes, and messages that cannot be read: both are told, and end nothing."""

import time
from pathlib import Path
from typing import Any

import pytest

from specs import ros2
from tests.runtime.interfaces.beside import Beside
from tests.runtime.interfaces.both import Both
from tests.runtime.ros2.peer import DOMAINS, Peer, until
from tests.runtime.ros2.test_live import COMMAND, command, target, x

pytest.importorskip("cyclonedds")
FITS_S = 2.5  # more than the process gives both sides to find each other


@pytest.fixture
def run(tmp_path: Path):
    domain = next(DOMAINS)
    told = {"domain": domain, "commands": True, "simulated": True, "policy": "", "bundle": "", "about": {}}
    with Beside("ros2", tmp_path, Both(tmp_path, "ros2"), **told) as served:
        yield served, Peer(domain)


class Said:
    """Lines of /rosout."""

    def __init__(self, peer: Peer) -> None:
        self._log = peer.subscribe("/rosout", "rcl_interfaces/msg/Log", latched=True)
        self.lines: list[str] = []

    def any(self, what: str) -> bool:
        """Whether something was said."""
        self.lines += [m.msg for m in self._log.take(50)]
        return any(what in line for line in self.lines)

    def of(self, writer: Any, what: str) -> bool:
        """Whether something was said of a publisher."""
        self.lines += [m.msg for m in self._log.take(50)]
        return any(str(writer.guid) in line and what in line for line in self.lines)


def apart(*policies: Any) -> Any:
    """ROS 2's quality of service, but for these."""
    from cyclonedds.qos import Qos

    from runtime.ros2.wire import qos

    kinds = tuple(type(p) for p in policies)
    return Qos(*(p for p in qos(ros2.TARGET, hashed=False) if not isinstance(p, kinds)), *policies)


@pytest.mark.long
def test_a_publisher_of_which_dds_brings_nothing_is_told_with_the_reason(run: tuple[Beside, Peer]):
    from cyclonedds.idl import annotations, make_idl_struct
    from cyclonedds.qos import Policy

    served, peer = run
    said = Said(peer)
    other = annotations.final(make_idl_struct("Target", "slewright_msgs.msg.dds_.Target_", {"x": float}))
    newer = Policy.DataRepresentation(use_cdrv0_representation=False, use_xcdrv2_representation=True)
    chosen = {
        "XCDR2": (None, apart(newer)),
        "partition elsewhere": (None, apart(Policy.Partition(["elsewhere"]))),
        "fields of its type": (other, apart()),
    }
    writers = {what: Peer(peer.domain).publisher(COMMAND, ros2.TARGET, *of) for what, of in chosen.items()}
    silent = [Peer(peer.domain).publisher(COMMAND, ros2.TARGET) for _ in range(4)]
    for what, writer in writers.items():
        until(lambda w=writer, t=what: said.of(w, t), served.publish)
    end = time.monotonic() + FITS_S
    while time.monotonic() < end:
        served.publish()
        time.sleep(0.02)
    for writer in silent:  # they have nothing to say yet, and would be heard
        assert not said.of(writer, "")
    assert all(writer.get_matched_subscriptions() for writer in silent)


def test_a_message_that_cannot_be_read_is_refused_and_everybody_else_is_heard(run: tuple[Beside, Peer]):
    served, peer = run
    said, well, ill = Said(peer), *(Peer(peer.domain).publisher(COMMAND, ros2.TARGET) for _ in range(2))
    until(lambda: x(served)[0] == 8.0, lambda: command(well, served, 1))

    def both() -> Any:
        ill.write(unreadable())
        return target(8.0)

    until(lambda: said.of(ill, "cannot be read: 'utf-8'"), lambda: command(well, served, 5, both))
    command(well, served, 10)
    assert x(served)[0] == 8.0
    assert served.process.poll() is None


class Latin(str):
    """A text that goes out in Latin-1."""

    def encode(self, *_: Any, **__: Any) -> bytes:
        return super().encode("latin-1")


def test_a_publisher_whose_announcement_cannot_be_read_ends_nothing(run: tuple[Beside, Peer]):
    from cyclonedds.qos import Policy

    served, peer = run
    said = Said(peer)
    odd = apart(Policy.Partition([Latin("S\u00fcd")]))
    ill = Peer(peer.domain).publisher(COMMAND, ros2.TARGET, chosen=odd)
    until(lambda: said.any("its announcement cannot be read"), served.publish)
    well = Peer(peer.domain).publisher(COMMAND, ros2.TARGET)
    until(lambda: x(served)[0] == 8.0, lambda: command(well, served, 1))
    assert served.process.poll() is None
    assert ill


def unreadable() -> Any:
    """A target whose frame is no UTF-8: bytes as a node in C++ may send them."""
    found = target(3.0)
    whole = found.serialize
    found.serialize = lambda **given: bytes(whole(**given)).replace(b"base", b"b\xffse")
    return found
