"""Steps of a sensor are found in the values, and named only where they are coarser than they should be."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from blindtest import case as cases
from fmus.definition import Sensor, Variable
from fmus.toolchain.loader import load_model
from reconcile.judging import quantization
from reconcile.judging.quantization import examine, named
from reconcile.page.drawn import Shown
from reconcile.page.page import write_page
from reconcile.recordings.data import Run, Signal
from reconcile.reporting import contract
from tests.reconcile.answers import RIG
from tests.reconcile.reports import REPORT

SLOW = [pytest.mark.slow, pytest.mark.long]


def run(rig, step: float, noise: float, seed: int = 1) -> Run:
    """A run of the rig whose position has noise, then steps; its speed has neither."""
    rng = np.random.default_rng(seed)
    time = 0.02 * np.arange(1500)
    position = np.sin(0.7 * time) + 0.3 * np.sin(2.1 * time) + noise * rng.standard_normal(len(time))
    if step:
        position = step * np.round(position / step)
    speed = np.cos(time) + 1e-3 * rng.standard_normal(len(time))
    outputs = {"position": Signal(time, position), "velocity": Signal(time, speed)}
    return Run("run", 0.0, float(time[-1]), {"force": Signal(time, speed)}, outputs)


def with_specified(model, quantum: float):
    more = Variable("encoder_step", "m", "Step of the encoder", start=quantum)
    sensors = {"position": Sensor(quantum="encoder_step")}
    return replace(model, parameters=(*model.parameters, more), sensors=sensors)


def test_steps_coarser_than_the_noise_are_named_with_their_size(rig):
    (found,) = examine(rig.model, [run(rig, 0.004, 5e-4), run(rig, 0.004, 5e-4, seed=2)])
    assert found.verdict == "named"
    effect = found.effect("rig")
    assert (effect["name"], effect["port"]) == ("sensor_quantization", "position")
    step = effect["parameters"]["step"]
    assert step["value"] == pytest.approx(0.004, rel=1e-6)
    assert step["ci95"][0] <= step["value"] <= step["ci95"][1]
    assert step["unit"] == "m"


def test_counts_have_no_unit_behind_their_steps(rig):
    position = replace(rig.model.outputs[0], unit="1")
    counted = replace(rig.model, outputs=(position, *rig.model.outputs[1:]))
    (found,) = examine(counted, [run(rig, 0.004, 5e-4)])
    assert found.sentence.startswith("position is recorded in steps of 0.004, coarser than its other noise (")
    assert found.sentence[-2].isdigit()


@pytest.mark.parametrize("noise", [2e-4, 2e-3])
def test_steps_below_the_noise_are_seen_and_not_named(rig, noise):
    found = examine(rig.model, [run(rig, 0.5 * noise, noise)])
    assert [q.verdict for q in found] == ["below_noise"]
    assert found[0].step == pytest.approx(0.5 * noise, rel=1e-6)
    assert found[0].noise == pytest.approx(noise, rel=0.15)
    assert named(found) == []


def test_no_steps_are_found_in_plain_noise(rig):
    assert examine(rig.model, [run(rig, 0.0, 1e-3)]) == []


@pytest.mark.parametrize(("quantum", "verdict"), [(1e-3, "specified"), (2.5e-4, "named")])
def test_the_specification_decides_where_there_is_one(rig, quantum, verdict):
    (found,) = examine(with_specified(rig.model, quantum), [run(rig, 1e-3, 2e-3)])
    assert found.verdict == verdict
    assert f"{quantum:.4g} m" in found.sentence


def test_single_precision_does_not_hide_the_steps(rig):
    one = run(rig, 1e-3, 1e-4)
    position = one.outputs["position"]
    coarse = Signal(position.time, position.values.astype(np.float32).astype(float))
    (found,) = examine(rig.model, [replace(one, outputs={**one.outputs, "position": coarse})])
    assert found.step == pytest.approx(1e-3, rel=1e-4)


def test_a_switch_is_no_lattice(rig):
    one = run(rig, 0.0, 1e-3)
    time = one.outputs["position"].time
    switch = Signal(time, (np.sin(time) > 0).astype(float))
    assert examine(rig.model, [replace(one, outputs={**one.outputs, "position": switch})]) == []


@pytest.mark.parametrize("system", ["servo", "arm", "tool", pytest.param("slew", marks=SLOW)])
@pytest.mark.parametrize("noise", ["low", "high"])
def test_in_recordings_of_drawn_machines_only_coarse_steps_are_named(system, noise):
    """Their sensors have quanta below their noise; then one is read in steps of ten times its noise."""
    case = cases.draw(11, noise, system, visible=0)
    signals = case.system.outputs
    model = replace(load_model(RIG), sensors={}, outputs=tuple(Variable(s.name, s.unit, "") for s in signals))
    clean = [run_of(signals, r.outputs) for r in case.runs]
    assert named(examine(model, clean)) == []
    steps = {s.name: 10.0 * case.surroundings.outputs[i] for i, s in enumerate(signals)}
    moves = {s.name: max(np.ptp(r.outputs[s.name].values) for r in clean) for s in signals}
    told = [n for n, step in steps.items() if moves[n] > 20.0 * step]  # a handful of levels is no lattice
    assert told or noise == "high"
    for name in told:
        coarse = [run_of(signals, r.outputs, {name: steps[name]}) for r in case.runs]
        (found,) = named(examine(model, coarse))
        assert (found.output, found.step) == (name, pytest.approx(steps[name], rel=1e-6))


def run_of(signals, outputs: np.ndarray, steps: dict[str, float] | None = None) -> Run:
    """A recorded run, some outputs in steps of their own."""
    time = 0.02 * np.arange(len(outputs))
    columns = {s.name: outputs[:, i] for i, s in enumerate(signals)}
    for n, step in (steps or {}).items():
        columns[n] = step * np.round(columns[n] / step)
    return Run("run", 0.0, float(time[-1]), {}, {n: Signal(time, v) for n, v in columns.items()})


def test_many_digits_without_noise_are_no_effect(rig):
    (found,) = examine(rig.model, [run(rig, 1e-4, 0.0)])
    assert found.verdict == "fine"


# ---------------------------------------------------------------- in the report


@pytest.fixture
def coarse(rig):
    return examine(rig.model, [run(rig, 0.004, 5e-4)])


@pytest.mark.parametrize("verdict", ["agrees", "reestimated", "named", "ambiguous"])
def test_named_steps_join_what_else_is_found(coarse, verdict):
    before = REPORT[verdict]
    report = before | quantization.added(before, coarse, "rig")
    assert contract.check(before) == []
    assert contract.check(report) == []
    assert report["verdict"] == ("ambiguous" if verdict == "ambiguous" else "named")
    assert report["residual_status"] == before["residual_status"]
    assert [e["name"] for e in report["effects"]][-1] == "sensor_quantization"
    assert all("sensor_quantization" in names for names in report["alternatives"])
    assert "position is recorded in steps of 0.004 m" in report["sentence"]
    assert quantization.steps(report) == {"position": pytest.approx(0.004)}


@pytest.mark.parametrize(
    ("verdict", "begins"),
    [
        ("agrees", "The model lacks sensor_quantization. position is"),
        ("reestimated", "The model lacks sensor_quantization. position is"),
    ],
)
def test_where_only_steps_are_named_the_sentence_says_what_else_there_is(coarse, verdict, begins):
    before = REPORT[verdict]
    said = quantization.added(before, coarse, "rig")["sentence"]
    assert said.startswith(begins)
    assert said.endswith(f". Apart from the steps: {before['sentence']}")


@pytest.mark.parametrize("verdict", ["insufficient_excitation", "unexplained"])
def test_steps_are_listed_only_where_nothing_is_told_of_the_model(coarse, verdict):
    before = REPORT[verdict]
    report = before | quantization.added(before, coarse, "rig")
    assert report["verdict"] == verdict
    assert report["sentence"] == before["sentence"]
    assert report["effects"] == []
    assert [q["verdict"] for q in report["quantization"]] == ["named"]


def test_steps_that_are_no_effect_change_nothing_but_the_list(rig):
    before = copy.deepcopy(REPORT["agrees"])
    found = quantization.added(before, examine(rig.model, [run(rig, 1e-4, 2e-4)]), "rig")
    assert list(found) == ["quantization"]
    assert quantization.added(before, [], "rig") == {}


def test_the_page_shows_steps_as_seen_and_not_as_fitted(coarse, tmp_path):
    report = REPORT["agrees"] | quantization.added(REPORT["agrees"], coarse, "rig")
    page = write_page(tmp_path / "report.html", report, Shown(), "rig").read_text("utf-8")
    assert "Outputs recorded in steps" in page
    assert "Seen in the recorded values, not fitted" in page
    assert "0 % of the gap" not in page


def test_the_extended_model_has_the_steps_and_is_not_told_of_them_again(rig, tmp_path):
    from reconcile.extend import extend

    model = extend(RIG, [("sensor_quantization", "position", None, {"step": 0.004})], {})
    quantum = model.sensors["position"].quantum
    assert next(v for v in model.parameters if v.name == quantum).start == 0.004
    (found,) = examine(model, [run(rig, 0.004, 5e-4)])
    assert found.verdict == "specified"
