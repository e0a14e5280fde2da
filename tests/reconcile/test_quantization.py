"""Steps of a sensor are found in the values, and named only where they are coarser than they should be."""

from dataclasses import replace

import numpy as np
import pytest

from fmus.definition import Sensor, Variable
from reconcile.data import Run, Signal
from reconcile.quantization import examine, named


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
    effect = found.effect()
    assert (effect["name"], effect["port"]) == ("sensor_quantization", "position")
    step = effect["parameters"]["step"]
    assert step["value"] == pytest.approx(0.004, rel=1e-6)
    assert step["ci95"][0] <= step["value"] <= step["ci95"][1]
    assert step["unit"] == "m"


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
