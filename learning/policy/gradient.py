"""Training through the simulation's own gradient: whole episodes, differentiated by the weights.

The paper's mixed simulation is differentiable, so the derivative of an episode's reward by the weights need
not be estimated by trials.  Each iteration plays one episode of every machine and takes one step of Adam.
A share of the episodes begins where the last one ended, with a new target and the tool still swinging.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from fmus.models.slew_nn.network import SlewNetwork
from learning.policy import checkpoint
from learning.policy.export import Weights, read
from learning.policy.network import Interface, set_weights, shaped, weights_of
from learning.policy.recipe import Recipe
from learning.policy.simulation import finite
from learning.policy.simulation.situation import HIDDEN, Situation, Step, hidden
from learning.policy.trainer import Trainer
from specs.ahead import NOTHING
from specs.errors import InputError, RunError
from specs.policy import SPACING_S
from specs.schema import ROOT

LOOK = 10  # steps between looks at what is outside of data and keep-out: a sample is enough
SHIPPED = ROOT.parent / "learning" / "policies"
BEGUN = ("", "mirror")  # networks that weights of dense layers can be put into
WARM_UP = 0.02  # share of the iterations in which the rate rises


class GradientTrainer(Trainer):
    """One seed of a recipe, trained by the gradient of its episodes."""

    def __init__(
        self, recipe: Recipe, networks: Sequence[SlewNetwork], seed: int, device: str = "cpu"
    ) -> None:
        super().__init__(recipe, networks, seed, device)
        self.mlp = shaped(recipe, self.interface, HIDDEN * recipe.privileged).to(device)
        if recipe.start:
            begin(self.mlp, recipe, self.interface)
        self.teacher = _teacher(recipe, self.interface).to(device) if recipe.teacher else None
        self.optimiser = torch.optim.Adam(self.mlp.parameters(), lr=recipe.rate, betas=(0.9, 0.99))
        self.last: Situation | None = None

    def iterate(self) -> dict[str, float]:
        """One episode of all machines and one step; mean reward a second, by term, and what happened."""
        e, s = self.environment, self.begin(self.last)
        steps: list[Step] = []
        unknown, ended, missed = torch.zeros(()), torch.zeros(()), torch.zeros(())
        for k in range(e.periods):
            observation = e.observe(s)
            answer, apart = self._answer(s, self.interface.features(observation))
            missed = missed + apart
            steps.append(self.play(s, answer, observation))
            s = steps[-1].after.faded(self.recipe.fade, self.recipe.level)
            if k % LOOK == 0:
                with torch.no_grad():
                    unknown = unknown + LOOK * e.unknown(s).float().mean()
                    ended = ended + LOOK * e.ended(s).float().mean()
        rewards = self.rewards(steps)
        terms = {name: value.detach().mean() * e.periods for name, value in rewards.items()}
        self.check(terms | {"imitation": missed.detach()}, steps)
        worth: Any = sum(value.mean() for value in rewards.values()) * e.periods
        self._learn((self.recipe.imitation * missed - worth) * SPACING_S, steps)
        self.last = s.cut()
        self.done += 1
        return self.report(terms, e.periods, unknown, ended) | self.end_errors(self.last)

    def _answer(self, s: Situation, seen: Tensor) -> tuple[Tensor, Tensor]:
        """The network's answer, and how far it is from the teacher's: mean of its square."""
        if self.recipe.privileged:
            return self.mlp(torch.cat([seen, hidden(s)], dim=1)), torch.zeros(())
        answer = self.mlp(seen)
        if self.teacher is None:
            return answer, torch.zeros(())
        with torch.no_grad():
            wanted = self.teacher(torch.cat([seen, hidden(s)], dim=1))
        return answer, (answer - wanted).square().sum(1).mean()

    def _learn(self, loss: Tensor, steps: Sequence[Step]) -> None:
        for group in self.optimiser.param_groups:
            group["lr"] = self.recipe.rate * schedule(self.progress)
        self.optimiser.zero_grad()
        loss.backward()
        size = torch.nn.utils.clip_grad_norm_(self.mlp.parameters(), self.recipe.norm)
        if not math.isfinite(size):
            named = self._steep(steps)
            why = (
                f"of reward term {', '.join(named)}" if named else "all terms and their own slopes are finite"
            )
            raise RunError(f"iteration {self.done + 1}: the gradient is not a number any more ({why})")
        self.optimiser.step()
        self.check_update({}, {"network": self.mlp})

    def _steep(self, steps: Sequence[Step]) -> list[str]:
        """Terms whose own slope by the simulation's state or the answers is not a number."""
        bare = [Step(s.before.cut(), s.after.cut(), s.asked.detach()) for s in steps]
        leaves = [leaf for s in bare for leaf in (*s.after.state.__dict__.values(), s.after.action, s.asked)]
        leaves = [leaf.requires_grad_() for leaf in leaves]
        return [n for n, value in self.rewards(bare).items() if finite.infinite(_slopes(value, leaves))]

    def state(self) -> dict[str, Any]:
        """All that going on needs."""
        return super().state() | {"optimiser": self.optimiser.state_dict(), "last": self.last}

    def load(self, state: Mapping[str, Any]) -> None:
        """Go on where `state` was taken."""
        super().load(state)
        self.optimiser.load_state_dict(state["optimiser"])
        self.last = state["last"] and state["last"].on(self.device)


