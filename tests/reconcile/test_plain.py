"""The plain ways: they find what they can find, and say which way was asked for wrongly."""

import pytest

from reconcile.catalogue import ALL
from reconcile.plain import __main__ as plain, greedy, sindy
from reconcile.recordings.data import runs_of, split
from specs.errors import InputError
from tests.reconcile.conftest import RIG
from tests.reconcile.truth import Truth, coulomb, record


def parts(rig, truth: Truth, **options):
    return split(runs_of(record(truth, **options), rig, "run"), (), ())


@pytest.fixture(scope="module")
def rubbing(rig):
    """Recordings of a carriage with strong dry friction, hardly noisy."""
    return parts(rig, Truth(**coulomb(2.0)), seconds=20.0, noise=(2e-5, 2e-4))


def test_sindy_names_dry_friction_and_nothing_where_nothing_is_missing(rig, rubbing):
    assert "coulomb_friction" in sindy.name(rig, rubbing)
    assert sindy.name(rig, parts(rig, Truth(), seconds=20.0, noise=(2e-5, 2e-4))) == []


def test_greedy_takes_dry_friction_where_it_is_the_best_of_a_few(rig, rubbing):
    few = ("coulomb_friction", "constant_load", "input_offset", "sensor_bias")
    catalogue = [e for e in ALL if e.name in few]
    assert greedy.name(rig, rubbing, catalogue)[0] == "coulomb_friction"


def test_a_way_that_there_is_not_is_named(tmp_path):
    with pytest.raises(InputError, match="no method 'sindi'; did you mean sindy"):
        plain.main(["sindi", str(RIG), str(tmp_path), "run.parquet"])
    with pytest.raises(InputError, match="usage"):
        plain.main(["sindy"])
