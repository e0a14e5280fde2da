"""J1939 joysticks: every code of a field, and the operator's signals that come of them."""

import pytest
from hypothesis import given, strategies as st

from runtime.can.joystick import ABSENT, ERROR, GROUPS, NO, YES, Joystick, Joysticks, axis_value, button_value
from runtime.can.port import CanPort
from runtime.can.wire import EXTENDED
from runtime.configuration import read
from runtime.image import INPUT, Status, timeout_ticks
from specs.errors import InputError
from specs.signals import signal
from tests.conftest import ROOT

LEFT, RIGHT = 0x85, 0x86


def axis_bytes(count: int, neutral: int = NO, negative: int = NO, positive: int = NO) -> bytes:
    return bytes((neutral | negative << 2 | positive << 4 | (count & 3) << 6, count >> 2))


def frame(x: bytes, y: bytes = b"\xc1\x00", buttons: bytes = b"\0\0\0") -> bytes:
    return x + y + b"\xff" + buttons


def bjm(source: int, group: str = "BJM1") -> int:
    return 3 << 26 | GROUPS[group] << 8 | source


@pytest.mark.parametrize(
    ("data", "wanted"),
    [
        (axis_bytes(0, YES), (0.0, Status.OK)),
        (axis_bytes(1000, NO, NO, YES), (1.0, Status.OK)),
        (axis_bytes(1000, NO, YES, NO), (-1.0, Status.OK)),
        (axis_bytes(250, NO, YES, NO), (-0.25, Status.OK)),
        (axis_bytes(7, YES), (0.0, Status.OK)),  # play around neutral
        (axis_bytes(1022, NO, YES, NO), (0.0, Status.ERROR)),
        (axis_bytes(1023, NO, YES, NO), (0.0, Status.NOT_AVAILABLE)),
        (axis_bytes(1001, NO, YES, NO), (0.0, Status.RANGE)),
        (axis_bytes(500, NO, ERROR, NO), (0.0, Status.ERROR)),
        (axis_bytes(500, NO, NO, ABSENT), (0.0, Status.NOT_AVAILABLE)),
        (axis_bytes(500, NO, YES, YES), (0.0, Status.ERROR)),
        (axis_bytes(500, YES, YES, NO), (0.0, Status.ERROR)),
        (axis_bytes(500, NO, NO, NO), (0.0, Status.ERROR)),
    ],
)
def test_an_axis(data: bytes, wanted: tuple[float, Status]) -> None:
    assert axis_value(frame(data), "x") == wanted
    assert axis_value(b"\xc1\x00" + data + bytes(4), "y") == wanted
    assert axis_value(bytes(4) + data + bytes(2), "theta") == wanted


@given(st.binary(min_size=8, max_size=8), st.sampled_from(["x", "y", "theta"]))
def test_whatever_comes_only_a_clear_deflection_is_one(data: bytes, axis: str) -> None:
    value, status = axis_value(data, axis)
    assert -1.0 <= value <= 1.0
    assert value == 0.0 or status == Status.OK


@pytest.mark.parametrize(
    ("bits", "wanted"), [(0, 0.0), (1, 1.0), (2, Status.ERROR), (3, Status.NOT_AVAILABLE)]
)
@pytest.mark.parametrize("button", [1, 4, 5, 12])
def test_a_button(bits: int, wanted: float | Status, button: int) -> None:
    at, within = divmod(button - 1, 4)
    data = bytearray(8)
    data[5 + at] = bits << (6 - 2 * within)
    value, status = button_value(bytes(data), button)
    assert (status if isinstance(wanted, Status) else value) == wanted


def seen(joystick: Joystick, name: str, tick: int) -> tuple[float, int, Status]:
    image = INPUT.new()
    joystick.fill(image, tick)
    i = INPUT.at(name)
    return float(image["value"][i]), int(image["age"][i]), Status(int(image["status"][i]))


