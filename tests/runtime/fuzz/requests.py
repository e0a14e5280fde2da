"""Bytes into the Modbus server's connections: nothing raises, every answer is one, what counts is in range.

A case is a list of (connection, pause in ms, bytes in hex); a connection that was hung up on stays so.
"""

import asyncio
import random
import struct
from typing import Any

import numpy as np

import runtime.modbus
from runtime.modbus import server as serving
from runtime.modbus.cells import HOLDING, IMAGE, TARGETS
from runtime.modbus.holding import CLAIM, COMMIT, HEARTBEAT
from tests.edges import Edge, traced
from tests.runtime.modbus.test_holding import FIRST, body

PACKAGE = runtime.modbus
CONNECTIONS = 2
ODD = (0, 1, 2, 5, 18, 19, 20, 42, 109, 117, 123, 124, 125, 126, 250, 251, 255, 256, 0x7FC0, 0x8000, 0xFFFF)
Case = list[tuple[int, int, str]]


class _Cell:
    """A cell in memory."""

    def __init__(self, state: bytes) -> None:
        self.number, self.state = 1, state

    def write(self, state: np.ndarray) -> None:
        self.number, self.state = self.number + 1, state.tobytes()

    def read(self) -> tuple[int, bytes]:
        return self.number, self.state


class _Transport:
    """Keeps what the server sends."""

    def __init__(self) -> None:
        self.sent, self.open, self.reading = b"", True, True

    def get_extra_info(self, name: str) -> Any:
        return ("127.0.0.1", 1) if name == "peername" else None

    def write(self, data: bytes) -> None:
        self.sent += data

    def pause_reading(self) -> None:
        self.reading = False

    def resume_reading(self) -> None:
        self.reading = True

    def is_reading(self) -> bool:
        return self.reading

    def close(self) -> None:
        self.open = False

    abort = close


def frame(function: int, data: bytes, transaction: int = 1, unit: int = 1) -> str:
    """A request in hex."""
    return (struct.pack(">HHHBB", transaction, 0, len(data) + 2, unit, function) + data).hex()


def seeds() -> list[Case]:
    """What a client that is well does, and every function once."""
    whole = [*body(target_x=3.0, planner_heartbeat=1), 1, 42]
    write = struct.pack(">HHB", FIRST, len(whole), 2 * len(whole)) + struct.pack(f">{len(whole)}H", *whole)
    well = [(0, 0, frame(4, struct.pack(">HH", 0, 117))), (0, 1, frame(16, write))]
    well += [(0, 50, frame(6, struct.pack(">HH", HEARTBEAT, n))) for n in (2, 3)]
    well += [(1, 0, frame(6, struct.pack(">HH", CLAIM, 42))), (1, 0, frame(6, struct.pack(">HH", CLAIM, 0)))]
    each = [(0, 0, frame(3, struct.pack(">HH", 0, 20))), (0, 0, frame(22, struct.pack(">HHH", COMMIT, 0, 9)))]
    each += [(0, 600, frame(23, struct.pack(">HHHHBH", 0, 5, HEARTBEAT, 1, 2, 9)))]
    each += [(1, 0, frame(43, b"\x0e\x01\x00")), (1, 0, frame(8, bytes(4))), (1, 0, frame(0x90, bytes(4)))]
    return [well, each]


def run(case: Case, edges: set[Edge], images: list[bytes] | None = None) -> None:
    """Play a case; AssertionError if an answer or a state is none."""
    traced(lambda: asyncio.run(_play(case)), PACKAGE, edges)


