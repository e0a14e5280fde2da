"""A model by itself: fitted by its output error."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reconcile.errors.ahead import ahead
from reconcile.filter.kalman import NOISE, SIGMA
from reconcile.search.alone import alone, fits, lasting
from reconcile.search.core import Core
from tests.reconcile.answers import cored, recorded
from tests.reconcile.truth import Truth

FRICTION = "coulomb_friction@v"


@pytest.fixture(scope="module")
def rubbed() -> Core:
    """The rig with dry friction of 1.2 N that its model has not."""
    truth = Truth(static=(1.2, 1.2), kinetic=lambda v: 1.2 * np.sign(v))
    return cored(recorded(truth, seconds=12.0), FRICTION, "stiffness@v", "constant_load@v")


def test_a_complete_model_has_its_parameters_by_its_output_error():
    core = cored(recorded(Truth(mass=2.3, drag=1.9), seconds=12.0))
    quiet, noisy = alone(core)
    assert alone(core)[0] is quiet
    for point in (quiet, noisy):
        assert point.values["mass"] == pytest.approx(2.3, rel=0.01)
        assert point.values["drag"] == pytest.approx(1.9, rel=0.02)
    assert quiet.values[SIGMA + "v"] < 1e-3 * core.force_size("v")
    assert noisy.values[SIGMA + "v"] == core.base.values[SIGMA + "v"]


def test_what_it_leaves_is_error_though_it_is_its_noise(rubbed: Core):
    quiet, _ = alone(rubbed)
    assert quiet.values[NOISE + "position"] > 5.0 * rubbed.base.values[NOISE + "position"]
    assert ahead(rubbed, quiet) > 0.02
    (friction,) = (a for a in rubbed.candidates if a.key == FRICTION)
    start = quiet.values | {friction.name("Fc"): 0.5, friction.name("gate"): 1.0}
    with_it = fits(rubbed, [start], (friction,))[0]
    assert with_it.values[friction.name("Fc")] == pytest.approx(1.2, rel=0.05)
    assert ahead(rubbed, with_it) < 0.3 * ahead(rubbed, quiet)


def test_a_model_that_runs_away_by_itself_has_no_such_fit(rubbed: Core, monkeypatch):
    monkeypatch.setattr(rubbed.fitter, "fit", lambda *a, **k: None)
    assert fits(rubbed, [rubbed.fresh]) == []


@pytest.mark.parametrize(("kept", "grown"), [(0.0, 1.0), (0.8, 3.0)])
def test_errors_grow_where_what_is_left_lasts(kept: float, grown: float):
    """Of a mean under noise that keeps the share a: sqrt((1 + a) / (1 − a))."""
    rng, e = np.random.default_rng(1), np.zeros((20000, 2))
    for k in range(1, len(e)):
        e[k] = kept * e[k - 1] + np.sqrt(1.0 - kept**2) * rng.standard_normal(2)
    e[::7, 1] = np.nan
    point: Any = SimpleNamespace(e=e.ravel(), s=np.ones(e.size))
    assert lasting(point, 2) == pytest.approx(grown, rel=0.05)
