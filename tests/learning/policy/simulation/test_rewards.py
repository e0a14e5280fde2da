"""Every reward term against numbers worked out by hand; each can be switched off."""

import math
from dataclasses import replace

import pytest
import torch

from learning.policy.recipe import RECIPES, Recipe, recipe
from learning.policy.simulation.rewards import PAPER, SLEW_ONLY, TERMS, Instant, Shape, weigh
from specs.errors import InputError

ONE = torch.ones(1)
HERE = Instant(
    error=torch.tensor([[0.3], [-0.4], [0.0]]),
    action=torch.tensor([[0.5], [0.2], [-1.0]]),
    before=torch.tensor([[0.4], [0.2], [-0.8]]),
    slew=0.04 * ONE,
    start=-1.0 * ONE,
    slew_rate=-0.3 * ONE,
    boom_rate=0.1 * ONE,
    stick_rate=-0.05 * ONE,
    roll_rate=-0.2 * ONE,
    pitch_rate=0.1 * ONE,
    roll=0.1 * ONE,
    pitch=-0.2 * ONE,
    low=0.25 * ONE,
    beyond=0.36 * ONE,
    near=torch.tensor([[0.4], [0.25], [3.0]]),
)
PLAIN = Shape(1.0, 1.0, 1.0)
BY_HAND = {
    "balance": math.exp(-0.7) - 1.0,
    "target": math.exp(-0.25),
    "action": -(0.1**2 + 0.0 + 0.2**2),
    "overshoot": math.exp(-0.04) - 1.0,
    "oscillation": -0.3,
    "decouple": -0.3 * 0.15,
    "one_shot": 0.0,  # near, but not still
    "closing": -0.07,
    "swing": -(0.04 + 0.01 + 4.9 * (0.01 + 0.04)),
    "settle": -0.0016 / 1.0016,
    "sway": -math.sqrt(0.05 + 0.005**2),
    "keep_out": -0.25,
    "limits": -0.36,
    "clearance": -(0.2**2 + 0.5**2),  # of 0.5 m
}


@pytest.mark.parametrize("name", TERMS)
def test_a_term_is_what_the_paper_writes(name: str) -> None:
    """All of them, at one instant."""
    assert float(TERMS[name](HERE, PLAIN)) == pytest.approx(BY_HAND[name], abs=1e-6)


def test_overshoot_is_past_the_target_alone() -> None:
    """From below past 0 counts, still short of it does not; from above the other way round."""
    short = replace(HERE, slew=-0.04 * ONE)
    from_above = replace(HERE, start=1.0 * ONE)
    assert float(TERMS["overshoot"](short, PLAIN)) == 0.0
    assert float(TERMS["overshoot"](from_above, PLAIN)) == 0.0
    assert float(TERMS["overshoot"](replace(short, start=ONE), PLAIN)) == pytest.approx(math.exp(-0.04) - 1)


def test_one_shot_when_near_and_still() -> None:
    """-|u / sigma|^2 inside 0.5 m and below 0.02 rad/s, else nothing."""
    still = replace(HERE, slew_rate=0.019 * ONE)
    assert float(TERMS["one_shot"](still, PLAIN)) == 0.0  # exactly 0.5 m away
    near = replace(still, error=0.9 * HERE.error)
    assert float(TERMS["one_shot"](near, PLAIN)) == pytest.approx(-(0.25 + 0.04 + 1.0))


def test_shapes_move_the_widths() -> None:
    """The curriculum's widths: e over the width."""
    wide = Shape(7.0, 0.5, 0.1)
    assert float(TERMS["balance"](HERE, wide)) == pytest.approx(math.exp(-0.1) - 1.0)
    assert float(TERMS["target"](HERE, wide)) == pytest.approx(math.exp(-1.0))
    assert float(TERMS["overshoot"](HERE, wide)) == pytest.approx(math.exp(-0.4) - 1.0)


@pytest.mark.parametrize("name", TERMS)
def test_every_term_can_be_switched_off(name: str) -> None:
    """A weight of 0 leaves it out; the others are weighed."""
    weights = dict.fromkeys(TERMS, 2.0) | {name: 0.0}
    found = weigh(HERE, PLAIN, weights)
    assert name not in found
    assert {n: float(v) for n, v in found.items()} == pytest.approx(
        {n: 2.0 * v for n, v in BY_HAND.items() if n != name}, abs=1e-6
    )


def test_the_papers_recipes_have_its_terms() -> None:
    """Seven, and five for the slew alone."""
    assert set(RECIPES["paper"].terms) == set(PAPER)
    assert set(RECIPES["paper_slew"].terms) == set(SLEW_ONLY)


def test_curriculum_moves_widths_and_late_weights() -> None:
    """From the first to the last at its share; one-shot grows from nothing."""
    r = Recipe("r", "", weights={"one_shot": 0.4}, first=Shape(8, 4, 1), last=Shape(2, 1, 1), curriculum=0.5)
    assert r.shape(0.0) == Shape(8, 4, 1)
    assert r.shape(0.25) == Shape(5.0, 2.5, 1.0)
    assert r.shape(0.9) == Shape(2, 1, 1)
    assert [r.weight("one_shot", p) for p in (0.0, 0.25, 1.0)] == pytest.approx([0.0, 0.2, 0.4])


def test_unknown_terms_tasks_and_recipes_are_refused() -> None:
    """With what is valid."""
    with pytest.raises(InputError, match="no reward term 'balanc'"):
        recipe("full", weights={"balanc": 1.0})
    with pytest.raises(InputError, match="valid: slew, full"):
        recipe("full", task="boom")
    with pytest.raises(InputError, match="no recipe 'ful'"):
        recipe("ful")
