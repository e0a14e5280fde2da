"""A clock that differs by recording is found and taken out; one that all share stays a hypothesis."""

from dataclasses import replace

import pytest

from reconcile.judging import clocks
from reconcile.judging.answer import Answer
from reconcile.judging.clocks import Clock, differing, settled
from reconcile.judging.judge import Judge
from reconcile.recordings.data import Run, runs_of, split
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.workflow import examine
from records.measurement import Measurement
from tests.reconcile.truth import Truth, record

SECONDS = 12.0


def late(measured: Measurement, offset_s: float) -> Measurement:
    """A recording whose outputs' clock is late against the input's."""
    channels = {
        n: c if n == "force" else replace(c, time=c.time + offset_s) for n, c in measured.channels.items()
    }
    return replace(measured, channels=channels)


def runs(rig, *offsets: float) -> list[Run]:
    """One run for each offset."""
    found = []
    for k, offset in enumerate(offsets):
        found += runs_of(late(record(Truth(), SECONDS, seed=k), offset), rig, f"run{k}")
    return found


def clocks_of(rig, *offsets: float) -> dict[str, Clock]:
    none: list[Run] = []
    given = (runs(rig, *offsets), none, none)
    core = Core(rig, split(*given), ())
    beam = Beam(core)
    beam.run()
    answer = Answer(core, beam, Judge(beam).decide())
    found = differing(core, answer)
    return settled(given, found, lambda sets: Core(rig, split(*sets), ()), answer.point) if found else found


def test_an_offset_of_one_run_is_found_to_a_fraction_of_a_sample(rig):
    found = clocks_of(rig, 0.0, 0.05, 0.0)
    assert found["run1"].offset_s == pytest.approx(0.05, abs=0.003)
    assert abs(found["run0"].offset_s) < 0.003
    assert abs(found["run2"].offset_s) < 0.003


@pytest.mark.parametrize("offset", [0.0, 0.04])
def test_what_all_runs_share_is_no_nuisance(rig, offset):
    assert clocks_of(rig, offset, offset) == {}


def test_a_shift_that_leaves_the_error_ahead_is_no_clock(rig, monkeypatch):
    """As of a model that is wrong in another way: each recording is followed better with some offset."""
    monkeypatch.setattr(clocks, "_told", lambda *_: {"run0": Clock(), "run1": Clock(0.05)})
    assert clocks_of(rig, 0.0, 0.0) == {}


def test_stretches_of_one_recording_share_its_clock(rig):
    first, second = runs(rig, 0.0, 0.05)
    assert first.recording != second.recording
    parted = [first, replace(second, name="run0.1", of=first.recording)]
    core = Core(rig, split(parted, [], []), ())
    beam = Beam(core)
    beam.run()
    assert differing(core, Answer(core, beam, Judge(beam).decide())) == {}


@pytest.mark.slow
@pytest.mark.long
def test_a_clock_is_taken_out_and_said(rig):
    figures = examine(rig, runs(rig, 0.0, 0.06, 0.0))[0]
    assert figures["effects"] == []
    assert figures["nuisances"]["run1"]["time_offset_s"] == pytest.approx(0.06, abs=0.003)
    assert "matter of their clocks" in figures["sentence"]
