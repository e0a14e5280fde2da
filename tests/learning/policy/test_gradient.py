"""The gradient of an episode is its reward's own: against differences, through all of the simulation."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from learning.policy.gradient import GradientTrainer, schedule
from learning.policy.recipe import recipe
from learning.policy.simulation.environment import load_networks, without_noise

WEIGHTS = Path(__file__).resolve().parents[3] / "fmus" / "models" / "slew_nn" / "weights.npz"


def episode(trainer: GradientTrainer) -> torch.Tensor:
    """Mean reward of the same 2 s episodes, whatever the weights."""
    trainer.environment.generator.manual_seed(5)
    s = trainer.environment.fresh()
    total = torch.zeros(trainer.environment.n)
    for _ in range(20):
        observation = trainer.environment.observe(s)
        y = trainer.mlp(trainer.interface.features(observation))
        step = trainer.play(s, y, observation, leak=0.0)
        s, rewards = step.after, trainer.rewards([step])
        total = total + sum(rewards.values())
    return total.mean()


@pytest.mark.parametrize("task", ["slew", "full"])
def test_the_gradient_is_that_of_differences(task: str) -> None:
    """Along the gradient and along two random directions of the weights."""
    weights = {"balance": 1.0, "closing": 1.0, "oscillation": 0.5, "decouple": 0.5, "action": 0.1}
    chosen = replace(
        without_noise(recipe(task)), envs=32, layers=(16,), weights=weights, iterations=2, ahead_s=0.0
    )
    trainer = GradientTrainer(chosen, load_networks([WEIGHTS]), 1)
    parameters = list(trainer.mlp.parameters())
    gradient = torch.autograd.grad(episode(trainer), parameters)
    start = [p.detach().clone() for p in parameters]
    generator = torch.Generator().manual_seed(2)
    directions = [
        gradient,
        *([torch.randn(p.shape, generator=generator) for p in parameters] for _ in range(2)),
    ]
    for direction in directions:
        size = torch.sqrt(sum((d**2).sum() for d in direction))  # type: ignore[arg-type]
        slope = sum(float((g * d).sum()) for g, d in zip(gradient, direction, strict=True)) / float(size)
        ends = []
        for sign in (1.0, -1.0):
            with torch.no_grad():
                for p, at, d in zip(parameters, start, direction, strict=True):
                    p.copy_(at + sign * 0.01 * d / size)
                ends.append(float(episode(trainer)))
        assert (ends[0] - ends[1]) / 0.02 == pytest.approx(
            slope, rel=0.05, abs=0.02 * float(gradient_size(gradient))
        )


def gradient_size(gradient: tuple[torch.Tensor, ...]) -> torch.Tensor:
    """Euclidean length."""
    return torch.sqrt(torch.stack([(g**2).sum() for g in gradient]).sum())


def test_the_rate_rises_and_falls() -> None:
    """From little to all to a fiftieth."""
    values = [schedule(p) for p in (0.0, 0.02, 0.5, 1.0)]
    assert values[0] < 0.1
    assert values[1] > 0.95
    assert values[2] == pytest.approx(0.51, abs=0.01)
    assert values[3] == pytest.approx(0.02)


def test_fading_takes_a_share_of_the_gradient_at_each_step() -> None:
    """What the state three steps before passes on is the share to the power of three; values stay."""
    trainer = GradientTrainer(replace(recipe("slew"), envs=4, iterations=2), load_networks([WEIGHTS]), 1)
    action = torch.zeros(3, 4)
    found = {}
    for share in (1.0, 0.9):
        trainer.environment.generator.manual_seed(5)
        s = trainer.environment.fresh()
        q = s.state.q.clone().requires_grad_()
        s = replace(s, state=replace(s.state, q=q))
        for _ in range(3):
            s = trainer.environment.advance(s, action).faded(share)
        found[share] = s.state.q.detach(), torch.autograd.grad(s.state.q.sum(), q)[0]
    assert torch.equal(found[0.9][0], found[1.0][0])
    assert torch.allclose(found[0.9][1], 0.9**3 * found[1.0][1])


def test_no_machine_rules_the_gradient_of_all() -> None:
    """One whose gradient is a thousand times the others' is held to `most` medians; the others' stay."""
    trainer = GradientTrainer(replace(recipe("slew"), envs=5, iterations=2), load_networks([WEIGHTS]), 1)
    s = trainer.environment.fresh()
    q = s.state.q.clone().requires_grad_()
    s = replace(s, state=replace(s.state, q=q))
    weights = torch.tensor([1.0, 1.0, 1.0, 1000.0, 1.0])
    (found,) = torch.autograd.grad((s.faded(1.0, 3.0).state.q * weights).sum(), q)
    assert torch.allclose(found, torch.tensor([1.0, 1.0, 1.0, 3.0, 1.0]))