def _slopes(value: Tensor, leaves: Sequence[Tensor]) -> list[Tensor]:
    if not value.requires_grad:
        return []
    found = torch.autograd.grad(value.mean(), leaves, retain_graph=True, allow_unused=True)
    return [slope for slope in found if slope is not None]


def _teacher(recipe: Recipe, way: Interface) -> nn.Sequential:
    """The network in a teacher's checkpoint; InputError if it is none, or of another shape."""
    path = Path(recipe.teacher) / checkpoint.NAME
    mlp = shaped(recipe, way, HIDDEN)
    try:
        mlp.load_state_dict(checkpoint.read(path)["state"]["mlp"])
    except (InputError, RuntimeError) as error:  # missing, damaged, or a network of other sizes
        raise InputError(f"teacher {path}: {error}; train one with --set privileged=true") from error
    return mlp.requires_grad_(False)


def begin(mlp: nn.Sequential, recipe: Recipe, way: Interface) -> None:
    """Give a new network the weights of the recipe's `start`; InputError if they are of another network."""
    path = Path(recipe.start)
    policy = read(SHIPPED / path if len(path.parts) == 1 else path)
    told, wanted = policy.contract, (recipe.task, recipe.history, recipe.prior)
    weights = policy.weights if told.ahead else _widened(policy.weights, way.inputs)
    shapes = [w.shape for w, _ in weights_of(mlp)]
    fits = recipe.network in BEGUN and (told.task, told.history, told.prior) == wanted
    fits = fits and told.ahead in (NOTHING, recipe.ahead) and shapes == [w.shape for w, _ in weights]
    if fits:
        set_weights(mlp, weights)
        pairs = zip(weights_of(mlp), weights, strict=True)
        fits = all(np.allclose(a, b, atol=1e-5) for (a, _), (b, _) in pairs)
    if not fits:
        raise InputError(
            f"start {recipe.start}: not a {recipe.task} policy of history {recipe.history}, prior "
            f"'{recipe.prior}' and layers {list(recipe.layers)} ({recipe.network or 'plain'})"
        )


def _widened(weights: Weights, inputs: int) -> Weights:
    """The weights with more inputs, which come last and count for nothing at first."""
    (first, bias), *others = weights
    more = np.zeros((len(first), max(0, inputs - first.shape[1])), dtype=first.dtype)
    return [(np.hstack([first, more]), bias), *others]


def schedule(progress: float) -> float:
    """Share of the learning rate: rises, then falls as a cosine to a fiftieth."""
    rise = min(1.0, (progress + 1e-3) / WARM_UP)
    return rise * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * min(1.0, progress))))
