"""A clock that differs by recording is found and taken out; one that all share stays a hypothesis."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from reconcile import nuisance
from reconcile.catalogue import ALL
from reconcile.data import Run, runs_of, split
from reconcile.fit.solve import fit
from reconcile.nuisance import Clock, corrected, differing, settled
from reconcile.search import Answer, Tried
from reconcile.study import Study
from reconcile.workflow import examine
from records.measurement import Measurement
from tests.reconcile.truth import Truth, coulomb, record

SECONDS = 12.0


def late(measured: Measurement, offset_s: float = 0.0, drift: float = 0.0) -> Measurement:
    """A recording whose outputs' clock is late, and runs late, against the input's."""
    channels = {
        n: c if n == "force" else replace(c, time=c.time * (1.0 + drift) + offset_s)
        for n, c in measured.channels.items()
    }
    return replace(measured, channels=channels)


def runs(rig, *clocks: tuple[float, float], truth: Truth | None = None) -> list[Run]:
    """One run for each (offset, drift)."""
    found = []
    for k, (offset, drift) in enumerate(clocks):
        measured = late(record(truth or Truth(), SECONDS, seed=k), offset, drift)
        found += runs_of(measured, rig, f"run{k}")
    return found


def answered(study: Study) -> Answer:
    """The base model fitted, as a search answers that finds nothing."""
    base = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert base is not None
    return Answer((), base, base, (), {}, Tried())


def clocks_of(rig, *clocks: tuple[float, float]) -> dict[str, Clock]:
    given = (runs(rig, *clocks), [], [])
    study = Study(rig, split(*given))
    answer = answered(study)
    found = differing(study, answer)
    return settled(given, found, study, answer) if found else found


def test_an_offset_of_one_run_is_found_to_a_fraction_of_a_sample(rig):
    found = clocks_of(rig, (0.0, 0.0), (0.05, 0.0), (0.0, 0.0))
    assert found["run1"].offset_s == pytest.approx(0.05, abs=0.001)
    assert abs(found["run0"].offset_s) < 0.001
    assert abs(found["run2"].offset_s) < 0.001


@pytest.mark.parametrize("offset", [0.0, 0.04])
def test_what_all_runs_share_is_no_nuisance(rig, offset):
    assert clocks_of(rig, (offset, 0.0), (offset, 0.0)) == {}


def test_a_drift_of_one_run_is_found(rig):
    found = clocks_of(rig, (0.0, 0.0), (0.0, 0.004))
    assert found["run1"].offset_s + found["run1"].drift * SECONDS / 2 == pytest.approx(0.024, abs=0.004)


def test_setting_a_run_right_moves_its_outputs_alone(rig):
    [run] = runs(rig, (0.05, 0.0))
    [right] = corrected([run], {run.name: Clock(0.05)})
    assert np.allclose(right.outputs["position"].time, run.outputs["position"].time - 0.05)
    assert right.inputs is run.inputs
    assert right.start_s >= run.start_s
    assert right.end_s <= run.end_s


@pytest.mark.long
def test_friction_is_named_beside_a_clock_that_is_late_in_one_recording(rig):
    given = runs(rig, (0.0, 0.0), (0.05, 0.0), truth=Truth(**coulomb(1.0)))
    figures = examine(rig, given)[0]
    assert [e["name"] for e in figures["effects"]] == ["coulomb_friction"]
    assert figures["nuisances"]["run1"]["time_offset_s"] == pytest.approx(0.05, abs=0.002)
    assert "late against" in figures["sentence"]


def test_a_model_that_gets_nowhere_tells_no_clocks(monkeypatch):
    monkeypatch.setattr(nuisance, "column", lambda *_: 0)
    study = SimpleNamespace(elsewhere=lambda *_: None, extended=SimpleNamespace(index={}))
    study.problems = {"short": None, "holdout": None}
    assert nuisance._rows(study, SimpleNamespace(free=())) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("together", "left", "explained"),
    [(1900.0, 1200.0, True), (9000.0, 4000.0, True), (2200.0, 1800.0, False)],
    ids=["about the noise", "half of what stood above it", "neither"],
)
def test_clocks_explain_what_is_left_or_tell_nothing(monkeypatch, together, left, explained):
    n = 1000
    rows = SimpleNamespace(errors=np.zeros(n), late=np.zeros((n, 2)), run=np.zeros(n), runs=["a", "b"])
    monkeypatch.setattr(nuisance, "_solved", lambda rows, late: (together if late.shape[1] == 1 else left,))
    assert nuisance._explains(rows, 1) is explained  # type: ignore[arg-type]


@pytest.mark.parametrize("drift", [0.01, -0.01])  # late by 0.12 s at the end, and early
def test_a_clock_that_drifts_is_told_either_way(rig, drift):
    catalogue = [e for e in ALL if e.clock]
    study = Study(rig, split(runs(rig, (0.0, drift)), (), ()), catalogue)
    [clock] = study.candidates
    base = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert base is not None
    found = study.fit_set(base.point, (clock,), {})
    assert found is not None
    assert found.values(study.fit_problem)[clock.name("drift")] == pytest.approx(
        drift / (1.0 + drift), abs=5e-5
    )
    assert found.cost < 1.3 * sum(len(e) for raw in found.linear.raw for e in raw.values()) < 0.01 * base.cost


@pytest.mark.parametrize("drift", [-0.001, -0.009])  # early by one sample at the end, and by several
def test_no_sample_is_spared_a_clock_that_runs_fast(rig, drift):
    study = Study(rig, split(runs(rig, (0.0, 0.0)), (), ()), [e for e in ALL if e.clock])
    [clock] = study.candidates
    problem = study.fit_problem
    point = problem.start(study.values | {clock.name("drift"): drift})
    found = fit(problem, problem.with_present(point, (clock,)), [], iterations=0)
    assert found is not None
    assert all(np.all(errors != 0.0) for window in found.linear.raw for errors in window.values())
