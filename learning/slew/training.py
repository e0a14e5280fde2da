"""Training of slew models: one-step loss first, then, if the recipe says so, the error over its own steps."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from fmus.models.slew_nn.network import HISTORY, SlewNetwork
from learning.slew.networks import NAMES, Pair, Scales, State, plain
from learning.slew.recipe import Recipe, exportable
from learning.slew.score import Predictor
from learning.slew.trajectory import Trajectory, Windows, both_ways, windows, zero_filled
from specs.errors import InputError, RunError
from specs.progress import Report

Rows = dict[str, Tensor]  # normalised, [n, history + ahead] each
UNROLL_STRIDE = 3  # rows between the windows of the second phase
CLIP = 1.0  # largest norm of a gradient
WARM_UP = 0.1  # share of the steps in which the learning rate rises
PRESSURE_WEIGHT = 0.1  # of the pressures in the error over own steps, in deviations


@dataclass(frozen=True)
class Trained:
    """A trained model with what it was made by."""

    recipe: Recipe
    pair: Pair

    def network(self) -> SlewNetwork:
        """As plain weights; raises InputError when the recipe's networks have another interface."""
        if not exportable(self.recipe):
            raise InputError(f"recipe {self.recipe.name} has another interface than the paper's networks")
        return plain(self.pair)

    def predictor(self) -> Predictor:
        """Open-loop speed."""
        return lambda of: roll_out(self.pair, of)


def train(
    trajectories: Iterable[Trajectory], recipe: Recipe, seed: int, report: Report | None = None
) -> Trained:
    """Train on `trajectories`; deterministic for a seed on one kind of processor, with one thread.

    Raises RunError when the loss is not a number any more.
    """
    chosen = [t for given in trajectories for t in (given, *zero_filled(given))]
    chosen = list(both_ways(chosen)) if recipe.mirror else chosen
    data = windows(chosen, HISTORY, 1, 1)
    scales = Scales.of(data)
    torch.manual_seed(seed)
    pair = Pair(recipe, scales)
    _phase(pair, data, 1, recipe.epochs, recipe.rate, recipe.batch, report)
    if recipe.unroll:
        longer = windows(chosen, HISTORY, recipe.unroll, UNROLL_STRIDE)
        rest = (recipe.unroll_epochs, recipe.unroll_rate, recipe.batch // 2)
        _phase(pair, longer, recipe.unroll, *rest, report)
    return Trained(recipe, pair.eval())


def _phase(
    pair: Pair, data: Windows, ahead: int, epochs: int, rate: float, batch: int, report: Report | None
) -> None:
    """One cycle of learning rates over `epochs` epochs of the error `ahead` steps on."""
    tensors = {name: pair.scales.normalised(name, getattr(data, name)) for name in NAMES}
    batch = min(batch, len(data))
    count = len(data) // batch
    optimiser = torch.optim.AdamW(pair.parameters(), lr=rate, weight_decay=0.0)
    steps = max(epochs * count, 2)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, steps, pct_start=WARM_UP)
    for epoch in range(epochs):
        order = torch.randperm(len(data))
        for number in range(count):
            rows = {k: v[order[number * batch : (number + 1) * batch]] for k, v in tensors.items()}
            loss = _one_step(pair, rows) if ahead == 1 else _own_steps(pair, rows, ahead)
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(pair.parameters(), CLIP)
            optimiser.step()
            schedule.step()
        last = loss.item()
        if not math.isfinite(last):
            raise RunError(f"training of {pair.recipe.name}: the loss is {last} in epoch {epoch + 1}")
        if report:
            report(f"{pair.recipe.name}, {ahead} step{'s' * (ahead > 1)}", epoch + 1, epochs)


def _one_step(pair: Pair, rows: Rows) -> Tensor:
    """Squared errors of pressures and speed in units of what a step changes."""
    found = next(iter(_open_loop(pair, rows, 1, detach=True)))
    errors = _errors(found, rows, 0)
    step = pair.scales.step
    loss = (errors[2] / step["omega"]).square().mean()
    if pair.pressure is None:
        return loss
    return loss + (torch.cat(errors[:2], dim=1) / step["p_l"]).square().mean()


def _own_steps(pair: Pair, rows: Rows, ahead: int) -> Tensor:
    """Squared errors, in deviations, over `ahead` steps from the measured history on."""
    loss = torch.zeros(())
    for k, found in enumerate(_open_loop(pair, rows, ahead)):
        errors = _errors(found, rows, k)
        loss = loss + errors[2].square().mean()
        if pair.pressure is not None:
            loss = loss + PRESSURE_WEIGHT * 2 * torch.cat(errors[:2], dim=1).square().mean()
    return loss / ahead


def _errors(found: State, rows: Rows, k: int) -> list[Tensor]:
    row = slice(HISTORY + k, HISTORY + k + 1)
    return [value - rows[name][:, row] for value, name in zip(found, ("p_l", "p_r", "omega"), strict=True)]


def _open_loop(pair: Pair, rows: Rows, ahead: int, detach: bool = False) -> Iterator[State]:
    """Step by step from the measured history on."""
    past = [rows[name][:, :HISTORY] for name in ("p_l", "p_r", "omega")]
    for k in range(ahead):
        u, inertia = rows["u"][:, k + 1 : k + 1 + HISTORY], rows["inertia"][:, k + HISTORY - 1 : k + HISTORY]
        found = pair.step(u, past, inertia, detach)
        past = [torch.cat([old[:, 1:], new], dim=1) for old, new in zip(past, found, strict=True)]
        yield found


@torch.no_grad()
def roll_out(pair: Pair, of: Windows) -> np.ndarray:
    """Open-loop speed [n, ahead] in rad/s."""
    scales, ahead = pair.scales, of.u.shape[1] - of.before
    cut = slice(of.before - HISTORY, None)
    rows = {name: scales.normalised(name, getattr(of, name)[:, cut]) for name in NAMES}
    speed = torch.cat([state[2] for state in _open_loop(pair, rows, ahead)], dim=1)
    return speed.numpy().astype(float) * scales.std["omega"] + scales.mean["omega"]
