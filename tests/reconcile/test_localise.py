"""Where the disagreement is: the regime in plain words, what it goes with, and no regime for a constant."""

import numpy as np
import pytest

from reconcile import localise
from reconcile.localise import THROUGHOUT
from tests.reconcile.answers import answered, recorded
from tests.reconcile.effects import SINGLE, dead_zone, lag
from tests.reconcile.truth import Truth, coulomb


def where(truth: Truth, seed: int = 3) -> list[dict]:
    found = answered(recorded(truth, seconds=24.0, seed=seed))
    return localise.rows(found.core, found.located)


@pytest.mark.parametrize("seed", [3, 5])
def test_a_missing_friction_goes_with_speed(seed):
    first = where(Truth(**coulomb(1.0)), seed)[0]
    assert (first["quantity"], first["goes_with"]) == ("missing force at v", "v")


@pytest.mark.parametrize("seed", [3, 5])
def test_a_dead_zone_goes_with_the_command(seed):
    assert where(Truth(inputs=dead_zone(1.0)), seed)[0]["goes_with"] == "force"


@pytest.mark.parametrize("seed", [3, 5])
def test_gravity_goes_with_the_pose(seed):
    first = where(Truth(force=lambda x, v, t: -3.0 * np.sin(2.0 * x)), seed)[0]
    assert first["goes_with"] == "x"
    assert " x " in f" {first['regime'].replace(',', ' ')} "


@pytest.mark.parametrize(
    "truth",
    [Truth(velocity=lambda v: v + 0.05), Truth(force=lambda x, v, t: 1.5)],
    ids=["sensor bias", "constant load"],
)
def test_a_constant_has_no_regime(truth):
    rows = where(truth)
    assert [(r["regime"], r["share"], r["goes_with"]) for r in rows] == [(THROUGHOUT, 1.0, None)]


def test_sensors_that_contradict_each_other_are_seen_in_the_sensor_and_not_as_a_force():
    first = where(SINGLE["sensor_scale"][0])[0]
    # which of two sensors is wrong cannot be told
    assert first["quantity"] == f"error of {first['signal']}"


def test_a_lag_of_the_input_goes_with_neither_speed_nor_pose():
    assert where(Truth(inputs=lag(0.12)))[0]["goes_with"] not in ("v", "x")


def test_nothing_is_said_where_nothing_disagrees():
    assert where(Truth()) == []


def test_the_residual_force_has_the_missing_ones_shape_with_wrong_parameters_as_well():
    found = answered(recorded(Truth(mass=2.6, force=lambda x, v, t: -1.5 * x), seconds=24.0, seed=3))
    located = found.located[0]
    assert (located.residual.name, located.residual.unit) == ("missing force at v", "N")
    pose = next(r for r in located.against if r.kind == "pose")
    assert located.best == pose
    x, means = located.against[pose], located.values
    assert np.corrcoef(x, means)[0, 1] < -0.85
