"""Where no set explains recordings together, one alone tells how late the clocks of the others are."""

from dataclasses import replace

import pytest

from reconcile import apart
from reconcile.data import split
from reconcile.model import Folder
from reconcile.search import Answer
from reconcile.study import Study
from tests.reconcile.test_nuisance import answered, runs


def true_of(study: Study) -> Answer:
    """An answer of the rig's true parameters, nothing fitted but initial states."""
    answer = answered(study)
    carried = study.carried(replace(answer.fitted, free=()), {"mass": 2.0, "drag": 1.5})
    assert carried is not None
    return replace(answer, fitted=carried)


@pytest.mark.parametrize("offset", [0.3, -0.12])
def test_shifts_of_many_samples_are_found(rig: Folder, offset: float):
    study = Study(rig, split(runs(rig, (0.0, 0.0), (offset, 0.0), (0.02, 0.0)), (), ()))
    clocks = apart._shifted(study, true_of(study))
    assert {n: c.offset_s for n, c in clocks.items()} == pytest.approx(
        {"run0": 0.0, "run1": offset, "run2": 0.02}, abs=0.011
    )


def test_what_all_recordings_share_is_no_shift(rig: Folder):
    study = Study(rig, split(runs(rig, (0.1, 0.0), (0.1, 0.0)), (), ()))
    assert apart._shifted(study, true_of(study)) == {}


def test_recordings_are_looked_at_apart_only_where_together_they_are_not_explained(rig: Folder, monkeypatch):
    given = (runs(rig, (0.0, 0.0), (0.0, 0.0)), (), ())
    study = Study(rig, split(*given))
    looked: list[str] = []
    monkeypatch.setattr(apart, "_alone", lambda folder, run, *_: looked.append(run.name))
    assert apart.differing(rig, given, study, answered(study), lambda *_: None)[0] == {}
    assert looked == []
    monkeypatch.setattr(apart.evidence, "lost", lambda _: True)
    assert apart.differing(rig, given, study, answered(study), lambda *_: None)[0] == {}
    assert looked == ["run0", "run1"]


def test_a_recording_too_short_to_be_examined_tells_nothing(rig: Folder):
    [run] = runs(rig, (0.0, 0.0))
    study = Study(rig, split([run], (), ()))
    short = replace(run, end_s=run.start_s + 0.2)
    assert apart._alone(rig, short, study, answered(study)) is None


def test_one_recording_has_one_clock(rig: Folder):
    [run] = runs(rig, (0.0, 0.0))
    halves = [replace(run, end_s=6.0), replace(run, start_s=7.0)]
    assert apart._longest(halves) == []
    other = replace(run, name="other", end_s=3.0)
    assert [r.end_s for r in apart._longest([*halves, other])] == [6.0, 3.0]
    assert apart._length(other) == pytest.approx(3.0)
