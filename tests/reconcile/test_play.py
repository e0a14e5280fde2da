"""Plays, rate limits and gears: what they show is theirs, not that of their rounding."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from reconcile import starting
from reconcile.catalogue import memory
from reconcile.data import runs_of, split
from reconcile.model import Folder
from reconcile.study import WITHIN, Study
from tests.reconcile.truth import Truth, record

GAP, WIDTH, STEP = 0.3, 2e-3, 1e-5  # rad, s, s


def shown(target: np.ndarray, effect) -> np.ndarray:
    """What a continuous memory shows of a target [n] sampled at STEP, by small Euler steps."""
    y, w = ca.SX.sym("y"), ca.SX.sym("w")  # type: ignore[call-arg]
    result = effect(SimpleNamespace(step=None, width=WIDTH), y, w)
    both = ca.Function("both", [y, w], [result.value, result.rates["w"]])
    state, found = float(target[0]), []
    for value in target:
        out, rate = (float(v) for v in both(value, state))
        found.append(out)
        state += STEP * rate
    return np.array(found)


def test_play_in_motion_is_half_its_gap_behind_however_fast():
    time = np.arange(0.0, 0.4, STEP)
    target = 5.0 * time  # rad/s: 10 mrad within WIDTH
    found = shown(target, lambda c, y, w: memory.play(c, y, "w", w, GAP))
    moving = time > 0.2
    assert np.allclose(found[moving], target[moving] - 0.5 * GAP, atol=1e-6)


def test_play_turned_round_stays_where_it_was_until_the_gap_is_taken_up():
    time = np.arange(0.0, 0.5, STEP)
    target = np.interp(time, [0.0, 0.2, 0.5], [0.0, 1.0, 0.8])
    found = shown(target, lambda c, y, w: memory.play(c, y, "w", w, GAP))
    assert found[-1] == pytest.approx(1.0 - 0.5 * GAP, abs=2.0 * WIDTH)


def test_a_rate_within_its_limit_is_not_late():
    time = np.arange(0.0, 0.2, STEP)
    target = 0.8 * time
    found = shown(target, lambda c, y, w: memory.rate_limit(c, y, "w", w, 1.0))
    assert np.allclose(found, target, atol=1e-6)
    slow = shown(target, lambda c, y, w: memory.rate_limit(c, y, "w", w, 0.5))
    assert slow[-1] == pytest.approx(0.5 * time[-1], abs=2.0 * WIDTH)


@pytest.fixture(scope="module")
def study(rig: Folder) -> Study:
    """Of the rig, which is continuous and has a driven axis."""
    return Study(rig, split(runs_of(record(Truth(), seconds=12.0), rig, "run"), (), ()))


def test_initial_states_in_play_are_free_within_it(study: Study):
    play = next(a for a in study.candidates if a.effect.name == "sensor_backlash")
    problem = study.fit_problem
    state = np.array([study.extended.state_names.index(play.name("shown"))])
    p = problem.start(study.values).p
    for gap in (1e-4, 1e-3):
        p[study.extended.index[play.name("gap")]] = gap
        assert problem.freedom(state, p) == pytest.approx(gap / np.sqrt(12.0), rel=0.01)


def test_a_gear_is_rounded_by_its_own_gap_and_its_ends_are_as_exact_as_the_axis(study: Study):
    gear = next(a for a in study.candidates if a.effect.name == "gear_backlash")
    assert study.values[gear.name("width")] == WITHIN  # however far the axis travels
    states, problem = study.extended.state_names, study.fit_problem
    position = next(x.position for x in study.folder.ports.axes if x.name == gear.port)
    assert position is not None
    twist = states.index(gear.name("twist"))
    assert problem.tolerance[twist] <= problem.tolerance[states.index(position)]


def test_a_gear_is_never_rounded_over_more_than_its_gap(study: Study):
    gear = next(a for a in study.candidates if a.effect.name == "gear_backlash")
    point = study.fit_problem.with_present(study.fit_problem.start(study.values), (gear,))
    for coarse in (True, False):
        for share in starting.widths(study, point, coarse, near=False):
            assert starting.rounded(study, point, share).p[study.extended.index[gear.name("width")]] < 1.0
