"""The control process's side: who writes, what is forced, and that a lost page stops the machine."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from runtime.hmi.cells import GRANT, HMI, MESSAGES, SEEN, Writer, create, state_of
from runtime.hmi.port import HmiPort
from runtime.image import INPUT, OUTPUT, Flag, Status
from runtime.modbus.cells import HOLDING
from runtime.modbus.holding import Holding, Refusal
from runtime.shared import private_folder
from runtime.statistics import Statistics
from tests.runtime.bench import ARMED, AUTOMATIC, FAULT, STANDBY, TARGET, Bench
from tests.runtime.bundles import core

HEART = INPUT.at("planner_heartbeat")
SECOND = 1_000_000_000


class Rack:
    """A core, its HMI port, the page's cell written by hand, and a clock in hand."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100 * SECOND
        monkeypatch.setattr(time, "monotonic_ns", lambda: self.now)
        self.cells = create(folder)
        self.claimed = False
        self.bench = Bench(core("pd"))
        self.port = HmiPort(self.cells, self.bench.core.library, Statistics(), lambda: self.claimed)
        self.planner = False
        self.asked = np.zeros((), HMI)
        self.asked["targets"]["value"] = [s.start for s in HOLDING]

    def ask(self, owner: int = 0, **values: float) -> None:
        """The page's state, alive now."""
        targets = self.asked["targets"]
        targets["owner"], targets["stamp_ns"], targets["heartbeat_ns"] = owner, self.now, self.now
        targets["commits"] = 1 if values else targets["commits"]
        for name, value in values.items():
            targets["value"][[s.name for s in HOLDING].index(name)] = value
        self.cells[2].write(self.asked)

    def force(self, number: int, **values: float) -> None:
        self.asked["force_number"] = number
        self.asked["forced"] = 0
        for name, value in values.items():
            self.asked["forced"][INPUT.at(name)], self.asked["value"][INPUT.at(name)] = 1, value
        self.ask(int(self.asked["targets"]["owner"]))

    def tick(self, count: int = 1, beat: bool = True) -> "Rack":
        for _ in range(count):
            self.now += SECOND // 50
            if beat and self.asked["targets"]["owner"]:
                place = [s.name for s in HOLDING].index("planner_heartbeat")
                self.asked["targets"]["value"][place] += 1
                self.ask(int(self.asked["targets"]["owner"]))
            bench = self.bench
            bench.now += 1
            bench.fill()
            if not self.planner:
                for s in HOLDING:
                    bench.image["status"][INPUT.at(s.name)] = Status.NEVER
            self.port.receive(bench.image, bench.now)
            bench.image["flags"] = self.port.flags()
            outputs = bench.core.step(bench.image, bench.now)
            bench.seen.append(outputs.copy())
            self.port.send(outputs, bench.now)
        return self

    def granted(self) -> tuple[int, ...]:
        found = state_of(self.cells[1], GRANT)
        return tuple(int(found[n]) for n in GRANT.names or ()) if found is not None else (0, 0, 0, 0)

    def automatic(self) -> "Rack":
        self.ask(7, **TARGET)
        self.tick(3)
        self.bench.set(operator_enable=1.0)
        self.tick(2)
        self.bench.set(automatic_request=1.0)
        return self.tick(3)


@pytest.fixture
def rack(monkeypatch: pytest.MonkeyPatch) -> Iterator[Rack]:
    folder = private_folder("slewright-test-")
    yield Rack(folder, monkeypatch)
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()


def test_the_page_drives_and_its_loss_stops_and_latches(rack: Rack):
    rack.automatic()
    assert rack.granted()[:2] == (Writer.HMI, 7)
    assert rack.bench.mode == AUTOMATIC
    assert rack.bench.image["value"][INPUT.at("target_x")] == TARGET["target_x"]
    assert any(rack.tick(20).bench.commands)
    rack.tick(25, beat=False)  # 0.5 s
    assert (rack.bench.mode, rack.bench.fault) == (FAULT, "target_timeout")
    assert rack.tick(3, beat=False).bench.commands == [0.0, 0.0, 0.0]
    assert rack.granted()[0] == Writer.NOBODY
    rack.ask(7, **TARGET)  # the page is back: its right is not
    assert rack.tick(5).granted()[0] == Writer.NOBODY
    assert rack.bench.mode == FAULT


