"""What our recipes add to rsl-rl-lib's PPO: experience in the mirror, a critic that learns first."""

from dataclasses import replace

import numpy as np
import torch

from fmus.models.slew_nn.untrained import untrained
from learning.policy.features import mirrored
from learning.policy.network import weights_of
from learning.policy.ppo import PpoTrainer, with_images
from learning.policy.recipe import recipe
from learning.policy.simulation.situation import Situation, hidden, hidden_mirrored


def trainer(name: str = "single_ppo", **changed: object) -> PpoTrainer:
    """A recipe on few machines and an untrained slew network."""
    told = recipe(name, True, **{"envs": 8, "iterations": 4, **changed})
    return PpoTrainer(told, [untrained(1, residual=True)], 1)


def turned(s: Situation) -> Situation:
    """The machine's hidden quantities with left and right exchanged."""
    bias = s.bias.clone()
    bias[3] *= -1.0
    return replace(s, bias=bias, state=replace(s.state, p_l=s.state.p_r, p_r=s.state.p_l))


def test_hidden_quantities_in_the_mirror_are_those_of_the_machine_in_the_mirror() -> None:
    made = trainer()
    s = replace(made.now, state=replace(made.now.state, p_l=made.now.state.p_l + 3e6))
    assert s.bias[3].abs().min() > 0.0
    assert not torch.equal(hidden(s), hidden_mirrored(hidden(s)))
    torch.testing.assert_close(hidden_mirrored(hidden(s)), hidden(turned(s)))


def test_mirror_images_stand_behind_what_was_seen_and_done() -> None:
    made = trainer()
    seen, done = made.get_observations(), torch.randn(8, 3)
    both, acts = with_images(made, seen, done)
    assert acts is not None
    assert both.batch_size == torch.Size([16])
    assert acts.shape == (16, 3)
    for name in ("policy", "hidden"):
        assert torch.equal(both[name][:8], seen[name])
        assert not torch.equal(both[name][8:], seen[name])
    assert torch.equal(acts[8:], done * torch.tensor([-1.0, 1.0, 1.0]))
    again, back = with_images(made, both[8:], acts[8:])
    assert back is not None
    assert torch.equal(again["policy"][8:], seen["policy"])
    assert torch.equal(again["hidden"][8:], seen["hidden"])
    assert torch.equal(back[8:], done)


def unlike(made: PpoTrainer) -> float:
    """How far the answers in the mirror are from mirrored answers (root mean square)."""
    signs = [torch.tensor(mirrored("full", made.recipe.history, end)) for end in ("inputs", "outputs")]
    with torch.no_grad():
        seen = made.get_observations()["policy"]
        return float((made.mlp(seen * signs[0]) - made.mlp(seen) * signs[1]).square().mean().sqrt())


def test_experience_in_the_mirror_makes_left_and_right_more_alike() -> None:
    """A network that begins at random answers more alike; without mirror images it does not."""
    ends = []
    for told in (True, False):
        made = trainer("ppo", mirrored=told, envs=64, iterations=12, epochs=5)
        for _ in range(12):
            figures = made.iterate()
        ends.append(unlike(made))
        assert ("loss/symmetry" in figures) is told
    assert ends[0] < 0.8 * ends[1]


def test_the_critic_learns_before_the_policy_moves() -> None:
    made = trainer(critic_first=0.5)
    critic = [p.clone() for p in made.algorithm.critic.parameters()]
    start = weights_of(made.mlp)
    for _ in range(2):
        made.iterate()
    assert all(np.array_equal(a, b) for (a, _), (b, _) in zip(start, weights_of(made.mlp), strict=True))
    assert any(not torch.equal(a, b) for a, b in zip(critic, made.algorithm.critic.parameters(), strict=True))
    made.iterate()
    assert not np.array_equal(start[0][0], weights_of(made.mlp)[0][0])
