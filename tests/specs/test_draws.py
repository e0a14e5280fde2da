"""Machine draws: disjoint, reproducible, inside their bounds, wide enough, and the test set sealed."""

import math
import statistics
from pathlib import Path

import pytest

from specs import draws, keys, parameters
from specs.draws import Spread, draw, open_test_set
from specs.errors import InputError

KNOWN = parameters.load(*draws.FILES)
ALL = [("tuning", i) for i in range(24)] + [("validation", i) for i in range(24)]


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, int], dict[str, float]]:
    """All draws of the three sets; the opening is logged in a temporary file."""
    leave = open_test_set("test suite", tmp_path_factory.mktemp("draws") / "log")
    return {k: draw(*k) for k in ALL} | {("test", i): draw("test", i, leave) for i in range(48)}


def test_sizes_of_the_sets() -> None:
    assert draws.sets() == {"tuning": 24, "validation": 24, "test": 48}


def test_every_spread_belongs_to_a_parameter_and_stays_in_its_bounds() -> None:
    draws.check()


def test_nominal_machine_lies_inside_the_spreads() -> None:
    for name, spread in draws.spreads().items():
        low, high = spread.limits(KNOWN[name].value)
        assert low <= KNOWN[name].value <= high, name


def test_draws_are_disjoint(machines: dict[tuple[str, int], dict[str, float]]) -> None:
    for name in draws.spreads():
        values = [m[name] for m in machines.values()]
        assert len(set(values)) == len(values), name


def test_draws_are_reproducible_and_independent_of_order() -> None:
    first = draw("tuning", 3)
    draw("validation", 5)
    assert draw("tuning", 3) == first
    assert first != draw("tuning", 4)


def test_draws_stay_the_same_for_good() -> None:
    """Results quoted anywhere rest on these numbers; only a changed spread or nominal value moves them."""
    assert keys.uniform("draw", "tuning", 3, "slew_delay") == 0.7506254777889954
    low, high = draws.spreads()["slew_delay"].limits(KNOWN["slew_delay"].value)
    assert draw("tuning", 3)["slew_delay"] == pytest.approx(
        low + 0.7506254777889954 * (high - low), rel=1e-11
    )


def test_draws_fill_their_ranges(machines: dict[tuple[str, int], dict[str, float]]) -> None:
    for name, spread in draws.spreads().items():
        low, high = spread.limits(KNOWN[name].value)
        values = [m[name] for m in machines.values()]
        assert low <= min(values), name
        assert max(values) <= high, name
        assert max(values) - min(values) > (0.5 if spread.sd else 0.85) * (high - low), name
        assert abs(statistics.mean(values) - (low + high) / 2) < 0.15 * (high - low), name


KNOWN_RANGES = {
    "slew_delay": (0.1, 0.15),
    "slew_dead_band": (0.15, 0.18),
    "slew_bulk_modulus": (0.7e9, 1.2e9),
    "slew_chamber_volume": (1e-3, 2e-3),
    "slew_friction_viscous": (35e3, 53e3),
    "slew_friction_dry": (6e3, 11e3),
    "slew_boost_pressure": (15e5, 20e5),
    "grab_damping_pitch": (0.05, 0.2),
    "grab_damping_roll": (0.05, 0.2),
}


@pytest.mark.parametrize("name", KNOWN_RANGES)
def test_spreads_are_no_narrower_than_what_is_known(name: str) -> None:
    low, high = draws.spreads()[name].limits(KNOWN[name].value)
    assert low <= KNOWN_RANGES[name][0]
    assert high >= KNOWN_RANGES[name][1]


def test_tool_pendulum_spreads_over_its_known_length() -> None:
    """Length of the equivalent pendulum of the pitch: offset + com + gyration² / (offset + com)."""
    spread, offset = draws.spreads(), KNOWN["grab_offset"].value
    ends = []
    for side in (0, 1):
        com, gyration = (spread[n].limits(KNOWN[n].value)[side] for n in ("grab_com", "grab_gyration"))
        ends.append(offset + com + gyration**2 / (offset + com))
    assert ends[0] <= 1.5
    assert ends[1] >= 2.5
    periods = [2 * math.pi * math.sqrt(length / 9.81) for length in ends]
    assert periods[0] <= 2.5
    assert periods[1] >= 3.15