def test_no_other_target_slips_in_when_the_page_is_lost(rack: Rack):
    rack.automatic()
    rack.planner = True  # starts while the page writes: it does not count
    rack.bench.set(target_x=-9.0)
    rack.tick(5)
    assert rack.bench.image["value"][INPUT.at("target_x")] == TARGET["target_x"]
    rack.ask(0)
    rack.tick(3)
    assert (rack.bench.mode, rack.bench.fault) == (FAULT, "target_timeout")
    rack.tick(2)
    assert rack.granted()[0] == Writer.PLANNER  # only now
    assert rack.bench.image["value"][INPUT.at("target_x")] == -9.0


def test_a_planner_that_is_alive_keeps_the_right(rack: Rack):
    rack.planner = True
    rack.ask(7, **{**TARGET, "target_x": -3.0})
    rack.tick(5)
    assert rack.granted()[:2] == (Writer.PLANNER, 0)
    assert rack.bench.image["value"][INPUT.at("target_x")] == TARGET["target_x"]
    rack.planner, rack.claimed = False, True  # a Modbus client with the right that has not written yet
    assert rack.tick(3).granted()[0] == Writer.PLANNER
    rack.claimed = False
    assert rack.tick(3).granted()[:2] == (Writer.HMI, 7)


def test_modbus_clients_are_told_busy_while_the_page_writes():
    class Client:
        writes = True

    taken = True
    holding = Holding(lambda state: None, lambda: taken)
    assert holding.write(Client(), 19, [4711], 0) is Refusal.BUSY
    taken = False
    assert holding.write(Client(), 19, [4711], 0) is None
    taken = True  # the page was a moment earlier
    holding.lapse(1)
    assert holding.owner is None


def test_forcing_shows_in_image_and_flags_and_ends_with_standby(rack: Rack):
    rack.tick(2)
    assert rack.bench.mode == STANDBY
    rack.force(5, q_boom=0.9, operator_enable=1.0)
    rack.tick(5)
    image, place = rack.bench.image, INPUT.at("q_boom")
    assert (image["value"][place], image["status"][place]) == (0.9, Status.FORCED)
    assert image["status"][INPUT.at("operator_enable")] == Status.OK  # never, whatever is asked for
    assert rack.bench.mode == STANDBY
    assert int(rack.bench.out("runtime_flags")) & Flag.FORCED
    assert rack.granted()[2:] == (5, 0)
    rack.bench.set(operator_enable=1.0)
    rack.tick(2)
    assert rack.bench.mode == ARMED
    assert (image["value"][place], image["status"][place]) == (rack.bench.values["q_boom"], Status.OK)
    assert rack.granted()[2:] == (0, 5)
    rack.bench.set(operator_enable=0.0)
    rack.tick(5)
    assert rack.bench.mode == STANDBY
    assert image["status"][place] == Status.OK  # it does not come back
    assert not int(rack.bench.out("runtime_flags")) & Flag.FORCED
    rack.force(6, q_boom=0.9)
    assert rack.tick(2).granted()[2] == 6


@pytest.mark.parametrize("mode", ["armed", "automatic"])
def test_forcing_is_refused_outside_standby(rack: Rack, mode: str):
    rack.automatic()
    if mode == "armed":
        rack.bench.set(automatic_request=0.0)
        rack.tick(5)
    expected = rack.bench.mode
    rack.force(5, q_boom=0.9)
    rack.tick(3)
    assert rack.bench.image["status"][INPUT.at("q_boom")] == Status.OK
    assert rack.granted()[2:] == (0, 5)
    assert rack.bench.mode == expected


