"""Simulated outputs are read at the sample times of a recording, late by delays and by drifting clocks."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator

from reconcile.data import runs_of, split
from reconcile.fit.point import Point
from reconcile.fit.problem import Problem
from reconcile.model import Folder
from reconcile.study import Study
from tests.reconcile.truth import Truth, record

DELAY, DRIFT = 0.0137, 2e-4  # s, s per s


@pytest.fixture(scope="module")
def study(rig: Folder) -> Study:
    return Study(rig, split(runs_of(record(Truth(), seconds=12.0), rig, "run"), (), ()))


@pytest.fixture
def late(study: Study) -> tuple[Problem, Point, list[int]]:
    """A problem, a point with late outputs, and the parameters that make them late."""
    problem = study.problems["fit"]
    effects = [a for a in study.candidates if a.effect.delays and a.effect.place == "output"]
    names = [a.free[0] for a in effects]
    drifts = {a.free[0] for a in effects if a.effect.clock}
    assert drifts
    assert len(names) > len(drifts)
    point = problem.start(study.values)
    p = point.p.copy()
    for n in names:
        p[problem.parameter(n)] = DRIFT if n in drifts else DELAY
    return problem, replace(point, p=p), [problem.parameter(n) for n in names]


def test_outputs_are_read_where_delays_and_drifts_put_them(late: tuple[Problem, Point, list[int]]):
    problem, point, _ = late
    window, run = problem.windows[0], problem.simulate(point, 0)
    assert run is not None
    errors = problem.compare(point, 0, run)[0]
    for name in problem.outputs:
        fixed, drift = problem.late.of_output(name, point.p)
        times = window.times[name]
        at = (times - fixed - drift * (times - window.run.start_s) - window.start_s) / window.step_s
        y = run[1][:, problem.model.index("outputs", name)]
        for i in (0, len(at) // 2, len(at) - 1):
            held = np.round((window.run.inputs["force"].time - window.start_s) / window.step_s).astype(int)
            near = held[np.searchsorted(held, at[i]) - 1] + np.arange(3)  # the input is held over two steps
            read = float(BarycentricInterpolator(near, y[near])(at[i]))
            expected = (window.samples[name][i] - read) / problem.sigma[name]
            assert errors[name][i] == pytest.approx(expected, abs=1e-6 * abs(read) / problem.sigma[name])


def test_slopes_by_delays_and_drifts_are_those_of_the_errors(late: tuple[Problem, Point, list[int]]):
    problem, point, columns = late
    run = problem.simulate(point, 0, columns)
    assert run is not None
    _, errors, slopes = problem.compare(point, 0, run, columns)
    for c, parameter in enumerate(columns):
        p = point.p.copy()
        p[parameter] += 1e-6
        moved = replace(point, p=p)
        again = problem.simulate(moved, 0, columns)
        assert again is not None
        rate = (problem.compare(moved, 0, again)[1] - errors) / 1e-6
        slope = slopes[:, slopes.shape[1] - len(columns) + c]
        assert np.abs(-slope - rate).max() < 1e-3 * np.abs(rate).max()


def test_parameters_that_windows_share_cannot_be_changed_unseen(late: tuple[Problem, Point, list[int]]):
    problem, point, columns = late
    problem.simulate(point, 0)
    with pytest.raises(ValueError, match="read-only"):
        point.p[columns[0]] = 0.0
