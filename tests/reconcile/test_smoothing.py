"""Inputs are smoothed where their noise did not drive the machine, and only there."""

from dataclasses import replace

import numpy as np
import pytest

from reconcile import evidence
from reconcile.data import runs_of, split
from reconcile.fit.solve import Fitted
from reconcile.model import Folder
from reconcile.search import Search
from reconcile.study import Study
from records.measurement import Measurement
from tests.reconcile.truth import PERIOD, Truth, excitation, record_driven

SECONDS, NOISE = 20.0, 1.0  # N, of a sweep of 6 N


def sweep() -> np.ndarray:
    t = PERIOD * np.arange(round(SECONDS / PERIOD))
    return 6.0 * np.sin(2.0 * np.pi * (0.15 + 0.01 * t) * t)


def noise() -> np.ndarray:
    return NOISE * np.random.default_rng(7).standard_normal(len(sweep()))


def studied(rig: Folder, measured: Measurement) -> tuple[Study, Fitted]:
    """A study of a recording, and the base model fitted to it."""
    study = Study(rig, split(runs_of(measured, rig, "run"), (), ()))
    fitted = base(study)
    study.lengthen(fitted)
    fitted = base(study)
    study.estimate_noise(fitted)
    return study, fitted


def base(study: Study) -> Fitted:
    fitted = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert fitted is not None
    return fitted


def errors(study: Study, fitted: Fitted) -> np.ndarray:
    """What a fit leaves in the problem as it is now."""
    linear = study.fit_problem.linear(fitted.point, ())
    assert linear is not None
    return linear.errors


def noisy(measured: Measurement) -> Measurement:
    """The recording with noise on the force that the carriage did not feel."""
    force = measured.channels["force"]
    return replace(
        measured, channels={**measured.channels, "force": replace(force, values=force.values + noise())}
    )


def test_noise_that_the_machine_did_not_feel_is_smoothed_away(rig: Folder):
    study, fitted = studied(rig, noisy(record_driven(Truth(), sweep())))
    before = errors(study, fitted)
    study.smooth_inputs([fitted])
    assert set(study.fit_problem.widths) == {"force"}
    assert study.problems["confirm"].widths == study.fit_problem.widths
    after = errors(study, fitted)
    assert after @ after < before @ before - 10.0


@pytest.mark.parametrize(
    "command", [sweep() + noise(), excitation(SECONDS, 0)], ids=["a noisy command", "steps"]
)
def test_what_the_machine_felt_is_left_as_it_is(rig: Folder, command: np.ndarray):
    study, fitted = studied(rig, record_driven(Truth(), command))
    study.smooth_inputs([fitted])
    assert study.fit_problem.widths == {}


def test_trying_widths_leaves_the_problem_as_it_was(rig: Folder):
    study, fitted = studied(rig, record_driven(Truth(), sweep() + noise()))
    before = errors(study, fitted)
    study.smooth_inputs([fitted])
    assert np.array_equal(errors(study, fitted), before)


@pytest.mark.parametrize(("near", "smoothed"), [(True, {"force"}), (False, set())])
def test_a_search_smooths_only_where_about_the_noise_is_left(rig: Folder, monkeypatch, near, smoothed):
    recorded = noisy(record_driven(Truth(), sweep()))
    study = Study(rig, split(runs_of(recorded, rig, "run"), (), ()), catalogue=())
    monkeypatch.setattr(evidence, "near_floor", lambda fitted: near)
    Search(study).run()
    assert set(study.fit_problem.widths) == smoothed
