"""The wire in memory: arbitration, time, errors and their counters."""

import pytest
from hypothesis import given, strategies as st

from runtime.can.wire import (
    BUS_OFF,
    CONTROLLER,
    ERROR,
    EXTENDED,
    RESTARTED,
    TX_PASSIVE,
    Node,
    Spoiling,
    Wire,
    _rank,
)
from specs.wire import frame_bits

MS = 1_000_000


def made(bit_rate: int = 250_000) -> tuple[Wire, Node, Node, Node]:
    wire, nodes = Wire(bit_rate), [Node(name) for name in "abc"]
    wire.nodes = nodes
    return wire, nodes[0], nodes[1], nodes[2]


def data_frames(wire: Wire, now: int, to: Node) -> list[int]:
    return [f[0] & ~EXTENDED for node, f, _ in wire.advance(now) if node is to and not f[0] & ERROR]


def errors(wire: Wire, now: int, to: Node) -> list[int]:
    return [f[0] & ~ERROR for node, f, _ in wire.advance(now) if node is to and f[0] & ERROR]


@given(st.lists(st.tuples(st.integers(0, 1), st.integers(0, 0x1FFFFFFF)), min_size=1, max_size=20))
def test_of_what_waits_the_lowest_identifier_goes_first(offers: list[tuple[int, int]]) -> None:
    wire, a, b, c = made()
    waiting: list[list[int]] = [[], []]
    for who, identifier in offers:
        wire.offer((a, b)[who], (identifier | EXTENDED, bytes(8)))
        waiting[who].append(identifier)
    wanted = []
    while any(waiting):
        first = min((queue[0], who) for who, queue in enumerate(waiting) if queue)
        wanted.append(waiting[first[1]].pop(0))
    list(wire.advance(0))
    assert data_frames(wire, 10**12, c) == wanted


def test_a_standard_frame_wins_against_an_extended_one_of_the_same_start() -> None:
    assert _rank(0x100) < _rank(EXTENDED | 0x100 << 18) < _rank(0x101) < _rank(EXTENDED | 0x101 << 18)


def test_frames_take_their_time_and_come_when_they_end() -> None:
    wire, a, _, c = made()
    bits = frame_bits(8) * 4000  # ns at 250 kbit/s
    list(wire.advance(5 * MS))
    for _ in range(3):
        wire.offer(a, (EXTENDED | 1, bytes(8)))
    stamps = [stamp for node, _, stamp in wire.advance(100 * MS) if node is c]
    # the wire was found in use at 100 ms only: the first frame began then
    assert stamps == []
    stamps = [stamp for node, _, stamp in wire.advance(200 * MS) if node is c]
    assert stamps == [100 * MS + bits, 100 * MS + 2 * bits, 100 * MS + 3 * bits]
    assert wire.busy_ns == 3 * bits


def test_a_spoilt_frame_is_sent_again_and_counted() -> None:
    wire, a, b, c = made()
    wire.spoilings.append(Spoiling(2, node="a"))
    wire.offer(a, (EXTENDED | 7, b"\x01"))
    wire.offer(b, (EXTENDED | 9, b"\x02"))
    assert data_frames(wire, 0, c) == []
    assert data_frames(wire, 100 * MS, c) == [7, 9]
    assert (a.transmit_errors, c.receive_errors) == (2 * 8 - 1, 0)


def test_passive_then_off_then_back() -> None:
    wire, a, _, c = made()
    wire.spoilings.append(Spoiling(10**6, node="a"))
    for _ in range(3):
        wire.offer(a, (EXTENDED | 7, b"\x01"))
    list(wire.advance(0))
    seen = [(f[0] & ~ERROR, f[1][1]) for node, f, _ in wire.advance(90 * MS) if node is a]
    assert (CONTROLLER, TX_PASSIVE) in seen
    assert seen[-1][0] == BUS_OFF
    assert sum(sort == CONTROLLER for sort, _ in seen) == 1
    assert a.off_until is not None
    assert not wire.offer(a, (EXTENDED | 7, b"\x01"))
    wire.spoilings.clear()
    assert errors(wire, a.off_until, a) == [RESTARTED]
    assert wire.offer(a, (EXTENDED | 8, b"\x01"))
    list(wire.advance(300 * MS))
    assert data_frames(wire, 400 * MS, c) == [8]


def test_a_cut_node_neither_hears_nor_is_heard() -> None:
    wire, a, b, c = made(0)
    b.silent = True
    wire.offer(b, (EXTENDED | 1, b""))
    wire.offer(a, (EXTENDED | 2, b""))
    got = [(node.name, f[0] & ~EXTENDED) for node, f, _ in wire.advance(MS)]
    assert got == [("c", 2)]
    assert c.receive_errors == 0


@pytest.mark.parametrize("rate", [0, 250_000])
def test_it_says_when_to_look_again(rate: int) -> None:
    wire, a, _, _ = made(rate)
    assert wire.next_event() is None
    wire.offer(a, (EXTENDED | 1, b""))
    assert wire.next_event() is not None
    list(wire.advance(MS))
    list(wire.advance(2 * MS))
    assert wire.next_event() is None
