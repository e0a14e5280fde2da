"""Steps of a fit, initial states of windows, and the noise that a fit leaves."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.optimize import minimize

from reconcile import evidence
from reconcile.data import Run, Signal, runs_of, split
from reconcile.fit import whitening
from reconcile.fit.point import Look
from reconcile.fit.solve import Fitted, Free, _covariance, _within, fit
from reconcile.model import Folder, read_folder
from reconcile.study import Study
from tests.reconcile.truth import Truth, coulomb, record


@pytest.fixture(scope="module")
def study(rig: Folder) -> Study:
    """A study of a rig that is as its model says."""
    return Study(rig, split(runs_of(record(Truth(), seconds=12.0), rig, "run"), (), ()))


@pytest.fixture(scope="module")
def base(study: Study) -> Fitted:
    found = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(8))
def test_a_step_within_bounds_is_the_best_one_though_parameters_make_up_for_each_other(seed):
    rng = np.random.default_rng(seed)
    slopes = rng.standard_normal((30, 3)) @ rng.standard_normal((3, 4)) + 0.02 * rng.standard_normal((30, 4))
    hessian, gradient = slopes.T @ slopes, slopes.T @ rng.standard_normal(30)
    low, high = -rng.uniform(0.0, 0.5, 4), rng.uniform(0.0, 0.5, 4)

    def left(x: np.ndarray) -> float:
        return float(x @ hessian @ x - 2.0 * gradient @ x)

    step = _within(hessian, gradient, 0.0, low, high)
    best = minimize(left, np.zeros(4), bounds=list(zip(low, high, strict=True)), tol=1e-12)
    assert np.all((low <= step) & (step <= high))
    assert left(step) <= best.fun + 1e-4 * abs(best.fun)


def test_a_parameter_that_does_not_show_or_may_not_move_stays():
    hessian = np.diag([1e20, 0.0, 1e-20])
    low, high = np.array([-np.inf, -1.0, 0.0]), np.array([np.inf, 1.0, 0.0])
    step = _within(hessian, np.array([1e12, 0.0, 1e-15]), 0.0, low, high)
    assert step == pytest.approx([1e-8, 0.0, 0.0], rel=1e-6, abs=1e-12)


def test_of_two_parameters_of_which_only_the_sum_shows_neither_is_known():
    shown, alone = np.linspace(1.0, 2.0, 20), np.linspace(-1.0, 1.0, 20) ** 2
    slopes = np.column_stack([shown, shown, alone, np.zeros(20)])
    found = _covariance(
        cast(Any, SimpleNamespace(slopes=slopes)), [Free(n, -np.inf, np.inf, 1.0) for n in "abcd"]
    )
    assert np.all(np.sqrt(np.diag(found))[[0, 1, 3]] > 1e4)
    assert found[0, 0] + 2.0 * found[0, 1] + found[1, 1] == pytest.approx(
        _covariance(cast(Any, SimpleNamespace(slopes=slopes[:, [0, 2]])), [Free("s", 0.0, 1.0, 1.0)] * 2)[
            0, 0
        ],
        rel=1e-3,
    )


def test_a_state_that_shows_moves_on_where_one_that_hardly_shows_is_held():
    slope = np.column_stack([np.ones(50), 1e-3 * np.linspace(-1.0, 1.0, 50)])
    look = Look(2.0 + 0.1 * np.linspace(-1.0, 1.0, 50), slope, np.array([1e-3, 1e-3]))
    free, held = look.step(0.0), look.step(1e3)
    assert free == pytest.approx([2.0, 100.0], rel=0.1)
    assert held[0] == pytest.approx(2.0, rel=0.05)
    assert abs(held[1]) < 1.0


def test_evidence_counts_errors_that_initial_states_do_not_explain(study: Study, base: Fitted):
    columns = [study.fit_problem.parameter(f.name) for f in base.free]
    x0 = base.point.x0.copy()
    x0[:, 0] += 5.0 * study.floors[next(iter(study.floors))].level
    moved = study.fit_problem.linear(replace(base.point, x0=x0), columns)
    assert moved is not None
    assert evidence.sample(replace(base, linear=moved)).share == pytest.approx(
        evidence.sample(base).share, rel=0.05
    )


def test_a_model_that_follows_whole_runs_with_its_strong_effects_has_a_noise_model(rig: Folder):
    study = Study(rig, split(runs_of(record(Truth(), seconds=12.0), rig, "run"), (), ()))
    base = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert base is not None
    study.lost = True  # as without them
    study.lengthen(base)
    assert not study.lost
    assert study.fit_problem is study.problems["fit"]


def test_windows_of_a_model_that_stays_lost_have_its_own_step():
    rng, time = np.random.default_rng(1), 0.02 * np.arange(600)
    rates = {n: Signal(time, 0.1 * rng.standard_normal(600)) for n in ("qd_boom_ref", "qd_stick_ref")}
    angles = {
        n: Signal(time, 1.0 + np.sin(3.0 * time)) for n in ("q_boom", "q_stick")
    }  # nothing of the arm's
    study = Study(read_folder("arm"), split([Run("run", 0.0, time[-1], rates, angles)], (), ()), catalogue=())
    base = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert base is not None
    study.lost = True
    study.lengthen(base)
    assert study.lost
    assert {w.step_s for p in study.problems.values() for w in p.windows} == {study.model.step}


def test_without_axes_and_noisy_inputs_errors_are_the_sensors_noise_alone():
    problem = cast(Any, disturbed(0.65))
    responses = whitening.estimate(problem, None, ()).responses
    alone = whitening.Noise((), tuple(replace(r, sources=(), by_source=()) for r in responses))
    none = replace(
        alone, responses=responses, sources=tuple(replace(s, size=0.0) for s in responses[0].sources)
    )
    assert alone.deviance() == pytest.approx(none.deviance())
    assert not alone.present


@pytest.mark.parametrize("time_s", [0.25, 0.65])
def test_the_noise_model_finds_size_and_time_of_a_random_force_together(time_s):
    noise = whitening.estimate(cast(Any, disturbed(time_s)), None, ())
    (source,) = noise.sources
    assert source.time_s == pytest.approx(time_s, rel=0.25)
    assert source.size == pytest.approx(5.0, rel=0.25)


def test_terms_that_take_the_place_of_a_random_force_gain_little_by_a_noise_of_their_own():
    problem = cast(Any, disturbed(0.65))
    noise = whitening.estimate(problem, None, ())
    # what four slow cosines of the force make, by run
    slow = [r.by_source[0][:, 1:5] for r in noise.responses]
    terms = [np.hstack([c if j == k else 0.0 * c for j, c in enumerate(slow)]) for k in range(len(slow))]
    beside = whitening.estimate(problem, None, (), terms)
    gained = noise.deviance() - beside.deviance()
    assert 0.0 < gained < 1.5 * terms[0].shape[1]  # by chance it is one for each


def disturbed(time_s: float, runs: int = 8, samples: int = 800, step_s: float = 0.02) -> SimpleNamespace:
    """A problem whose errors are white noise and a lagged random force, which nothing else explains."""
    rng = np.random.default_rng(3)
    lag = np.array([np.exp(-step_s * np.arange(samples) / 0.3)]) * step_s / 0.3
    response = np.array([np.convolve(row, lag[0])[:samples] for row in np.eye(samples)]).T
    windows, errors = [], []
    for _ in range(runs):
        force, keep = np.empty(samples), np.exp(-step_s / time_s)
        state = rng.standard_normal()
        for k in range(samples):
            state = keep * state + np.sqrt(1.0 - keep**2) * rng.standard_normal()
            force[k] = 5.0 * state
        errors.append(response @ force + rng.standard_normal(samples))
        times = {"y": step_s * np.arange(samples)}
        windows.append(SimpleNamespace(steps=samples, step_s=step_s, times=times, run=None))

    def responses(point, k, inputs, edges, columns, pushed_at=None):
        bins = np.add.reduceat(response, edges[:-1], axis=1)
        return errors[k], np.ones((samples, 1)), bins

    axes = [SimpleNamespace(name="axis")]
    folder = SimpleNamespace(ports=SimpleNamespace(axes=axes))
    extended = SimpleNamespace(folder=folder, clock=0)
    model = SimpleNamespace(inputs=[])
    return SimpleNamespace(windows=windows, extended=extended, model=model, responses=responses)


def test_a_stop_may_have_no_damping_but_stays_near_the_starts_of_its_stiffness(study: Study):
    stop = next(a for a in study.candidates if a.effect.name == "end_stop")
    least = {f.name: f.low for f in study.free((stop,))}
    assert least[stop.name("relaxation")] == 0.0
    assert least[stop.name("k")] > 0.0


def pushed_about(rig: Folder) -> tuple[Study, Fitted]:
    """A carriage with dry friction and a random force that nobody recorded, and the fit of the friction."""
    rng, force = np.random.default_rng(3), np.zeros(1501)
    for k in range(1500):
        force[k + 1] = 0.95 * force[k] + 0.01 * rng.standard_normal()
    truth = Truth(force=lambda x, v, t: float(force[round(t / 0.02)]), **coulomb(0.8))
    recorded = record(truth, seconds=30.0, size=6.0)
    study = Study(rig, split(runs_of(recorded, rig, "run"), (), ()))
    study.fit_problem = study.problems["fit"]
    (friction,) = (a for a in study.candidates if a.effect.name == "coulomb_friction")
    start = study.fit_problem.start(study.values)
    fitted = study.fit_set(start, (friction,), {friction.free[0]: 0.8})
    assert fitted is not None
    return study, fitted


def test_fits_that_hardly_differ_have_about_the_same_noise_model(rig: Folder):
    study, fitted = pushed_about(rig)
    at, deviances = fitted.point.p.copy(), []
    for share in (0.99, 0.995, 1.0, 1.005, 1.01):
        p = at.copy()
        p[study.extended.index["coulomb_friction@v.Fc"]] *= share
        there = fit(study.fit_problem, replace(fitted.point, p=p), fitted.free, iterations=0)
        assert there is not None
        deviances.append(study.deviance(there))
    assert np.ptp(deviances) < 250.0  # some thousands with kinks as sharp as they are fitted
