"""Scenarios: the six runs of the paper, their loads, schedules and limits."""

import copy
import math
from itertools import pairwise
from typing import Any

import pytest

from fmus.equations import kinematics
from specs import limits, scenario
from specs.errors import InputError
from specs.schema import read_toml

SIX = {f"{base}_{load}" for base in ("four_targets", "five_targets") for load in ("empty", "2t", "unknown")}


def test_there_are_six() -> None:
    assert set(scenario.names()) == SIX


@pytest.mark.parametrize("name", sorted(SIX))
def test_targets_are_what_the_metrics_ask_for(name: str) -> None:
    run = scenario.load(name)
    assert run.name == name
    assert len(run.targets) == (4 if name.startswith("four") else 5)
    assert run.interval_ticks == 750
    assert run.duration_ticks == 750 * len(run.targets)
    slews = [run.start.slew_deg, *(t.slew_deg for t in run.targets)]
    steps = [abs(b - a) for a, b in pairwise(slews)]
    assert all(45 <= step <= 135 for step in steps)
    assert {45.0, 135.0} <= set(steps)  # both ends of the mix
    assert all(7 <= t.radius_m <= 11 and 4 <= t.height_m <= 8 for t in run.targets)


@pytest.mark.parametrize("name", sorted(SIX))
def test_the_arm_reaches_every_target_in_its_pose_range(name: str) -> None:
    run, p = scenario.load(name), kinematics.geometry()
    for target in run.targets:
        assert kinematics.reachable(*target.xyz) is None
        slew, boom, stick = (float(q) for q in kinematics.inverse(*target.xyz, p))
        assert 0.8 <= boom <= 1.4, target
        assert -2.1 <= stick <= -0.3, target
        assert math.degrees(slew) == pytest.approx(target.slew_deg, abs=1e-6)
    assert 0.8 <= run.start.q_boom <= 1.4
    assert -2.1 <= run.start.q_stick <= -0.3


def test_loads() -> None:
    empty, full, unknown = (scenario.load(f"four_targets_{load}") for load in ("empty", "2t", "unknown"))
    assert (empty.true_load(1), empty.load.told_kg) == (0.0, 0.0)
    assert (full.true_load(1), full.load.told_kg) == (2000.0, 2000.0)
    drawn = [unknown.true_load(seed) for seed in range(200)]
    assert unknown.load.told_kg == 0.0
    assert min(drawn) >= 0.0
    assert max(drawn) < 2000.0
    assert min(drawn) < 100.0
    assert max(drawn) > 1900.0
    assert sum(drawn) / 200 == pytest.approx(1000.0, abs=150.0)
    assert unknown.true_load(7) == drawn[7]


def test_drawn_load_is_the_same_for_good() -> None:
    """Results quoted anywhere rest on these numbers."""
    assert scenario.load("four_targets_unknown").true_load(1) == pytest.approx(987.4348239379935, rel=1e-15)
    assert scenario.load("five_targets_unknown").true_load(1) == pytest.approx(1335.03053415543, rel=1e-15)


def test_stimuli_change_at_the_targets() -> None:
    run = scenario.load("five_targets_2t")
    changes = run.stimuli(pace=0.5)
    assert list(changes) == [0, 750, 1500, 2250, 3000]
    assert changes[0]["load_told"] == 2000.0
    assert changes[0]["pace"] == 0.5
    for tick, target, entry in zip(changes, run.targets, run.schedule(), strict=True):
        x, y, z = target.xyz
        told = changes[tick]
        assert (told["target_x"], told["target_y"], told["target_z"]) == (x, y, z)
        assert entry == {"time": tick * 0.02, "x": x, "y": y, "z": z}
        assert math.hypot(x, y) == pytest.approx(target.radius_m)


def test_run_parameters_exist_in_the_geometry() -> None:
    known = scenario.load("four_targets_unknown").parameters(seed=3)
    assert set(known) <= set(vars(kinematics.geometry()))
    assert known["load_mass"] == scenario.load("four_targets_unknown").true_load(3)