def test_every_sensor_has_noise_in_every_draw(machines: dict[tuple[str, int], dict[str, float]]) -> None:
    noises = [name for name in KNOWN if name.endswith("_noise")]
    assert len(noises) >= 6
    for name in noises:
        assert KNOWN[name].value > 0, name
        assert all(m[name] > 0 for m in machines.values()), name


def test_grouped_parameters_move_together(machines: dict[tuple[str, int], dict[str, float]]) -> None:
    for machine in machines.values():
        assert machine["slew_bulk_modulus"] == machine["arm_bulk_modulus"]
    ordered = sorted(machines.values(), key=lambda m: m["grab_com"])
    assert [m["grab_gyration"] for m in ordered] == sorted(m["grab_gyration"] for m in ordered)


def test_test_set_is_sealed() -> None:
    with pytest.raises(InputError, match="the test set is sealed: open it with open_test_set"):
        draw("test", 0)


def test_each_opening_is_logged(tmp_path: Path) -> None:
    log = tmp_path / "log"
    for purpose in ("pi 1.0", "pi 1.1"):
        assert len(draw("test", 47, open_test_set(purpose, log))) == len(draws.spreads())
    lines = log.read_text().splitlines()
    assert [line.split("\t")[0] for line in lines] == ["pi 1.0", "pi 1.1"]
    assert all(len(line.split("\t")) == 3 and all(line.split("\t")) for line in lines)


@pytest.mark.parametrize("purpose", ["", "  ", "two\nlines", "a\ttab"])
def test_opening_needs_a_purpose(purpose: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="needs a purpose"):
        open_test_set(purpose, tmp_path / "log")
    assert not (tmp_path / "log").exists()


@pytest.mark.parametrize(("name", "index"), [("tuning", 24), ("validation", -1), ("test", 48)])
def test_index_out_of_the_set(name: str, index: int) -> None:
    with pytest.raises(InputError, match=f"draw {index} of set {name}: valid are 0 to"):
        draw(name, index)


def test_unknown_set_names_the_nearest() -> None:
    with pytest.raises(InputError, match=r"unknown set of draws 'tunning'; did you mean tuning"):
        draw("tunning", 0)


def test_normal_distribution_is_cut_off() -> None:
    spread = Spread(parameters=("x",), reason="x", status="assumed", sd=2.0)
    assert spread.range == (-6.0, 6.0)
    assert (spread.quantile(0.0), spread.quantile(0.5)) == pytest.approx((-6.0, 0.0), abs=1e-9)
    assert spread.quantile(1.0) == pytest.approx(6.0)
    within = [abs(spread.quantile((i + 0.5) / 1000)) < 2.0 for i in range(1000)]
    assert statistics.mean(within) == pytest.approx(0.6827 / 0.9973, abs=2e-3)


GOOD = """
[sets]
tuning = 2

[[spread]]
parameters = ["gravity"]
low = 9.7
high = 9.9
reason = "pole to equator"
status = "sourced"

[[spread]]
parameters = ["boom_mass"]
relation = "factor"
low = 0.9
high = 1.1
reason = "equipment"
status = "assumed"
"""

MISTAKES = {
    "unknown parameter": ("gravity", "gravty", r"gravty: no such parameter; did you mean gravity"),
    "drawn twice": ("boom_mass", "gravity", r"gravity has a spread already"),
    "out of bounds": ("high = 9.9", "high = 30.0", r"gravity: parameter gravity = 30 m/s2 outside"),
    "empty range": ("high = 9.9", "high = 9.6", r"gravity\): empty range 9\.7 … 9\.6"),
    "no range": ("low = 9.7\n", "", r"gravity\): needs low and high, or sd"),
    "both kinds": ("low = 9.7\n", "low = 9.7\nsd = 1.0\n", r"gravity\): needs low and high, or sd"),
    "unknown relation": ('"factor"', '"times"', r"boom_mass\): relation: .*'times'"),
    "no reason": ("reason", "why", r"gravity\): unknown key why .*; missing reason"),
    "no status": ('status = "sourced"\n', "", r"gravity\): missing status"),
    "bad size": ("tuning = 2", 'tuning = "two"', r"sets: tuning: .*'two'"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named_with_file_and_key(
    mistake: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new, message = MISTAKES[mistake]
    assert old in GOOD
    monkeypatch.setattr(draws, "PATH", tmp_path / "draws.toml")
    draws.PATH.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        draws.check()
    assert "draws.toml: " in str(caught.value)
