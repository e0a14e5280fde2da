"""Whoever only reads, or only stays, delays nobody and locks nobody out."""

import asyncio
import shutil
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.image import INPUT, Status
from runtime.modbus import server as serving
from runtime.modbus.cells import IMAGE, TARGETS
from runtime.modbus.holding import CLAIM, HEARTBEAT, Holding
from runtime.modbus.port import ModbusPort
from runtime.modbus.told import open_told, read_told
from runtime.places import leaves
from runtime.shared import private_folder
from tests.runtime.fuzz.requests import _Cell, _connected, frame
from tests.runtime.modbus.served import Raw, Served
from tests.runtime.modbus.test_holding import FIRST, Somebody, body

READ = bytes.fromhex(frame(4, struct.pack(">HH", 0, 117)))


def test_a_flood_of_reads_does_not_delay_the_writer() -> None:
    """21,845 requests in one go: the writer has its answer after at most two of them, each time."""
    assert asyncio.run(_flooded(21_845, 50)) <= 2


async def _flooded(reads: int, beats: int) -> int:
    """The most answers of the flood that came before one of the writer's."""
    desk = serving.Desk(_Cell(np.zeros((), IMAGE).tobytes()), _Cell(np.zeros((), TARGETS).tobytes()))  # type: ignore[arg-type]
    plain = serving._Plain(desk.device(), address=("127.0.0.1", 0))
    plain.desk = desk
    (writer, written), (reader, answered) = _connected(plain), _connected(plain)
    writer.data_received(bytes.fromhex(frame(6, struct.pack(">HH", CLAIM, 42))))
    while not written.sent:
        await asyncio.sleep(0)
    reader.data_received(READ * reads)
    assert not answered.reading
    most = 0
    for beat in range(beats):
        before, had = len(answered.sent), len(written.sent)
        writer.data_received(bytes.fromhex(frame(6, struct.pack(">HH", HEARTBEAT, beat + 1))))
        while len(written.sent) == had:
            await asyncio.sleep(0)
        most = max(most, (len(answered.sent) - before) // 243)
    reader.connection_lost(None)
    return most


@dataclass(eq=False)
class Someone:
    near: bool
    heard: int
    busy: bool = False


def test_who_is_quiet_makes_room_and_some_places_are_kept() -> None:
    far, near = [Someone(False, i) for i in range(6)], [Someone(True, i) for i in range(2)]
    new_far, new_near = Someone(False, 99), Someone(True, 99)
    assert leaves(far[:5], new_far, 8, 2) is None
    assert leaves(far, new_far, 8, 2) is far[0]  # two places are kept
    assert leaves([*far, *near], new_near, 8, 2) is far[0]
    far[0].busy = near[0].busy = True
    assert leaves([*far, *near], new_near, 8, 2) is far[1]
    assert leaves([far[2], *near, *(Someone(True, 50) for _ in range(5))], new_far, 8, 2) is near[1]
    for someone in (*far, *near):
        someone.busy = True
    assert leaves([*far, *near], new_near, 8, 2) is new_near
    assert leaves([], new_far, 8, 2) is None


ATTEMPTS = 5  # a busy computer may keep the writer from beating in time


@pytest.fixture
def folder() -> Iterator[Path]:
    found = private_folder()
    yield found
    shutil.rmtree(found)


def test_idle_connections_lock_nobody_out_and_everything_is_told(folder: Path) -> None:
    for attempt in range(ATTEMPTS):
        place = folder / str(attempt)
        place.mkdir()
        with Served(place) as served:
            told, writer = _crowded(place, served)
        if "LAPSED" not in (kinds := [e["kind"] for e in told["events"]]):
            assert told["writer"] == writer
            assert writer in told["clients"]
            assert kinds == ["CLAIMED", "REFUSED"]
            assert told["events"][0]["who"] == writer
            return
    pytest.skip("this computer is too busy for a writer to beat twice a second")


def _crowded(folder: Path, served: Served) -> tuple[dict[str, Any], str]:
    """What is told with twice as many idle connections as there are places, and who the writer is."""
    writer, beat = Raw(served.plain), 1
    assert writer.write(FIRST, *body(target_x=2.0, planner_heartbeat=1), 1, 42) == 0
    idle = []
    for beat in range(2, 2 * serving.CONNECTIONS + 2):
        idle.append(Raw(served.plain))
        writer.write(HEARTBEAT, beat)
    other = Raw(served.plain)
    assert other.read(3, 0, 1)
    refused = other.write(CLAIM, 42) == 6
    kept = writer.write(HEARTBEAT, beat + 1) == 0
    cell, deadline = open_told(folder), time.monotonic() + 60
    while len(read_told(cell).get("events", [])) < 2 and time.monotonic() < deadline:
        writer.write(HEARTBEAT, int(time.monotonic() * 10) % 250)
        time.sleep(0.02)
    told = read_told(cell)
    assert (refused and kept) or "LAPSED" in [e["kind"] for e in told["events"]]
    here = f"127.0.0.1:{writer.socket.getsockname()[1]}"
    for one in (*idle, other, writer):
        one.close()
    return told, here


class _Memory:
    """A cell without other processes."""

    def __init__(self) -> None:
        self.number, self.state = 0, b""

    def write(self, *parts: np.ndarray) -> None:
        self.number, self.state = self.number + 1, b"".join(p.tobytes() for p in parts)

    def read(self) -> tuple[int, bytes]:
        return self.number, self.state


@pytest.mark.parametrize("peer", ["here", "elsewhere"])
def test_another_writer_in_one_tick_stops_the_drive_all_the_same(peer: str) -> None:
    """Takeover, target, commit and heartbeat between two cycles: for one of them there is no target."""
    cell, inputs, now = _Memory(), INPUT.new(), 10**9
    port = ModbusPort(cell, cell, clock=lambda: now)  # type: ignore[arg-type]
    holding = Holding(cell.write)  # type: ignore[arg-type]
    one, other = Somebody(), Somebody(peer=peer)
    assert holding.write(one, FIRST, [*body(target_x=2.0, planner_heartbeat=1), 1, 42], now) is None
    port.receive(inputs, 0)
    assert inputs["status"][INPUT.at("target_x")] == Status.OK
    holding.left(one)
    assert holding.write(other, FIRST, [*body(target_x=3.0, planner_heartbeat=2), 2, 42], now) is None
    seen = []
    for tick in (1, 2):
        port.receive(inputs, tick)
        seen.append(Status(int(inputs["status"][INPUT.at("target_x")])))
    assert seen == [Status.OK if peer == "here" else Status.NEVER, Status.OK]
    assert inputs["value"][INPUT.at("target_x")] == 3.0
