"""Effects that look alike from most starts of their shape: a fast wind is a load."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from reconcile.data import runs_of, split
from reconcile.model import Attached, Folder
from reconcile.rivals import Key, Rivals
from reconcile.score import Score, Scored, Variant
from reconcile.search import Search
from reconcile.study import Study
from tests.reconcile.truth import Truth, record

DRAG, WIND = 0.05, -1.0  # N.s2/m2, m/s: about half of the carriage's speed
FLOOR = 1.2 * 1200  # squared errors: what the noise leaves


@pytest.fixture(scope="module")
def search(rig: Folder) -> Search:
    """A carriage in the wind, examined over whole runs."""
    blown = Truth(force=lambda x, v, t: DRAG * (WIND - v) * abs(WIND - v))
    search = Search(Study(rig, split(runs_of(record(blown, seconds=20.0), rig, "run"), (), ())))
    search.begin()
    search.study.lengthen(search.tried.fits[Key()])
    search.begin()
    return search


def candidate(search: Search, name: str) -> Attached:
    return next(a for a in search.study.candidates if a.effect.name == name)


def test_a_wind_is_found_though_a_faster_one_gains_more_at_first(search):
    search._extended(Key(), pairs=False)
    assert search.tried.coarse[Key([candidate(search, "wind_load")])].cost < FLOOR


def test_a_load_is_held_against_winds_of_several_speeds(search, monkeypatch):
    load, wind = (candidate(search, n) for n in ("constant_load", "wind_load"))
    loaded = search.study.fit_set(search.tried.fits[Key()].point, (load,), {})
    assert loaded.cost > 10.0 * FLOOR
    monkeypatch.setattr(Rivals, "_turned", lambda *a: None)  # from what the load came to
    Rivals(search)._widened(loaded, load)
    assert search.tried.fits[Key([wind])].cost < FLOOR


@pytest.fixture(scope="module")
def sided(rig: Folder) -> Study:
    """A carriage with a drag, and friction that is greater forwards: much like a wind from before."""

    def force(x: float, v: float, t: float) -> float:
        return -0.4 * v * abs(v) - 0.6 * max(v, 0.0)

    return Study(rig, split(runs_of(record(Truth(force=force), seconds=20.0), rig, "run"), (), ()))


def scored(study: Study, *names: str) -> tuple[Scored, int]:
    """A set of effects at the base fit, each in its first shape, and how many parameters it counts."""
    base = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert base is not None
    score = Score(study, base, [a for a in study.candidates if a.effect.key in names])
    variants = [next(v for v in score.variants if v.attached.effect.key == n) for n in names]
    return score.scored(variants), score.parameters(variants)


def test_friction_of_two_sides_is_one_parameter_beside_the_models_own(sided: Study):
    assert scored(sided, "asymmetric_viscous_friction")[1] == 1
    assert scored(sided, "asymmetric_viscous_friction", "quadratic_drag")[1] == 2
    assert scored(sided, "coulomb_friction")[1] == 1


def test_amplitudes_of_a_set_are_those_that_were_put_in(sided: Study):
    both = scored(sided, "asymmetric_viscous_friction", "quadratic_drag")[0].values
    assert both["asymmetric_viscous_friction@v.b_positive"] == pytest.approx(0.6, rel=0.05)
    assert both["quadratic_drag@v.k"] == pytest.approx(0.4, rel=0.05)


def test_an_amplitude_of_the_wrong_sign_takes_no_other_with_it():
    """Of three columns two come out negative; without the first of them the second is positive."""
    slopes = np.array([[0.0, 0.0, 0.0], [2.0, -2.0, 0.0], [-2.0, 0.0, 2.0], [1.0, -1.0, 2.0]])
    score = Score.__new__(Score)
    score.gram, score.pull = slopes.T @ slopes, slopes.T @ np.array([1.0, 3.0, -3.0, 0.0])
    score.sizes = np.diag(score.gram)
    effect = SimpleNamespace(gated=True)
    attached = [SimpleNamespace(effect=effect, columns=(n,), free=(n,)) for n in "abc"]
    variants = [Variant(cast(Any, a), {}, (i,)) for i, a in enumerate(attached)]
    assert score.scored(variants[:2]).values == pytest.approx({"a": 1.5, "b": 0.3})
    assert {n: v for n, v in score.scored(variants).values.items() if v} == pytest.approx(
        {"a": 1.5, "b": 0.3}
    )
