"""Training through the simulation's own gradient: whole episodes, differentiated by the weights.

The paper's mixed simulation is differentiable, so the derivative of an episode's reward by the weights need not be
estimated by trials.  Each iteration plays one episode of every machine and takes one step of Adam.  A share of the
episodes begins where the last one ended, with a new target and the tool still swinging.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from fmus.slew_nn.network import SlewNetwork
from learning.policy.environment import Environment, Situation
from learning.policy.network import LEAK, Interface, perceptron
from learning.policy.recipe import Recipe
from learning.policy.rewards import weigh
from specs.errors import RunError
from specs.policy import SPACING_S

WARM_UP = 0.02  # share of the iterations in which the rate rises


class GradientTrainer:
    """One seed of a recipe; `iterate` until `recipe.iterations`."""

    def __init__(
        self, recipe: Recipe, networks: Sequence[SlewNetwork], seed: int, device: str = "cpu"
    ) -> None:
        torch.manual_seed(seed)
        self.recipe = recipe
        self.environment = Environment(recipe, networks, recipe.envs, seed, device)
        self.interface = Interface(recipe.task, recipe.history, device)
        self.mlp = perceptron(self.interface.sizes(recipe.layers)).to(device)
        self.optimiser = torch.optim.Adam(self.mlp.parameters(), lr=recipe.rate, betas=(0.9, 0.99))
        self.last: Situation | None = None
        self.done = 0

    def iterate(self) -> dict[str, float]:
        """One episode of all machines and one step; mean reward a second, by term, and what happened."""
        progress = self.done / self.recipe.iterations
        situation, total, terms, counted = self._begin(), 0.0, {}, torch.zeros(2)
        for _ in range(self.environment.periods):
            situation, rewards, seen = self._step(situation, progress)
            total = total - sum(rewards.values()) * SPACING_S
            for name, value in rewards.items():
                terms[name] = terms.get(name, 0.0) + value.detach().mean()
            counted += seen
        loss = total.mean()  # type: ignore[union-attr]
        self._learn(loss, terms, progress)
        self.last = situation.cut()
        self.done += 1
        return self._report(terms, counted, situation)

    def _begin(self) -> Situation:
        e = self.environment
        fresh = e.fresh()
        if self.last is None or not self.recipe.consecutive:
            return fresh
        go_on = (e.uniform(0.0, 1.0) < self.recipe.consecutive) & ~e.ended(self.last)
        return fresh.take(e.retargeted(self.last), go_on)

    def _step(self, s: Situation, progress: float) -> tuple[Situation, dict[str, Tensor], Tensor]:
        e = self.environment
        observation = e.observe(s)
        asked = self.interface.asked(self.mlp(self.interface.features(observation)), observation)
        after = e.advance(s, self.interface.limited(asked, LEAK))
        over = (asked - self.interface.limited(asked)) / self.interface.high
        instant = replace(e.instant(s, after), beyond=over[: self.interface.outputs].square().sum(0))
        rewards = weigh(instant, self.recipe.shape(progress), self.weights(s, progress))
        with torch.no_grad():
            seen = torch.stack([e.unknown(after).float().mean(), e.ended(after).float().mean()])
        return after, rewards, seen.cpu()

    def weights(self, s: Situation, progress: float) -> dict[str, Any]:
        """Weights of the terms; the quiet ones weigh more where the pace is slow."""
        r = self.recipe
        slow = s.pace ** (-r.gentle)
        return {n: r.weight(n, progress) * (slow if n in r.quiet else 1.0) for n in r.terms}

    def _learn(self, loss: Tensor, terms: Mapping[str, Tensor], progress: float) -> None:
        if not math.isfinite(loss.item()):
            wrong = [n for n, v in terms.items() if not math.isfinite(float(v))]
            raise RunError(f"the reward is not a number any more; term: {', '.join(wrong) or 'none alone'}")
        for group in self.optimiser.param_groups:
            group["lr"] = self.recipe.rate * _schedule(progress)
        self.optimiser.zero_grad()
        loss.backward()
        size = torch.nn.utils.clip_grad_norm_(self.mlp.parameters(), self.recipe.norm)
        if not math.isfinite(size):
            raise RunError("the gradient is not a number any more")
        self.optimiser.step()

    def _report(self, terms: Mapping[str, Tensor], counted: Tensor, s: Situation) -> dict[str, float]:
        n = self.environment.periods
        found = {f"reward/{name}": float(value) / n for name, value in terms.items()}
        error = self.environment.error(s).detach().norm(dim=0)
        return {
            "reward": sum(found.values()), **found, "outside_data": float(counted[0]) / n,
            "keep_out": float(counted[1]) / n, "end_error_m": float(error.mean()),
            "end_slew_error_deg": math.degrees(float(s.state.q.detach().abs().mean())),
        }  # fmt: skip

    def state(self) -> dict[str, Any]:
        """All that going on needs."""
        return {
            "mlp": self.mlp.state_dict(), "optimiser": self.optimiser.state_dict(), "last": self.last,
            "generator": self.environment.generator.get_state(), "torch": torch.get_rng_state(),
            "done": self.done,
        }  # fmt: skip

    def load(self, state: Mapping[str, Any]) -> None:
        """Go on where `state` was taken."""
        self.mlp.load_state_dict(state["mlp"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.environment.generator.set_state(state["generator"])
        torch.set_rng_state(state["torch"])
        self.last, self.done = state["last"], state["done"]


def _schedule(progress: float) -> float:
    """Share of the learning rate: rises, then falls as a cosine to a fiftieth."""
    rise = min(1.0, (progress + 1e-3) / WARM_UP)
    return rise * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * min(1.0, progress))))
