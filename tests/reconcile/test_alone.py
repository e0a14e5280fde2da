"""A model by itself: fitted by its output error; what it is a hint of where nothing is named."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reconcile.errors.ahead import ahead
from reconcile.filter.kalman import NOISE, SIGMA
from reconcile.judging import hints
from reconcile.judging.answer import Answer
from reconcile.search import alone as by_itself
from reconcile.search.alone import alone, fits, lasting
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from tests.reconcile.answers import cored, judged, recorded
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


def test_where_nothing_is_named_the_effect_that_helps_most_is_a_hint(rubbed: Core):
    beam = Beam(rubbed)
    beam.points[frozenset()] = rubbed.base
    answer = Answer(rubbed, beam, judged(beam, frozenset()))
    said = hints.by_output_error(answer)
    assert said.startswith("A hint: by itself, without any disturbance, the model errs by ")
    assert said.endswith(" with coulomb_friction (v).")


def test_there_is_no_hint_where_something_is_named_or_nothing_left(rubbed: Core, monkeypatch):
    beam: Any = SimpleNamespace(points={})
    named: Any = SimpleNamespace(core=rubbed, present=("an effect",), point=rubbed.base, beam=beam)
    assert hints.by_output_error(named) == ""
    named.present = ()
    monkeypatch.setattr(hints, "beyond_noise", lambda core, point: 1.0)
    assert hints.by_output_error(named) == ""
    monkeypatch.setattr(hints, "beyond_noise", lambda core, point: 9.0)
    monkeypatch.setattr(hints, "fit", lambda *a: by_itself.alone(rubbed)[0])  # none helps
    named.beam = Beam(rubbed)
    assert hints.by_output_error(named) == ""