@pytest.mark.parametrize("name", sorted(SIX))
@pytest.mark.parametrize("system", ["nominal", "reference"])
def test_limits_of_the_shipped_controller_have_reasons(name: str, system: str) -> None:
    found = scenario.load(name).limits("policy", system)
    assert {"missed", "speed", "overshoot", "overshoot_max", "error", "tool"} <= set(found)
    for metric, limit in found.items():
        assert limit["reason"], metric
        assert "min" in limit or "max" in limit


def test_no_limits_for_a_controller_without_any() -> None:
    assert scenario.load("four_targets_empty").limits("nobody", "nominal") == {}
    assert ("policy", "reference") in limits.pairs()


def test_unknown_scenario_names_the_valid_ones() -> None:
    with pytest.raises(
        InputError, match=r"unknown scenario 'four_targets_3t'; did you mean.*five_targets_empty"
    ):
        scenario.load("four_targets_3t")


def _edit(data: dict[str, Any], path: tuple[Any, ...], value: Any) -> None:
    *way, last = path
    for key in way:
        data = data[key]
    if value is None:
        del data[last]
    else:
        data[last] = value


MISTAKES = {
    "step too large": (
        ("targets", 1, "slew_deg"),
        -80.0,
        r"targets\.2: 140° from the one before, not 45–135°",
    ),
    "step too small": (("targets", 0, "slew_deg"), 44.0, r"targets\.1: 44° from the one before"),
    "too low": (("targets", 2, "height_m"), 1.9, r"targets\.3: height_m = 1\.9: keep-out, at least 2 m"),
    "too near": (("targets", 3, "radius_m"), 1.0, r"targets\.4: radius_m = 1: keep-out"),
    "missing radius": (("targets", 0, "radius_m"), None, r"targets\.1: missing radius_m"),
    "unknown key": (("targets", 0, "hight_m"), 5.0, r"targets\.1: unknown key hight_m"),
    "no start": (("start",), None, r"missing start"),
    "no targets": (("targets",), [], r"targets: at least one"),
    "uneven interval": (("interval_s",), 15.01, r"interval_s = 15\.01: not a multiple of 0\.02 s"),
    "negative load": (("loads", "2t", "low_kg"), -1.0, r"loads\.2t: low_kg = -1, .*0 <= low <= high"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named_with_file_and_key(mistake: str) -> None:
    path, value, message = MISTAKES[mistake]
    data = copy.deepcopy(read_toml(scenario.FOLDER / "four_targets.toml"))
    _edit(data, path, value)
    with pytest.raises(InputError, match=message) as caught:
        scenario.build("four_targets", "2t", data, "specs/scenarios/four_targets.toml")
    assert str(caught.value).startswith("specs/scenarios/four_targets.toml: ")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[pi.nominal]\nspede = { min = 1.0, reason = "x" }\n', r"pi\.nominal: no metric 'spede'; .*speed"),
        ("[pi.nominal]\nspeed = { min = 1.0 }\n", r"pi\.nominal\.speed: missing reason"),
        ('[pi.nominal]\nspeed = { min = 1.0, reason = "" }\n', r"pi\.nominal\.speed: empty reason"),
        ('[pi.nominal]\nspeed = { reason = "x" }\n', r"pi\.nominal\.speed: needs min or max"),
    ],
)
def test_mistakes_in_limits(text: str, message: str, tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "limits.toml"
    path.write_text(text)
    monkeypatch.setattr(limits, "PATH", path)
    with pytest.raises(InputError, match=message):
        limits.load("policy", "nominal")


def test_limits_may_differ_between_scenarios() -> None:
    limit = limits.Limit(reason="x", max={"four_targets_2t": 3.0})
    assert limit.on("four_targets_2t") == {"max": 3.0, "reason": "x"}
    with pytest.raises(InputError, match="five_targets_2t"):
        limit.on("five_targets_2t")
