"""A J1939 engine: every code of its speed, in place of what the machine's own message says."""

from math import pi

import pytest

from runtime.can.codec import received_by
from runtime.can.engine import GROUP, Engine, EngineSpeed
from runtime.can.native import NativePort
from runtime.can.port import CanPort
from runtime.can.wire import EXTENDED
from runtime.configuration import read
from runtime.image import INPUT, NODE, TICK_S, Status
from specs.errors import InputError
from tests.conftest import ROOT
from tests.runtime.racks import core

RPM = pi / 30.0
SPEED = INPUT.at("engine_speed")


def eec1(count: int, source: int = 0) -> tuple[int, bytes]:
    return 3 << 26 | GROUP << 8 | source, b"\xf0\x7d\x7d" + count.to_bytes(2, "little") + b"\xff\xff\xff"


@pytest.mark.parametrize(
    ("count", "rpm", "status"),
    [
        (0, 0.0, Status.OK),
        (14400, 1800.0, Status.OK),
        (0xFAFF, 0.0, Status.RANGE),  # 8032 rpm: more than the signal may be
        (0xFB00, 0.0, Status.RANGE),
        (0xFE00, 0.0, Status.ERROR),
        (0xFFFF, 0.0, Status.NOT_AVAILABLE),
    ],
)
def test_a_speed(count: int, rpm: float, status: Status) -> None:
    engine, image = EngineSpeed(), INPUT.new()
    assert engine.take(*eec1(count), 5)
    engine.fill(image, 7)
    assert image["value"][SPEED] == pytest.approx(rpm * RPM)
    assert (image["age"][SPEED], image["status"][SPEED]) == (2, status)


def test_what_is_not_a_value_leaves_the_last_one_and_silence_is_a_timeout() -> None:
    engine, image = EngineSpeed(Engine(source=1)), INPUT.new()
    engine.fill(image, 0)
    assert (image["age"][SPEED], image["status"][SPEED]) == (-1, Status.NEVER)
    assert engine.take(*eec1(8000, source=1), 0)
    assert not engine.take(*eec1(14400), 1)  # another engine
    assert not engine.take(eec1(14400, source=1)[0], b"\0" * 7, 1)
    assert engine.take(*eec1(0xFE00, source=1), 1)
    engine.fill(image, 1)
    assert image["value"][SPEED] == pytest.approx(1000.0 * RPM)
    engine.fill(image, 1 + round(3.0 / TICK_S))
    assert image["status"][SPEED] == Status.TIMEOUT


@pytest.mark.parametrize("native", [False, True])
def test_in_the_port_it_stands_for_the_machines_own_field_alone(native: bool) -> None:
    slow = next(c for c in received_by(NODE) if c.message.name == "MachineSlow")
    values = {"engine_speed": 100.0, "oil_temperature": 320.0, "supply_voltage": 24.0}
    data = slow.pack([values[f.name] for f in slow.fields], 0)
    number, frame = eec1(14400)

    class Source:
        def __init__(self) -> None:
            self.frames = [
                (slow.message.frame_id | EXTENDED, data, 1 << 62),
                (number | EXTENDED, frame, 1 << 62),
            ]

        def recv_raw(self):
            return self.frames.pop() if self.frames else None

        def send_raw(self, identifier: int, data: bytes) -> None:
            raise AssertionError

    engine, image = EngineSpeed(), INPUT.new()
    port = NativePort(Source(), core().library, engine=engine) if native else CanPort(Source(), engine=engine)
    port.receive(image, 0)
    assert image["value"][SPEED] == pytest.approx(1800.0 * RPM)
    assert image["value"][INPUT.at("supply_voltage")] == pytest.approx(24.0)


def test_a_configuration_names_its_address(tmp_path) -> None:
    path, can = tmp_path / "machine.toml", 'bundle = "b"\n[can]\ninterface = "slewright"\nchannel = "bus"\n'
    page = (ROOT / "docs" / "reference" / "buses.md").read_text()
    path.write_text(can + "[can.engine]\n" + page.partition("```toml\n[can.engine]\n")[2].partition("```")[0])
    assert read(path).can.engine == Engine()
    path.write_text(can + "[can.engine]\nsource = 254\n")
    with pytest.raises(InputError, match="addresses are 0 to 253"):
        read(path)
    path.write_text(can)
    assert read(path).can.engine is None
