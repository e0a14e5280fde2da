"""Tuning of the closed loop's controller, on a model that can be reckoned and on a trained one."""

from dataclasses import replace

import numpy as np
import pytest

from learning.collection import controller, tuning
from learning.collection.collect import collect
from learning.collection.slew_control import RANGES, Gains
from specs.errors import InputError


class Lag:
    """A slew model that can be reckoned: dead band, first-order speed, three steps late."""

    def predict(self, u, p_l, p_r, omega, inertia):
        pull = np.sign(u[:, -3]) * np.maximum(np.abs(u[:, -3]) - 0.1, 0.0)
        return p_l[:, -1], p_r[:, -1], omega[:, -1] + 0.1 / (inertia / 4e5) * (0.8 * pull - omega[:, -1])


def test_tuning_finds_gains_that_reach_every_target(monkeypatch):
    monkeypatch.setattr(tuning, "CANDIDATES", 32)
    monkeypatch.setattr(tuning, "ROUNDS", 3)
    starts = tuning.Starts(np.zeros((2, 10)), np.zeros((2, 10)), np.array([3e5, 8e5]))
    monkeypatch.setattr(tuning, "resting", lambda trajectories: starts)
    found = tuning.tune(Lag(), [], 1)  # type: ignore[arg-type]
    assert found.reached == 1.0
    assert found.overshoot_deg < 3.0
    middle = np.array([[(low + high) / 2 for low, high in RANGES.values()]])
    settling, overshoot = tuning.evaluate(Lag(), starts, middle, np.zeros((tuning.STEPS, 12)))  # type: ignore[arg-type]
    before = settling.mean() + tuning.PER_RAD * overshoot.mean()
    assert found.settling_s + tuning.PER_RAD * np.radians(found.overshoot_deg) < before
    assert tuning.tune(Lag(), [], 1) == found  # type: ignore[arg-type]


@pytest.mark.long
def test_the_closed_loop_is_tuned_on_a_model_of_the_other_parts(collected, plan, tmp_path, monkeypatch):
    pytest.importorskip("torch")
    for name, value in (("EPOCHS", 1), ("UNROLL", 2), ("UNROLL_EPOCHS", 1)):
        monkeypatch.setattr(controller, name, value)
    monkeypatch.setattr(tuning, "CANDIDATES", 6)
    monkeypatch.setattr(tuning, "ROUNDS", 2)
    free = replace(plan, gains={})
    for r in controller.learned_from(free):
        (tmp_path / f"{r.name}.parquet").write_bytes((collected / f"{r.name}.parquet").read_bytes())
    found = controller.find(free, tmp_path)
    assert found["from"] == "tuned on a model of 5 recordings"
    assert Gains.of(found["gains"])
    monkeypatch.setattr(tuning, "tune", None)  # a second time nothing is tuned
    assert controller.find(free, tmp_path) == found


def test_a_closed_loop_without_anything_to_learn_from_is_refused(plan, tmp_path):
    with pytest.raises(InputError, match="record first: driving, random, sines, steps, trapezoids"):
        collect(replace(plan, gains={}), tmp_path, parts=("closed_loop",))


@pytest.mark.parametrize(
    ("change", "said"), [({"lead_s": 9.0}, "lead_s = 9"), ({"laed": 1.0}, "unknown laed")]
)
def test_unusable_gains_are_named(plan, change, said):
    with pytest.raises(InputError, match=said):
        Gains.of({**plan.gains, **change})
