"""Where the disagreement is: the regime in plain words, what it goes with, and no regime for a constant."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reconcile.errors import localise, regimes
from reconcile.errors.localise import THROUGHOUT
from reconcile.recordings.data import split
from tests.reconcile.answers import answered, recorded, rig
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


@pytest.mark.parametrize("pace", [1e-3, 1.0, 450.0])
def test_changes_of_a_command_are_looked_at_over_samples_of_the_recording(pace):
    def slower(signals):
        return {n: replace(s, time=pace * s.time) for n, s in signals.items()}

    (run,) = recorded(Truth(), seconds=24.0)
    run = replace(
        run,
        start_s=pace * run.start_s,
        end_s=pace * run.end_s,
        inputs=slower(run.inputs),
        outputs=slower(run.outputs),
    )
    folder = rig()
    study: Any = SimpleNamespace(model=folder.model, folder=folder, parts=split([run], (), ()), floors={})
    (step,) = (r for r in regimes.regressors(study) if r.kind == "step")
    assert step.label == f"change of force in {0.2 * pace:.3g} s"
