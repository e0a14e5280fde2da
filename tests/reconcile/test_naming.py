"""What is put into the rig is named with its parameters; nothing is named where nothing is missing."""

import numpy as np
import pytest

from tests.reconcile.effects import SINGLE, dead_zone, delay
from tests.reconcile.truth import Truth, coulomb

QUICK = "sensor_scale"
TWINS = {"input_lag": "sensor_lag"}  # of all sensors together: what nobody can tell apart
OFTEN = ("stiffness", "input_dead_zone")  # in continuous integration


def named(figures: dict) -> list[str]:
    return sorted(e["name"] for e in figures["effects"])


def check_parameters(figures: dict, name: str, wanted: dict[str, float]) -> None:
    found = next(e["parameters"] for e in figures["effects"] if e["name"] == name)
    for parameter, value in wanted.items():
        assert found[parameter]["value"] == pytest.approx(value, rel=0.15)


def check_single(examined, name: str) -> None:
    truth, wanted = SINGLE[name]
    figures = examined(truth, seconds=25.0, seed=4)
    if (twin := TWINS.get(name)) and figures["verdict"] == "ambiguous":
        assert sorted(map(tuple, figures["alternatives"])) == sorted([(name,), (twin,)])
    else:
        assert figures["verdict"] == "named"
    assert named(figures) == [name]
    if name == "sensor_scale" and figures["effects"][0]["port"] == "position":
        wanted = {"error": 1.0 / (1.0 + wanted["error"]) - 1.0}  # the same, seen from the other sensor
    check_parameters(figures, name, wanted)
    assert figures["residual_status"] == "at_floor"
    for gap in figures["gap"].values():
        assert gap["after"] < 0.1 * gap["nominal"] + 2.0 * gap["floor"]


@pytest.mark.parametrize("name", [QUICK, *(pytest.param(n, marks=pytest.mark.long) for n in OFTEN)])
def test_an_effect_alone_is_named_with_its_parameters(examined, name):
    check_single(examined, name)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("name", sorted(set(SINGLE) - {QUICK, *OFTEN}))
def test_every_other_effect_alone_is_named_with_its_parameters(examined, name):
    check_single(examined, name)


@pytest.mark.long
@pytest.mark.parametrize("seed", [1])
def test_nothing_is_named_when_nothing_is_missing(examined, seed):
    figures = examined(Truth(), seconds=20.0, seed=seed)
    assert figures["verdict"] == "agrees"
    assert figures["effects"] == []
    assert figures["reestimated"] == {}


@pytest.mark.slow
@pytest.mark.long
def test_what_no_effect_is_like_is_not_named(examined):
    waves = Truth(force=lambda x, v, t: -0.05 * np.cos(6.0 * x) * np.sign(v))  # friction by place
    figures = examined(waves, seconds=25.0, seed=6)
    assert figures["verdict"] in ("unexplained", "agrees")
    assert figures["effects"] == []


def test_a_wrong_parameter_is_reestimated_and_no_effect(examined):
    figures = examined(Truth(mass=2.4, drag=1.1), seconds=20.0, seed=5)
    assert figures["verdict"] == "reestimated"
    assert figures["effects"] == []
    moved = figures["reestimated"]
    assert moved["mass"]["new"] == pytest.approx(2.4, rel=0.01)
    assert moved["drag"]["new"] == pytest.approx(1.1, rel=0.01)
    assert moved["mass"]["ci95"][0] < 2.4 < moved["mass"]["ci95"][1]


@pytest.mark.slow
@pytest.mark.long
def test_friction_and_dead_zone_are_told_apart(examined):
    figures = examined(Truth(inputs=dead_zone(1.0), **coulomb(0.8)), seconds=40.0, seed=3)
    assert named(figures) == ["coulomb_friction", "input_dead_zone"]


@pytest.mark.slow
@pytest.mark.long
def test_a_late_input_and_late_sensors_cannot_be_told_apart_and_that_is_said(examined):
    figures = examined(Truth(inputs=delay(0.06)), seconds=20.0, seed=2)
    assert figures["verdict"] == "ambiguous"
    sets = [set(names) for names in figures["alternatives"]]
    assert {"input_delay"} in sets
    assert {"sensor_delay"} in sets
    assert all(names & {"input_delay", "sensor_delay"} for names in sets)


def test_too_little_excitation_is_said(examined):
    figures = examined(Truth(), seconds=20.0, seed=1, size=0.0)
    assert figures["verdict"] == "insufficient_excitation"
    assert "force is constant" in figures["sentence"]
    assert figures["effects"] == []