def test_forcing_ends_with_the_process_that_asked_for_it(rack: Rack):
    rack.tick(2)
    rack.force(5, q_boom=0.9)
    assert rack.tick(20).granted()[2] == 5
    assert rack.tick(10).granted()[2] == 0


def test_a_forced_value_is_a_new_one_and_ends_when_nobody_asks_for_it(rack: Rack):
    rack.tick(2)
    rack.force(5, q_boom=0.9)
    rack.tick(3)
    assert rack.bench.image["age"][INPUT.at("q_boom")] == 0
    rack.force(0)
    assert rack.tick(1).granted()[2:] == (0, 0)
    assert rack.bench.image["status"][INPUT.at("q_boom")] == Status.OK
    rack.asked["forced"][INPUT.at("q_boom")] = 1  # without a number
    rack.ask(7)
    rack.tick(2)
    assert rack.bench.image["status"][INPUT.at("q_boom")] == Status.OK


def decided(rack: Rack, ahead_ns: int) -> tuple[int, ...]:
    """What is granted so long after the page said what it says."""
    rack.now += ahead_ns
    rack.bench.now += 1
    rack.bench.fill()
    for s in HOLDING:
        rack.bench.image["status"][INPUT.at(s.name)] = Status.NEVER
    rack.port.receive(rack.bench.image, rack.bench.now)
    return rack.granted()


@pytest.mark.parametrize(("ahead_ns", "writes", "forces"), [
    (0, True, True), (SECOND // 50, True, True), (SECOND // 2 - 1, True, True),
    (SECOND // 2, False, True), (SECOND // 2 + 1, False, False), (-1, False, True),
])  # fmt: skip
def test_a_page_lives_for_half_a_second_and_not_in_the_future(
    rack: Rack, ahead_ns: int, writes: bool, forces: bool
):
    rack.tick(2)
    rack.asked["targets"]["owner"] = 7
    rack.force(5, q_boom=0.9)
    assert decided(rack, ahead_ns) == (
        Writer.HMI if writes else Writer.NOBODY,
        7 if writes else 0,
        5 if forces else 0,
        0 if forces else 5,
    )


def test_a_page_commands_while_it_has_the_right_and_while_its_target_is_followed(rack: Rack):
    assert not rack.tick(3).port.commands()
    rack.automatic()
    assert rack.port.commands()
    rack.ask(0)
    rack.tick(1)
    assert rack.granted()[0] == Writer.NOBODY
    assert rack.port.commands()
    assert not rack.tick(3).port.commands()


def test_what_is_shown_is_what_the_core_saw(rack: Rack):
    rack.tick(2)
    rack.force(5, q_boom=0.9)
    rack.tick(6)
    seen = state_of(rack.cells[0], SEEN)
    assert seen is not None
    assert seen["inputs"]["status"][INPUT.at("q_boom")] == Status.FORCED
    assert seen["outputs"]["value"][OUTPUT.at("control_mode")] == STANDBY
    assert (int(seen["writer"]), int(seen["forcing"])) == (Writer.NOBODY, 5)
    assert seen["work"]["heard"].max() > 0


def test_while_pages_only_look_a_planner_is_shown_all_the_same(rack: Rack):
    rack.planner = True
    rack.tick(10)
    assert rack.granted()[0] == Writer.PLANNER


@pytest.mark.parametrize("name", ["SlewPosition", next(iter(MESSAGES)), [*MESSAGES][-1]])
def test_every_frame_that_was_heard_is_counted_once(rack: Rack, name: str):
    """Of messages that come in every third tick, and ticks that are skipped."""
    places = [INPUT.at(s.name) for s in INPUT.signals if s.can and s.can.message == name]
    heard = 0
    for tick in [t for t in range(1, 204) if t % 17]:
        rack.bench.image["age"][places] = tick % 3
        heard += tick % 3 == 0
        rack.port.receive(rack.bench.image, tick)
        rack.port.send(OUTPUT.new(), tick)
    seen = state_of(rack.cells[0], SEEN)
    assert seen is not None
    assert seen["work"]["heard"][list(MESSAGES).index(name)] == heard
