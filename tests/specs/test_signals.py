"""The signal definition: complete places, no overlap, and a clear word about every mistake in it."""

import math
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest

from specs.errors import InputError, nearest
from specs.signals import PATH, WIRED, Signal, definition, signal, signals
from specs.wire import CanPlace, bus_load, frame_bits

Edit = Callable[[str, str], Path]


@pytest.fixture
def edited(tmp_path: Path) -> Edit:
    """Copies signals.toml with the first occurrence of one text replaced by another."""

    def edit(old: str, new: str) -> Path:
        text = PATH.read_text(encoding="utf-8")
        assert old in text
        path = tmp_path / "signals.toml"
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        return path

    return edit


def test_every_wired_signal_has_its_places_and_no_other_has() -> None:
    for s in signals().values():
        assert (s.can is not None) == (s.modbus is not None) == (s.kind in WIRED), s.name


def test_every_signal_is_described_with_range_and_start_inside() -> None:
    for s in signals().values():
        assert s.description, s.name
        assert s.min is not None, s.name
        assert s.max is not None, s.name
        assert s.min <= s.start <= s.max, s.name
        assert s.nominal is None or s.nominal > 0, s.name


def test_wired_signals_time_out_after_several_cycles() -> None:
    for s in signals().values():
        if s.can:
            assert s.rate_hz is not None
            assert s.timeout_s is not None
            assert 3 <= s.timeout_s * s.rate_hz <= 10, s.name


@pytest.mark.parametrize(
    ("kind", "rate"),
    [("command", 50.0), ("sensor", 50.0), ("target", 10.0)],
    ids=["command", "sensor", "target"],
)
def test_rates_by_kind(kind: str, rate: float) -> None:
    assert {s.rate_hz for s in signals().values() if s.kind == kind} == {rate}


def test_resolution_is_finer_than_control_needs() -> None:
    """One count: 1e-4 rad, 1e-4 rad/s, 0.1 bar, 1e-4 of full joystick, 1 mm."""
    finest = {"rad": 1e-4, "rad/s": 1e-4, "Pa": 1e4, "m": 1e-3, "m/s2": 1e-3}
    for s in signals().values():
        if s.can and s.unit in finest and s.kind != "status":
            assert s.can.scale <= finest[s.unit] * (1 + 1e-12), s.name
    assert all(s.can.scale <= 1e-4 for s in map(signal, ("u_slew", "u_boom", "u_stick")) if s.can)


def test_bus_load_is_below_sixty_percent() -> None:
    assert frame_bits(8) == 160  # the known worst case of an extended frame with eight data bytes
    bus = definition().bus
    frames = sum(1000 / m.cycle_ms for m in bus.messages.values())
    assert bus_load(bus) == pytest.approx(frames * 160 / bus.bit_rate)
    assert 0.1 < bus_load(bus) < 0.6


def test_bits_of_either_byte_order() -> None:
    little = CanPlace(message="M", start=4, length=8)
    big = CanPlace(message="M", start=3, length=8, byte_order="big_endian")
    assert little.bits == set(range(4, 12))
    assert big.bits == {3, 2, 1, 0, 15, 14, 13, 12}


def test_causality_on_both_sides() -> None:
    assert signal("u_slew").causality("machine") == "input"
    assert signal("u_slew").causality("controller") == "output"
    assert signal("p_slew_a").causality("machine") == "output"
    assert signal("target_x").causality("machine") is None
    assert signal("control_mode").causality("controller") == "output"
    assert signal("machine_ready").causality("controller") == "input"
    assert signal("true_tool_x").causality("controller") is None


def test_unknown_signal_names_the_nearest() -> None:
    with pytest.raises(InputError, match=r"unknown signal 'u_slw'; did you mean u_slew"):
        signal("u_slw")


def test_signals_are_frozen() -> None:
    with pytest.raises(FrozenInstanceError):
        signal("u_slew").min = 0.0  # type: ignore[misc]
    signals().clear()
    assert isinstance(signal("u_slew"), Signal)