async def _play(case: Case) -> None:
    image, targets = _Cell(np.zeros((), IMAGE).tobytes()), _Cell(np.zeros((), TARGETS).tobytes())
    failed: list[Any] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, about: failed.append(about))
    desk = serving.Desk(image, targets)  # type: ignore[arg-type]
    plain = serving._Plain(desk.device(), address=("127.0.0.1", 0))
    plain.desk = desk
    ends = [_connected(plain) for _ in range(CONNECTIONS)]
    clock = serving.time.monotonic_ns()
    original, serving.time = serving.time, _Clock(clock)  # type: ignore[assignment]
    try:
        for who, pause, data in case:
            serving.time.now += pause * 1_000_000  # type: ignore[attr-defined]
            connection, transport = ends[who % CONNECTIONS]
            if transport.open:
                connection.data_received(bytes.fromhex(data))
                await _settle()
                _judge(targets)
        for connection, transport in ends:
            _whole(transport.sent)
            connection.connection_lost(None)
    finally:
        serving.time = original
    assert not failed, failed


class _Clock:
    def __init__(self, now: int) -> None:
        self.now = now

    def monotonic_ns(self) -> int:
        return self.now


def _connected(plain: Any) -> tuple[Any, _Transport]:
    connection, transport = plain.handle_new_connection(), _Transport()
    connection.connection_made(transport)
    return connection, transport


async def _settle() -> None:
    """Wait for whatever the server still does."""
    for task in asyncio.all_tasks() - {asyncio.current_task()}:
        await task


def _judge(targets: _Cell) -> None:
    state = np.frombuffer(targets.state, TARGETS)[0]
    if state["commits"]:
        for s, value in zip(HOLDING, state["value"].tolist(), strict=True):
            assert (s.min or 0.0) <= value <= (s.max or 0.0), (s.name, value)
    assert state["heartbeat_ns"] <= serving.time.monotonic_ns()


def _whole(sent: bytes) -> None:
    """What was sent is answers, one after the other."""
    while sent:
        assert len(sent) >= 9, sent.hex()
        protocol, length = struct.unpack(">HH", sent[2:6])
        assert protocol == 0
        assert 3 <= length <= serving.LONGEST
        assert len(sent) >= 6 + length
        if sent[7] & 0x80:
            assert length == 3
            assert 1 <= sent[8] <= 11
        sent = sent[6 + length :]


def mutate(case: Case, chance: random.Random) -> Case:
    """One to four changes of bytes, words, order, connection and pauses."""
    found = list(case)
    for _ in range(chance.randint(1, 4)):
        if not found:
            return list(seeds()[0])
        at = chance.randrange(len(found))
        who, pause, data = found[at]
        kind = chance.randrange(8)
        if kind == 0:
            found[at] = (who, pause, _byte(data, chance))
        elif kind <= 2:
            found[at] = (who, pause, _word(data, chance))
        elif kind == 3:
            found[at] = (chance.randrange(CONNECTIONS), chance.choice((0, 1, 100, 499, 500, 5000)), data)
        elif kind == 4:
            found.insert(at, chance.choice(found))
        elif kind == 5:
            del found[at]
        elif kind == 6:  # cut it, or stick it to the next
            cut = chance.randrange(len(data) // 2 + 1) * 2
            found[at : at + 1] = [(who, pause, data[:cut]), (who, 0, data[cut:])]
        else:
            found.insert(at, (who, pause, _any(chance)))
    return found


def _byte(data: str, chance: random.Random) -> str:
    changed = bytearray(bytes.fromhex(data) or b"\0")
    changed[chance.randrange(len(changed))] = chance.choice((0, 1, 3, 4, 6, 16, 22, 23, 43, 127, 128, 255))
    return changed.hex()


def _word(data: str, chance: random.Random) -> str:
    """Another word in the body; the lengths stay as they say."""
    changed = bytearray(bytes.fromhex(data))
    if len(changed) < 10:
        return data
    at = chance.randrange(8, len(changed) - 1)
    changed[at : at + 2] = struct.pack(">H", chance.choice(ODD))
    return changed.hex()


def _any(chance: random.Random) -> str:
    """A request with any function and body, of the right length."""
    words = [chance.choice(ODD) for _ in range(chance.randint(0, 10))]
    return frame(
        chance.choice((3, 4, 6, 16, 22, 23, 43, chance.getrandbits(8))),
        struct.pack(f">{len(words)}H", *words),
    )
