"""DDS stays on this computer: what its sockets are bound to, and that no packet is on another interface."""

import select
import socket
import time
from pathlib import Path

import pytest

from runtime.ros2.loopback import confine, open_to_others
from specs import ros2
from tests.runtime.ros2.peer import DOMAINS, Peer, target

pytest.importorskip("cyclonedds")
ALL = 0x0003  # ETH_P_ALL
FIRST, LAST = 7400, 7400 + 250 * 102  # ports of DDS domains


def test_every_socket_is_bound_to_the_loopback_device():
    peer = Peer(next(DOMAINS))
    assert open_to_others() or peer  # Cyclone's own: on every interface
    assert confine() > 0
    assert open_to_others() == []


@pytest.mark.long
def test_no_dds_packet_is_on_another_interface():
    there = [name for _, name in socket.if_nameindex() if name != "lo"]
    others = [n for n in there if Path(f"/sys/class/net/{n}/operstate").read_text().strip() == "up"]
    try:
        heard = [socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, socket.htons(ALL)) for _ in others]
    except PermissionError:
        pytest.skip("listening to interfaces needs CAP_NET_RAW")
    for end, name in zip(heard, others, strict=True):
        end.bind((name, 0))
    domain = next(DOMAINS)
    first, second = Peer(domain), Peer(domain)
    confine()
    reader = second.subscribe("/t", ros2.TARGET)
    writer = first.publisher("/t", ros2.TARGET)
    end, came = time.monotonic() + 2.0, 0
    while time.monotonic() < end:
        writer.write(target(1.0))
        came += len(reader.take(10))
        ready, _, _ = select.select(heard, [], [], 0.02)
        for one in ready:
            assert not dds_port(one.recv(200))
    assert came
    for one in heard:
        one.close()


def dds_port(packet: bytes) -> bool:
    """Whether an IPv4 packet is UDP to a port of DDS and carries RTPS."""
    if len(packet) < 32 or packet[0] >> 4 != 4 or packet[9] != socket.IPPROTO_UDP:
        return False
    at = 4 * (packet[0] & 15)
    port = int.from_bytes(packet[at + 2 : at + 4], "big")
    return FIRST <= port <= LAST and packet[at + 8 : at + 12] == b"RTPS"
