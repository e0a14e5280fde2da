"""Better minima of a fit."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from reconcile import minima
from reconcile.data import runs_of, split
from reconcile.fit.solve import Fitted
from reconcile.model import Folder
from reconcile.study import Study
from tests.reconcile.truth import Truth, record


@pytest.fixture(scope="module")
def study(rig: Folder) -> Study:
    """A study of a rig that is as its model says."""
    return Study(rig, split(runs_of(record(Truth(), seconds=12.0), rig, "run"), (), ()))


@pytest.fixture(scope="module")
def found(study: Study) -> Fitted:
    fitted = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert fitted is not None
    return fitted


def away(study: Study, fitted: Fitted, spreads: float, cost: float) -> Fitted:
    """A fit that stuck with its first base parameter so far from where it began."""
    p, first = fitted.point.p.copy(), fitted.free[0]
    assert first.prior is not None
    p[study.fit_problem.parameter(first.name)] = first.prior[0] + spreads * first.prior[1]
    return replace(fitted, point=replace(fitted.point, p=p), cost=cost)


def test_a_fit_that_went_far_is_left_for_a_better_one_from_where_it_began(study, found):
    stuck = away(study, found, 1.5, 3.0 * found.cost)
    better = minima.afresh(study, stuck)
    assert better.cost == pytest.approx(found.cost, rel=1e-2)
    assert better.values(study.fit_problem) == pytest.approx(found.values(study.fit_problem), rel=0.02)


def test_a_fit_that_went_far_stays_where_nothing_is_better(study, found):
    right = away(study, found, 1.5, 0.1 * found.cost)
    assert minima.afresh(study, right) is right


def test_a_fit_that_stayed_near_is_not_done_again(study, found):
    near = away(study, found, 0.4, 3.0 * found.cost)
    assert minima.afresh(study, near) is near


def test_an_answer_is_fitted_from_both_ends_however_near_it_stayed(study, found):
    near = away(study, found, 0.4, 3.0 * found.cost)
    assert minima.afresh(study, near, far=0.0).cost == pytest.approx(found.cost, rel=1e-2)


def test_a_stop_that_a_fit_again_gets_stuck_at_is_found_from_wide_kinks(rig: Folder, monkeypatch):
    def stops(x: float, v: float, t: float) -> float:
        beyond = max(abs(x) - 0.6, 0.0)
        return -3.0 * x - (np.sign(x) * 400.0 * beyond + 3.0 * v if beyond else 0.0)

    recorded = runs_of(record(Truth(force=stops), seconds=20.0, seed=2), rig, "run")
    study = Study(rig, split(recorded, (), ()))
    present = tuple(a for a in study.candidates if a.key in ("end_stop@v", "stiffness@v"))
    starts = {
        "end_stop@v.position": 0.6,
        "end_stop@v.k": 400.0,
        "end_stop@v.relaxation": 0.01,
        "stiffness@v.k": 3.0,
    }
    right = study.fit_set(study.fit_problem.start(study.values), present, starts, near=True)
    assert right is not None
    right = study.refitted(right)
    p = right.point.p.copy()
    p[study.fit_problem.parameter("end_stop@v.position")] *= 0.955
    p[study.fit_problem.parameter("end_stop@v.k")] *= 0.3
    off = replace(right, point=replace(right.point, p=p))
    fit_set = study.fit_set
    near = fit_set(off.point, present, {}, near=True)
    assert near is None or near.cost > 2.0 * right.cost
    monkeypatch.setattr(study, "fit_set", lambda *a, near, **kw: None if near else fit_set(*a, **kw))
    assert study.refitted(off).cost == pytest.approx(right.cost, rel=1e-3)


def test_a_ripple_that_stood_for_a_spring_is_looked_for_again_once_the_spring_is_known(rig: Folder):
    rippled = Truth(force=lambda x, v, t: 0.3 * np.sin(9.0 * x) - 6.0 * x)
    study = Study(rig, split(runs_of(record(rippled, seconds=20.0), rig, "run"), (), ()))
    keys = "stiffness@v", "torque_ripple@v"
    spring, ripple = (next(a for a in study.candidates if a.key == k) for k in keys)
    start = study.fit_problem.start(study.values)
    stuck = study.fit_set(start, (spring, ripple), {ripple.name("waves"): 2.4, ripple.name("sine"): -1.0})
    known = cast(Any, {frozenset([spring]): study.fit_set(start, (spring,), {})})
    assert stuck is not None
    assert stuck.values(study.fit_problem)[ripple.name("waves")] < 3.0
    better = minima.reshaped(study, stuck, known)
    assert better.values(study.fit_problem)[ripple.name("waves")] == pytest.approx(9.0, rel=0.01)
    assert better.cost < 0.01 * stuck.cost
    assert minima.reshaped(study, better, known) is better  # nothing lies nearer than where it is