def test_the_operators_signals() -> None:
    joystick = Joystick()
    assert seen(joystick, "joystick_slew", 5)[1:] == (-1, Status.NEVER)
    right = frame(axis_bytes(500, NO, NO, YES), axis_bytes(200, NO, YES, NO), b"\x40\0\0")
    assert joystick.take(bjm(LEFT), right, 10)
    assert seen(joystick, "joystick_slew", 10) == (-0.5, 0, Status.OK)  # to the right: clockwise
    assert seen(joystick, "joystick_stick", 10) == (-0.2, 0, Status.OK)
    assert seen(joystick, "operator_enable", 10) == (1.0, 0, Status.OK)
    assert seen(joystick, "joystick_boom", 10)[2] == Status.NEVER
    assert joystick.take(bjm(RIGHT), right, 11)
    assert seen(joystick, "joystick_boom", 11) == (0.2, 0, Status.OK)
    assert seen(joystick, "operator_heartbeat", 11) == (2.0, 0, Status.OK)
    late = timeout_ticks(signal("joystick_slew"))
    assert seen(joystick, "joystick_slew", 10 + late) == (-0.5, late, Status.TIMEOUT)


def test_a_slow_joystick_has_more_time() -> None:
    joystick = Joystick(Joysticks(cycle_ms=100))
    joystick.take(bjm(LEFT), frame(axis_bytes(0, YES)), 0)
    assert seen(joystick, "joystick_slew", 20)[2] == Status.OK
    assert seen(joystick, "joystick_slew", 25)[2] == Status.TIMEOUT


def test_others_frames_are_left_alone() -> None:
    joystick = Joystick()
    assert not joystick.take(bjm(0x33), frame(axis_bytes(0, YES)), 0)
    assert not joystick.take(bjm(LEFT, "EJM1"), frame(axis_bytes(0, YES)), 0)
    assert not joystick.take(bjm(LEFT), b"\0" * 7, 0)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="every 20 to 100 ms"):
        Joysticks(cycle_ms=10)
    with pytest.raises(InputError, match="button 13: 1 to 12"):
        Joysticks(enable=type(Joysticks().enable)(source=1, group="BJM1", button=13))


def test_in_the_port_it_stands_for_the_panels_message() -> None:
    class Source:
        def __init__(self) -> None:
            self.frames = [(bjm(LEFT) | EXTENDED, frame(axis_bytes(300, NO, YES, NO)), 1 << 62)]

        def recv_raw(self):
            return self.frames.pop() if self.frames else None

        def send_raw(self, identifier: int, data: bytes) -> None:
            raise AssertionError

    port, image = CanPort(Source(), joystick=Joystick()), INPUT.new()
    port.receive(image, 0)
    assert image["value"][INPUT.at("joystick_slew")] == pytest.approx(0.3)
    assert image["status"][INPUT.at("joystick_slew")] == Status.OK
    port.receive(image, 3)
    assert image["age"][INPUT.at("joystick_slew")] == 3


def test_a_configuration_names_them(tmp_path) -> None:
    path = tmp_path / "machine.toml"
    lines = [
        'bundle = "b"',
        "[can]",
        'interface = "slewright"',
        'channel = "bus"',
        "[can.joystick]",
        "cycle_ms = 100",
    ]
    axis = ["[can.joystick.slew]", "source = 0x21", 'group = "EJM1"', 'axis = "theta"']
    path.write_text("\n".join(lines + axis))
    found = read(path).can.joystick
    assert found is not None
    assert (found.cycle_ms, found.slew.source, found.slew.group) == (100, 0x21, "EJM1")
    assert found.boom == Joysticks().boom
    path.write_text("\n".join([*lines, *axis, "colour = 3"]))
    with pytest.raises(InputError, match="colour"):
        read(path)


def test_the_page_shows_what_it_is_without_the_lines(tmp_path) -> None:
    page = (ROOT / "docs" / "reference" / "buses.md").read_text()
    shown = "[can.joystick]\n" + page.partition("```toml\n[can.joystick]\n")[2].partition("```")[0]
    path = tmp_path / "machine.toml"
    path.write_text('bundle = "b"\n[can]\ninterface = "slewright"\nchannel = "bus"\n' + shown)
    assert "automatic" in shown
    assert read(path).can.joystick == Joysticks()
