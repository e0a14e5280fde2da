"""Windows of recordings: the clock that drifting effects see, and what a delay makes of held inputs."""

from dataclasses import replace

import numpy as np
import pytest

from reconcile.data import Block, Run, Signal, runs_of
from reconcile.fit.windows import WINDOW_S, Held, InputTable, cut
from records.measurement import Channel, Measurement
from tests.reconcile.truth import Truth, record


def clock(run: Run) -> np.ndarray:
    """Time of each step that effects which change with it are given, over all windows of a run."""
    table = InputTable(run, ["force"], np.zeros(1))
    windows = cut([Block(run, run.start_s, run.end_s)], WINDOW_S, None)
    return np.concatenate([table.rows(w, {})[0][:, -1] for w in windows])


def test_a_drift_counts_from_where_the_recording_begins(rig):
    measured = record(Truth(), seconds=8.0)
    late = {n: replace(c, time=c.time + 4321.0) for n, c in measured.channels.items()}
    (here,), (later,) = (runs_of(m, rig, "run") for m in (measured, replace(measured, channels=late)))
    assert clock(later) == pytest.approx(clock(here), abs=1e-9)
    assert clock(here)[0] == pytest.approx(
        0.5 * cut([Block(here, 0.0, here.end_s)], WINDOW_S, None)[0].step_s
    )


def test_a_drift_goes_on_through_a_gap(rig):
    measured = record(Truth(), seconds=8.0)

    def without(c: Channel) -> Channel:
        kept = (c.time < 3.0) | (c.time > 5.0)
        return replace(c, time=c.time[kept], values=c.values[kept])

    holed = Measurement({n: without(c) for n, c in measured.channels.items()}, source="rig")
    first, second = runs_of(holed, rig, "run")
    assert first.began_s == second.began_s
    assert clock(second)[0] > 4.9


def test_a_change_on_an_edge_is_moved_into_the_step_after_it():
    held = Signal(np.arange(6) * 0.02, np.array([0.0, 0.0, 1.0, 1.0, -2.0, -2.0]))
    mean, slope = Held(held).delayed(0.0, 0.01, 10, 0.0)
    later = Held(held).delayed(0.0, 0.01, 10, 1e-5)[0]
    assert slope == pytest.approx((later - mean) / 1e-5, abs=1e-6)
    assert slope[4] == pytest.approx(-100.0)
