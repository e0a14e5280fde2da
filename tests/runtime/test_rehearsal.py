"""The twin of a cycle leaves no trace in the real one, and does the same work."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime import rehearsal
from runtime.can.native import NativePort
from runtime.can.transmit import Transmitter
from runtime.can.wire import EXTENDED
from runtime.hmi.cells import GRANT, HMI, SEEN, create as create_hmi, state_of
from runtime.hmi.port import HmiPort
from runtime.image import INPUT
from runtime.modbus.cells import create
from runtime.modbus.port import ModbusPort
from runtime.rehearsal import Rehearsal
from runtime.ring import Ring
from runtime.shared import Cell
from runtime.statistics import Statistics
from specs.signals import definition
from tests.runtime.bench import NOISY, POSE, READY, TARGET
from tests.runtime.bundles import core

TICKS = 60
INDEX = INPUT.index


class Source:
    def __init__(self) -> None:
        self.frames: list[tuple[int, bytes, int]] = []
        self.sent: list[tuple[int, bytes]] = []

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        return self.frames.pop(0) if self.frames else None

    def send_raw(self, identifier: int, data: bytes) -> None:
        self.sent.append((identifier, data))


def drive(folder: Path, rehearsed: bool) -> tuple[list[bytes], list[tuple[int, bytes]], bytes, Rehearsal]:
    """Outputs, frames, last state and rehearsal of a drive into automatic operation."""
    control, source = core(), Source()
    folder.mkdir()
    port, modbus = NativePort(source, control.library), ModbusPort(*create(folder))
    cells = create_hmi(folder)
    hmi = HmiPort(cells, control.library, Statistics())
    twin = Rehearsal(control, [port, modbus, hmi], folder / "twin", recorder=True)
    senders = [
        Transmitter(n, INDEX) for n in definition().bus.nodes if n in ("Machine", "Operator", "Planner")
    ]
    noise, image, outputs = np.random.default_rng(1), INPUT.new(), []
    for tick in range(TICKS):
        values = INPUT.new()["value"]
        now = {**POSE, **TARGET, **READY, **{n: noise.normal(0, 1e-3) for n in NOISY}}
        now |= {n: float(tick) for n in ("operator_heartbeat", "machine_heartbeat", "planner_heartbeat")}
        now |= {"operator_enable": float(tick > 8), "automatic_request": float(tick > 12)}
        for name, value in now.items():
            values[INDEX[name]] = value
        if rehearsed:
            twin(tick, time.monotonic_ns() + 3600 * 10**9)
        source.frames = [(i | EXTENDED, d, 1 << 62) for s in senders for i, d in s.due(values.tolist(), tick)]
        if tick == 3:  # somebody forces a sensor, and goes on until STANDBY is left
            force(hmi, "imu_tool_roll")
        for each in (port, hmi):
            each.receive(image, tick)
        image["flags"] = hmi.flags()
        answer = control.step(image, tick)
        outputs.append(answer.tobytes())
        for each in (port, hmi):
            each.send(answer, tick)
    return outputs, [*source.sent, told(cells)], control.snapshot(), twin


def force(hmi: HmiPort, name: str) -> None:
    """What the HMI's process writes."""
    asked = np.zeros((), HMI)
    asked["targets"]["stamp_ns"], asked["force_number"] = time.monotonic_ns() + 3600 * 10**9, 7
    asked["forced"][INDEX[name]], asked["value"][INDEX[name]] = 1, 0.02
    hmi.asked.write(asked)


def told(cells: tuple[Cell, Cell, Cell]) -> tuple[int, bytes]:
    """What pages are shown, and who was granted what."""
    seen, granted = state_of(cells[0], SEEN), state_of(cells[1], GRANT)
    assert seen is not None and granted is not None  # noqa: PT018
    assert granted["force_ended"] == 7
    return cells[0].number, seen["inputs"].tobytes() + seen["work"]["heard"].tobytes() + granted.tobytes()


def test_nothing_of_it_reaches_the_real_cycle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rehearsal, "sleep_until", lambda deadline: None)
    plain, with_twin = drive(tmp_path / "a", False), drive(tmp_path / "b", True)
    assert plain[:3] == with_twin[:3]
    twin = with_twin[3]
    assert twin.ticks == TICKS
    assert np.frombuffer(with_twin[0][-1], "<f8")[0] != 0.0
    assert twin.figures()["count"] == twin.ticks
    twin.close()
    plain[3].close()


def test_a_late_one_is_left_out(tmp_path: Path) -> None:
    control = core()
    port = NativePort(Source(), control.library)
    twin = Rehearsal(control, [port], tmp_path / "twin", recorder=False)
    twin(0, time.monotonic_ns())
    assert twin.ticks == 0
    twin.close()


@pytest.mark.parametrize("recorder", [False, True])
def test_a_twin_that_hears_itself_goes_on(
    recorder: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For more ticks than a ring or a socket holds, unless it is emptied."""
    ports: list[NativePort] = []
    rings: list[Ring] = []

    class Port(NativePort):
        def __init__(self, *given: Any) -> None:
            super().__init__(*given)
            ports.append(self)

    class Rings:
        @staticmethod
        def create(path: Path, size: int) -> Ring:
            rings.append(Ring.create(path, size))
            return rings[-1]

    monkeypatch.setattr(rehearsal, "sleep_until", lambda deadline: None)
    monkeypatch.setattr(rehearsal, "NativePort", Port)
    monkeypatch.setattr(rehearsal, "Ring", Rings)
    control = core()
    twin = Rehearsal(control, [Port(Source(), control.library)], tmp_path / "t", recorder)
    for tick in range(700):
        twin(tick, time.monotonic_ns() + 3600 * 10**9)
    assert twin.ticks == 700
    assert [port.unsent for port in ports] == [0, 0]
    assert [ring.lost for ring in rings] == [0] * recorder
    twin.close()