MISTAKES = {
    "unknown unit": ('unit = "rad/s"', 'unit = "rad/sec"', r"\.unit: unknown unit 'rad/sec'; .*rad/s"),
    "missing unit": ('unit = "1"\n', "", r"signal\.u_slew: missing unit"),
    "unknown kind": ('kind = "command"', 'kind = "order"', r"signal\.u_slew: kind: .*'order'"),
    "unknown key": ("vr = 1\n", "vr = 1\ncolour = 3\n", r"signal\.u_slew: unknown key colour"),
    "value reference twice": ("vr = 2\n", "vr = 1\n", r"signal\.u_boom\.vr: 1 already belongs to u_slew"),
    "retired reference": (
        "[retired]\n",
        '[retired]\n3 = "old"\n',
        r"signal\.u_stick\.vr: 3 already belongs to old",
    ),
    "reference of a parameter": ("vr = 1\n", "vr = 1001\n", r"signal\.u_slew\.vr: 1001 outside 1–999"),
    "start outside": ("start = 1.1", "start = 9.9", r"signal\.q_boom\.start: 9\.9 outside"),
    "wrong rate": ("rate_hz = 50.0", "rate_hz = 10.0", r"signal\.u_slew\.rate_hz: 10\.0 but .* 50 Hz"),
    "unknown message": ('message = "SlewCommand"', 'message = "SlewComand"', r"did you mean SlewCommand"),
    "bits overlap": (
        "start = 32, length = 16",
        "start = 31, length = 16",
        r"signal\.u_boom\.can: bit 31 .* u_slew's",
    ),
    "bits of the counter": (
        "start = 12, length = 2",
        "start = 11, length = 2",
        r"signal\.control_enable\.can: bit 11 of SlewCommand protects it",
    ),
    "data_id twice": ("data_id = 0x5111", "data_id = 0x5110", r"can\.message: a data_id is used twice"),
    "data_id too large": ("data_id = 0x5111", "data_id = 0x15111", r"data_id = 86289: outside 0 … 65535"),
    "service where a signal is": (
        "address = 18",
        "address = 17",
        r"commit: holding 17 is signal\.planner_heartbeat\.modbus's",
    ),
    "outside the frame": (
        "start = 48, length = 16",
        "start = 56, length = 16",
        r"bit 64 lies outside SlewCommand",
    ),
    "range too small": ("scale = 3.125e-5", "scale = 1e-5", r"signal\.u_slew\.can: carries -1 … "),
    "registers overlap": ("address = 7,", "address = 6,", r"signal\.u_boom\.modbus: input 6 is .*u_slew.*'s"),
    "header overwritten": ("address = 5,", "address = 4,", r"signal\.u_slew\.modbus: 4 outside 5–"),
    "unknown node": ('receivers = ["Machine"]', 'receivers = ["Machin"]', r"unknown node Machin; .*Machine"),
    "identifier twice": ("pgn = 0xFF11", "pgn = 0xFF10", r"can\.message: an identifier is used twice"),
    "standard group": ("pgn = 0xFF10", "pgn = 0xFDD7", r"SlewCommand: pgn = 64983: outside"),
    "not TOML": ("[can]", "[can", r"not valid TOML"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named_with_file_and_key(mistake: str, edited: Edit) -> None:
    old, new, message = MISTAKES[mistake]
    with pytest.raises(InputError, match=message) as caught:
        definition(edited(old, new))
    assert "signals.toml" in str(caught.value)
    assert "\n" not in str(caught.value) or mistake == "not TOML"


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.toml: cannot be read"):
        definition(tmp_path / "nothing.toml")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("policy_u_slew", 1.0, ""),
        ("policy_u_slew", 1.25, "policy_u_slew = 1.25: outside -1 … 1"),
        ("target_x", math.nan, "target_x = nan m: outside -25 … 25"),
        ("target_x", -math.inf, "target_x = -inf m: outside -25 … 25"),
        ("policy_heartbeat", 251, "policy_heartbeat = 251: outside 0 … 250"),
    ],
)
def test_a_value_that_cannot_be_a_signals_is_named(name: str, value: float, said: str):
    assert signal(name).wrong(value) == said


def test_without_any_choice_that_is_said() -> None:
    assert nearest("u_slw", []) == "there is none"
