"""Slopes of candidates kept between looks, and steps of a fit that would lead a window astray."""

from dataclasses import replace

import numpy as np
import pytest

from reconcile.data import runs_of, split
from reconcile.fit.point import Linear, joined
from reconcile.fit.solve import Fitted
from reconcile.fit.trial import tried
from reconcile.model import Folder
from reconcile.score import ROUGH
from reconcile.slopes import Slopes
from reconcile.study import Study
from tests.reconcile.truth import Truth, record


@pytest.fixture(scope="module")
def study(rig: Folder) -> Study:
    """A study of a rig with dry friction that its model lacks."""
    truth = Truth(static=(0.8, 0.8), kinetic=lambda v: 0.8 * np.sign(v))
    return Study(rig, split(runs_of(record(truth, seconds=8.0), rig, "run"), (), ()))


@pytest.fixture(scope="module")
def base(study: Study) -> Fitted:
    found = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert found is not None
    return found


def test_slopes_kept_from_another_look_are_those_of_a_look_afresh(study: Study, base: Fitted):
    study.fit_problem.patience = ROUGH  # steps so rough that slopes of two passes do not go together
    hidden = [a for a in study.candidates if a.effect.hidden]
    kept, fresh = Slopes(study), Slopes(study)
    first = kept.of(base, hidden, 0)
    np.testing.assert_array_equal(first, fresh.of(base, hidden, 0))
    few = hidden[1:3]
    ends = np.cumsum([0] + [len(a.columns) for a in hidden])
    np.testing.assert_array_equal(kept.of(base, few, 0), first[:, ends[1] : ends[3]])
    study.fit_problem.patience = 1.0


def test_slopes_of_another_fit_are_not_those_kept(study: Study, base: Fitted):
    kept, free = Slopes(study), study.free(())
    plain = [a for a in study.candidates if not a.effect.hidden][:3]
    first = kept.of(base, plain, 0)
    p = base.point.p.copy()
    p[study.extended.index[free[0].name]] += 0.5 * free[0].size
    assert np.abs(kept.of(replace(base, point=replace(base.point, p=p)), plain, 0) - first).max() > 0.0


def far(linear: Linear) -> Linear:
    """The same, but that the first window's initial state is asked to go where the model runs away."""
    first = linear.pieces[0]
    step = (np.full_like(first.step[0], 1e308), first.step[1])
    return joined([replace(first, step=step), *linear.pieces[1:]])


def stepped(study: Study, base: Fitted, linear: Linear):
    """A step that leaves the parameters as they are."""
    columns = [study.fit_problem.parameter(f.name) for f in base.free]
    return tried(study.fit_problem, base.point, linear, base.point.p, 1.0, columns)


def test_a_window_led_astray_is_moved_by_the_parameters_alone(study: Study, base: Fitted):
    linear = far(base.linear)
    point, found = stepped(study, base, linear)
    assert found is not None
    np.testing.assert_array_equal(point.x0[0], base.point.x0[0])  # parameters stayed, and so does the state
    assert found.cost < 2.0 * base.linear.cost


def test_a_step_that_is_good_as_a_whole_is_taken_whole(study: Study, base: Fitted):
    worse = joined([replace(p, errors=2.0 * p.errors) for p in base.linear.pieces])
    point, _ = stepped(study, base, worse)
    step = base.linear.pieces[0].step[0]
    np.testing.assert_allclose(point.x0[0, : len(step)], base.point.x0[0, : len(step)] + step)
