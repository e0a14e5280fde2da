"""What both ways of training have in common: the environment, the interface, weighed rewards, starts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor, nn

from fmus.models.slew_nn.network import SlewNetwork
from learning.policy.network import LEAK, Interface
from learning.policy.recipe import Recipe
from learning.policy.simulation import finite
from learning.policy.simulation.environment import Environment
from learning.policy.simulation.rewards import weigh
from learning.policy.simulation.situation import Situation, Step
from specs.errors import RunError


class Trainer:
    """One seed of a recipe; `iterate` until `done` is `recipe.iterations`."""

    mlp: nn.Sequential

    def __init__(
        self, recipe: Recipe, networks: Sequence[SlewNetwork], seed: int, device: str = "cpu"
    ) -> None:
        torch.manual_seed(seed)
        self.recipe, self.device = recipe, device
        self.environment = Environment(recipe, networks, recipe.envs, seed, device)
        r = recipe
        self.interface = Interface(r.task, r.history, r.prior, device, r.change, r.ahead)
        self.done = 0
        self.sources = [member.name for member in self.environment.members]  # for messages

    @property
    def progress(self) -> float:
        """Share of the training that is done."""
        return self.done / self.recipe.iterations

    def iterate(self) -> dict[str, float]:
        """One iteration; figures by name."""
        raise NotImplementedError

    def play(self, s: Situation, y: Tensor, observation: Tensor, leak: float = LEAK) -> Step:
        """A step with the network's answer y [n, outputs]; what it is worth: `rewards`."""
        asked = self.interface.asked(y, observation)
        return Step(s, self.environment.advance(s, self.interface.limited(asked, leak)), asked)

    def rewards(self, steps: Sequence[Step]) -> dict[str, Tensor]:
        """Weighed rewards of steps, [steps * n] by name: all machines of the first step come first."""
        instant = self.environment.instants([step.before for step in steps], [step.after for step in steps])
        if "limits" in self.recipe.terms:
            asked = torch.cat([step.asked for step in steps], dim=1)
            over = (asked - self.interface.limited(asked)) / self.interface.high
            instant = replace(instant, beyond=over[: self.interface.outputs].square().sum(0))
        pace = torch.cat([step.before.pace for step in steps])
        return weigh(instant, self.recipe.shape(self.progress), self.weights(pace))

    def weights(self, pace: Tensor) -> dict[str, Any]:
        """Weights of the terms; the quiet ones weigh more where the pace is slow."""
        r = self.recipe
        slow = pace ** (-r.gentle)
        return {n: r.weight(n, self.progress) * (slow if n in r.quiet else 1.0) for n in r.terms}

    def begin(self, last: Situation | None) -> Situation:
        """Starts: fresh ones, and for a share where `last` ended, with new targets."""
        e = self.environment
        fresh = e.fresh()
        if last is None or not self.recipe.consecutive:
            return fresh
        go_on = (e.uniform(0.0, 1.0) < self.recipe.consecutive) & ~e.ended(last)
        return fresh.take(e.retargeted(last), go_on)

    def check(self, terms: Mapping[str, Tensor], steps: Sequence[Step] = ()) -> None:
        """RunError naming the reward term that is not a number, or what in `steps` was none before it."""
        wrong = finite.infinite(terms)
        if wrong:
            first = finite.cause(steps, self.sources) or f"reward term {', '.join(wrong)}"
            raise RunError(f"iteration {self.done + 1}: {first} is not a number any more")

    def check_update(self, losses: Mapping[str, Any], networks: Mapping[str, nn.Module]) -> None:
        """RunError naming losses or weights that are not numbers after an update, before it counts."""
        wrong = finite.infinite(losses) or finite.weights(networks)
        if wrong:
            raise RunError(f"iteration {self.done + 1}: {finite.shown(wrong)} is not a number any more")

    def report(
        self, terms: Mapping[str, Tensor], count: int, unknown: Tensor, ended: Tensor
    ) -> dict[str, float]:
        """Mean reward a second by term over `count` steps; shares outside the data and in the keep-out."""
        found = {f"reward/{name}": float(value) / count for name, value in terms.items()}
        return {
            "reward": sum(found.values()), **found,
            "outside_data": float(unknown) / count, "keep_out": float(ended) / count,
        }  # fmt: skip

    def end_errors(self, s: Situation) -> dict[str, float]:
        """How far from their targets the machines are at the end of an episode."""
        return {
            "end_error_m": float(self.environment.error(s).detach().norm(dim=0).mean()),
            "end_slew_error_deg": math.degrees(float(s.state.q.detach().abs().mean())),
        }

    def state(self) -> dict[str, Any]:
        """All that going on needs."""
        return {
            "mlp": self.mlp.state_dict(), "generator": self.environment.generator.get_state(),
            "torch": [get() for get, _ in self._random()], "done": self.done,
        }  # fmt: skip

    def _random(self) -> list[tuple[Any, Any]]:
        """How to read and set the state of torch's own generators that are used."""
        found = [(torch.get_rng_state, torch.set_rng_state)]
        return found + [(torch.cuda.get_rng_state, torch.cuda.set_rng_state)] * (self.device == "cuda")

    def load(self, state: Mapping[str, Any]) -> None:
        """Go on where `state` was taken."""
        self.mlp.load_state_dict(state["mlp"])
        self.environment.generator.set_state(state["generator"])
        for (_, put), numbers in zip(self._random(), state["torch"], strict=True):
            put(numbers)
        self.done = state["done"]
