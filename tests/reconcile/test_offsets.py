"""Offsets in time that are a matter of the recording, and inputs that vary between their samples."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reconcile import workflow
from reconcile.catalogue import ALL, offset
from reconcile.equations.model import ALL_OUTPUTS, Attached
from reconcile.filter.point import Point
from reconcile.judging import offsets
from reconcile.recordings.data import runs_of, split
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from tests.reconcile.truth import DT, PERIOD, Truth, coulomb, excitation, record_driven

SECONDS = 20.0
PER = round(PERIOD / DT)
NAMES = ("structural_compliance", "coulomb_friction", "sensor_delay", "input_delay")


def curve(step: float, after: float = 0.0) -> np.ndarray:
    """A force that varies all the time, at even steps (s) or a part of one after each of them."""
    t = step * (np.arange(round(SECONDS / step)) + after)
    return 5.0 * np.sin(2.0 * np.pi * 0.31 * t) + 4.0 * np.sin(2.0 * np.pi * (0.1 + 0.03 * t) * t)


def kinked(_: np.ndarray) -> np.ndarray:
    """Straight lines between the samples of a held command, at DT."""
    return np.interp(DT * np.arange(round(SECONDS / DT)), PERIOD * np.arange(round(SECONDS / PERIOD)), STEPS)


def early(samples: float):
    """What is at DT, so many samples earlier."""
    return lambda signal: np.concatenate([signal[(n := round(samples * PER)) :], np.full(n, signal[-1])])


def late(samples: float):
    """What is at DT, so many samples later."""
    n = round(samples * PER)
    return lambda signal: np.concatenate([np.full(n, signal[0]), signal[:-n]])


STEPS = excitation(SECONDS, 3)
HELD = {"command": STEPS, "truth": {}}
CURVE = {"command": curve(PERIOD), "truth": {"inputs": lambda _: curve(DT, 0.5)}}
LINES = {"command": STEPS, "truth": {"inputs": kinked}}
LOGGED_LATE = {"command": STEPS, "truth": {"inputs": early(1.0)}}
EARLY_PLACE = {"command": STEPS, "truth": {"position": early(0.5)}}
LATE = {"command": STEPS, "truth": {"velocity": late(3.0)}}
DIFFERENCES = {"command": STEPS, "truth": {"velocity": late(0.5)}}


def told(rig, case, friction=0.8):
    """Runs of a carriage with dry friction, in a case."""
    truth = Truth(**case["truth"], **(coulomb(friction) if friction else {}))
    return runs_of(record_driven(truth, case["command"]), rig, "run")


@pytest.mark.parametrize(
    ("case", "late"),
    [
        (HELD, {}),
        (LATE, {}),
        (CURVE, {"all outputs": -0.5 * PERIOD}),
        (LINES, {"all outputs": -0.5 * PERIOD}),
        (LOGGED_LATE, {"all outputs": -PERIOD}),
        (EARLY_PLACE, {"position": -0.5 * PERIOD}),
        (DIFFERENCES, {"velocity": 0.5 * PERIOD}),
    ],
    ids=[
        "held",
        "a late sensor",
        "a curve",
        "lines",
        "logged late",
        "an early place",
        "a speed by differences",
    ],
)
def test_an_offset_is_found_where_there_is_one(rig, case, late):
    runs = told(rig, case)
    catalogue = [e for e in ALL if e.name in NAMES]
    beam = Beam(Core(rig, split(runs, (), ()), [*catalogue, offset.effect(PERIOD)]))
    beam.search()
    assert {a.port: s for a, s in offsets.found(beam).items()} == pytest.approx(late, rel=0.1)


@pytest.mark.parametrize(
    ("case", "late", "note"),
    [
        (CURVE, {ALL_OUTPUTS: -0.01}, "inputs act as they vary between their samples: they are not held"),
        (LOGGED_LATE, {ALL_OUTPUTS: -0.02}, "inputs act 0.02 s earlier than they are recorded"),
        (EARLY_PLACE, {"position": -0.01}, "position is recorded 0.01 s earlier than the other outputs"),
    ],
    ids=["a curve", "logged late", "an early place"],
)
def test_recordings_are_set_right_and_fit_as_those_without_an_offset(rig, case, late, note):
    runs = told(rig, case, friction=0.0)
    own = offset.effect(PERIOD)
    (right, _, _) = offsets.set_right(
        rig, [runs, [], []], {Attached(own, port): s for port, s in late.items()}
    )
    ideal = told(rig, case | {"truth": {}}, friction=0.0)
    before, after, without = (Core(rig, split(r, (), ()), (), 2e-5).base.total for r in (runs, right, ideal))
    assert after < without + 0.05 * (before - without)
    assert right[0].notes[-1] == note


@pytest.mark.long
@pytest.mark.parametrize("friction", [0.0, 0.8])
def test_a_force_that_varies_between_its_samples_is_no_effect(rig, friction):
    figures, _ = workflow.examine(rig, told(rig, CURVE, friction))
    assert [e["name"] for e in figures["effects"]] == ["coulomb_friction"] * (friction > 0.0)
    (note,) = figures["nuisances"]["run"]["mended"]
    assert note.startswith("inputs act as they vary between their samples")


@pytest.mark.long
@pytest.mark.parametrize(("part", "named"), [(0.05, True), (0.25, True), (0.5, False)])
def test_a_delay_of_a_part_of_a_sample_is_one_unless_recordings_make_it(rig, part, named):
    figures, _ = workflow.examine(rig, told(rig, {"command": STEPS, "truth": {"velocity": late(part)}}, 0.0))
    sets = [[e["name"] for e in figures["effects"]], *figures["alternatives"]]
    assert any("sensor_delay" in s for s in sets) == named
    assert ("samples long: the finer steps" in figures["sentence"]) == (part < 0.1)


def test_a_point_without_its_offset_has_none_in_its_values(rig):
    early = Attached(offset.effect(PERIOD), ALL_OUTPUTS)
    point = Point((early,), (), {early.name("delay"): -0.01}, *[None] * 8)  # type: ignore[arg-type]
    (without,) = offsets.without([point], [])
    assert (without.present, without.values) == ((), {early.name("delay"): 0.0})


@pytest.mark.parametrize(
    ("port", "inputs", "said"),
    [(ALL_OUTPUTS, ["a", "b"], True), (ALL_OUTPUTS, ["a"], False), ("y", ["a", "b"], False)],
)
def test_that_all_inputs_may_be_late_as_well_is_said(port: str, inputs: list[str], said: bool):
    late = SimpleNamespace(effect=SimpleNamespace(name="sensor_delay"), port=port)
    ports = SimpleNamespace(controls=["a", "b"], holds=lambda at, outputs: at == ALL_OUTPUTS)
    runs = [SimpleNamespace(inputs=dict.fromkeys(inputs))]
    core = SimpleNamespace(folder=SimpleNamespace(ports=ports), runs=runs, outputs=["y", "z"])
    answer: Any = SimpleNamespace(core=core, named=[late])
    assert bool(offsets.everywhere(answer)) == said
