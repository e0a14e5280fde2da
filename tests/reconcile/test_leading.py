"""Inputs that act earlier than they are recorded, and outputs that are recorded early."""

import numpy as np
import pytest

from reconcile import workflow
from reconcile.catalogue import ALL
from reconcile.judging.inputs import set_right
from reconcile.recordings.data import runs_of, split
from reconcile.search import lead
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from tests.reconcile.truth import DT, PERIOD, Truth, coulomb, excitation, record_driven

SECONDS = 20.0
PER = round(PERIOD / DT)
NAMES = ("structural_compliance", "coulomb_friction", "sensor_delay", "input_delay")


def curve(step: float) -> np.ndarray:
    """A force that varies all the time, at even steps (s)."""
    t = step * np.arange(round(SECONDS / step))
    return 5.0 * np.sin(2.0 * np.pi * 0.31 * t) + 4.0 * np.sin(2.0 * np.pi * (0.1 + 0.03 * t) * t)


def kinked(_: np.ndarray) -> np.ndarray:
    """Straight lines between the samples of a held command, at DT."""
    return np.interp(DT * np.arange(round(SECONDS / DT)), PERIOD * np.arange(round(SECONDS / PERIOD)), STEPS)


def early(samples: float):
    """What is at DT, so many samples earlier."""
    return lambda signal: np.concatenate([signal[(n := round(samples * PER)) :], np.full(n, signal[-1])])


STEPS = excitation(SECONDS, 3)
HELD = dict(command=STEPS, truth={})
CURVE = dict(command=curve(PERIOD), truth={"inputs": lambda _: curve(DT)})
LINES = dict(command=STEPS, truth={"inputs": kinked})
LOGGED_LATE = dict(command=STEPS, truth={"inputs": early(1.0)})
POSITION = dict(command=STEPS, truth={"position": early(0.5)})
LATE = dict(
    command=STEPS, truth={"velocity": lambda v: np.concatenate([np.full(3 * PER, v[0]), v[: -3 * PER]])}
)


def told(rig, case, friction=0.8):
    """Runs of a carriage with dry friction, in a case."""
    truth = Truth(**case["truth"], **(coulomb(friction) if friction else {}))
    return runs_of(record_driven(truth, case["command"]), rig, "run")


@pytest.mark.parametrize(
    ("case", "leads"),
    [
        (HELD, {}),
        (LATE, {}),
        (CURVE, {"all outputs": 0.5 * PERIOD}),
        (LINES, {"all outputs": 0.5 * PERIOD}),
        (LOGGED_LATE, {"all outputs": PERIOD}),
        (POSITION, {"position": 0.5 * PERIOD}),
    ],
    ids=["held", "a late sensor", "a curve", "straight lines", "logged late", "a position that is early"],
)
def test_a_lead_is_found_where_there_is_one(rig, case, leads):
    runs = told(rig, case)
    catalogue = [e for e in ALL if e.name in NAMES]
    beam = Beam(Core(rig, split(runs, (), ()), [*catalogue, lead.effect(runs)]))
    beam.search()
    found = lead.found(beam)
    assert found == pytest.approx(leads, rel=0.1)


@pytest.mark.parametrize(
    ("case", "note"),
    [
        (CURVE, "inputs vary between"),
        (LOGGED_LATE, "inputs act 0.02 s earlier"),
        (POSITION, "position is recorded"),
    ],
    ids=["a curve", "logged late", "a position that is early"],
)
def test_recordings_are_set_right_and_fit_as_those_without_a_lead(rig, case, note):
    runs = told(rig, case, friction=0.0)
    leads = (
        {"position": 0.0101}
        if case is POSITION
        else {"all outputs": 0.0195 if case is LOGGED_LATE else 0.0098}
    )
    (right, _, _) = set_right(rig, [runs, [], []], leads)
    cores = [Core(rig, split(r, (), ()), (), 2e-5) for r in (runs, right, told(rig, HELD, friction=0.0))]
    before, after, held = (c.base.total for c in cores)
    assert after < held + 0.05 * (before - held)
    assert right[0].notes[-1].startswith(note)


@pytest.mark.parametrize("friction", [0.0, 0.8])
def test_a_force_that_varies_between_its_samples_is_no_effect(rig, friction):
    figures, _ = workflow.examine(rig, told(rig, CURVE, friction))
    assert [e["name"] for e in figures["effects"]] == ["coulomb_friction"] * (friction > 0.0)
    assert figures["nuisances"]["run"]["mended"] == ["inputs vary between their samples: they are not held"]
