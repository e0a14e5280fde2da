"""Traits of an arm, of recordings whose arm is made of them."""

from pathlib import Path

import numpy as np
import pytest

from learning.collection.plan import load_plan
from learning.policy.simulation import arm_traits
from records.measurement import Channel, Measurement

TICK_S, DELAY_S = 0.02, 0.1


def recording(lost: float, gain: float, hz: float, damping: float, noise: float = 2e-4) -> Measurement:
    """A boom that loses small references and rings behind the rest, stepped as the plan steps it."""
    told = np.repeat([0.0] * 10 + [*up_and_down(0.01), *up_and_down(0.04), *up_and_down(0.08)], 5)
    t = TICK_S * np.arange(len(told))
    wanted = gain * np.sign(told) * np.maximum(np.abs(told) - lost, 0.0)
    wanted = np.concatenate([np.zeros(round(DELAY_S / TICK_S)), wanted])[: len(t)]
    w, rate, slope, angle = 2 * np.pi * hz, 0.0, 0.0, []
    q = 1.0
    for want in wanted:
        for _ in range(20):
            slope += TICK_S / 20 * (w * w * (want - rate) - 2 * damping * w * slope)
            rate += TICK_S / 20 * slope
            q += TICK_S / 20 * rate
        angle.append(q)
    seen = np.array(angle) + noise * np.random.default_rng(1).standard_normal(len(t))
    return Measurement(
        {c.name: c for c in (Channel("qd_boom_ref", "rad/s", t, told), Channel("q_boom", "rad", t, seen))}
    )


def up_and_down(size: float) -> list[float]:
    """3 s each way with 2 s of rest, in periods of 0.1 s."""
    return [size] * 30 + [0.0] * 20 + [-size] * 30 + [0.0] * 20


@pytest.mark.parametrize(
    ("lost", "gain", "hz", "damping"), [(0.006, 1.2, 1.4, 0.1), (0.0, 0.9, 2.2, 0.2), (0.003, 1.0, 1.1, 0.08)]
)
def test_what_an_arm_is_made_of_is_found(lost: float, gain: float, hz: float, damping: float) -> None:
    """Through the encoder's noise; the grid's spacing and a twentieth of the gain."""
    found = list(arm_traits.steps(recording(lost, gain, hz, damping), "boom"))
    assert arm_traits.lost_and_gain(found) == pytest.approx((lost, gain), abs=0.05 * gain)
    assert arm_traits.lost_and_gain(found)[0] == pytest.approx(lost, abs=5e-4)
    assert arm_traits.ringing(found) == (pytest.approx(hz, abs=0.06), pytest.approx(damping, abs=0.025))


def test_the_plan_steps_both_joints_near_and_far() -> None:
    """So that each recording steps one of them, over whole periods, small references among them."""
    plan = load_plan(Path("arm_steps"))
    assert set(plan.parts) == {"boom_near", "boom_far", "stick_near", "stick_far"}
