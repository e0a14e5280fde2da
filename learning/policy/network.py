"""The policy network in torch, and the way from observations to commands around it."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn

from learning.policy.export import Weights
from learning.policy.features import OUTPUTS, SCALES, SLEW_CHANNELS, commands, features, mirrored
from learning.policy.recipe import Recipe
from learning.policy.simulation.kernel import Kernel
from specs.policy import ACTIONS, LIMITS

LEAK = 0.1  # of the gradient that passes a command at its limit


def perceptron(sizes: Sequence[int]) -> nn.Sequential:
    """Linear layers with tanh between them and a linear output (paper); the last layer starts near 0."""
    return _stacked([nn.Linear(a, b) for a, b in pairwise(sizes)])


def shaped(recipe: Recipe, way: "Interface", more: int = 0) -> nn.Sequential:
    """The recipe's network: the paper's, or with a structure that is dense layers once it is trained.

    `more` inputs after the interface's: the paper's network only.
    """
    sizes = way.sizes(recipe.layers)
    if recipe.network == "mirror":
        signs = [torch.tensor(mirrored(recipe.task, recipe.history, end)) for end in ("inputs", "outputs")]
        layers = [_Twice(a, b) for a, b in pairwise(sizes)]
        layers[0].seen, layers[-1].answered = signs
        return _stacked(layers)
    if recipe.network == "convolution":
        rows = len(SCALES) if recipe.task == "full" else len(SLEW_CHANNELS)
        first = _InTime(rows, recipe.history, sizes[0])
        return _stacked([first, *(nn.Linear(a, b) for a, b in pairwise([first.wide, *sizes[1:]]))])
    return perceptron([sizes[0] + more, *sizes[1:]])


def _stacked(layers: Sequence[nn.Module]) -> nn.Sequential:
    """Layers with tanh between them; the last one's weights start near 0."""
    with torch.no_grad():
        for name, weight in layers[-1].named_parameters():
            weight.mul_(0.1 if name.endswith("weight") else 0.0)
    parts = [part for layer in layers for part in (layer, nn.Tanh())]
    return nn.Sequential(*parts[:-1])


class _Twice(nn.Module):
    """One layer for what is seen and for its mirror image: the answer to one is the mirror of the other's.

    seen [n, M] -> both [n, 2 k]; between: both to both; the last: their mean, the second mirrored back.
    """

    seen: Tensor | None  # signs of the first layer's inputs in a mirror
    answered: Tensor | None  # signs of the last layer's outputs

    def __init__(self, a: int, b: int) -> None:
        super().__init__()
        self.own = nn.Linear(a, b)
        for signs in ("seen", "answered"):  # they go where the network goes
            self.register_buffer(signs, None, persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        one, other = (x, x * self.seen) if self.seen is not None else x.chunk(2, dim=-1)
        both = self.own(one), self.own(other)
        return torch.cat(both, -1) if self.answered is None else (both[0] + both[1] * self.answered) / 2


class _InTime(nn.Module):
    """Filters along the history of each channel, the same at every age, beside what has no history."""

    def __init__(self, rows: int, history: int, inputs: int, filters: int = 32, taps: int = 3) -> None:
        super().__init__()
        self.rows, self.history = rows, history
        self.filter = nn.Conv1d(rows, filters, min(taps, history))
        self.beside = nn.Linear(inputs - rows * history, filters)
        self.wide = filters * (history - min(taps, history) + 2)

    def forward(self, x: Tensor) -> Tensor:
        split = self.rows * self.history
        old = self.filter(x[..., :split].reshape(-1, self.rows, self.history))
        return torch.cat([old.flatten(1), self.beside(x[..., split:])], -1)


@torch.no_grad()
def weights_of(mlp: nn.Sequential) -> Weights:
    """(weight [out, in], bias [out]) of each linear map, float32: its answers to 0 and to unit vectors."""
    found, inputs = [], None
    for layer in mlp:
        if isinstance(layer, nn.Linear):
            found.append((layer.weight.detach(), layer.bias.detach()))
        elif isinstance(layer, _Twice | _InTime):
            units = torch.eye(inputs or _inputs(layer), device=next(layer.parameters()).device)
            bias = layer(torch.zeros_like(units[:1]))[0]
            found.append(((layer(units) - bias).T, bias))
        inputs = len(found[-1][1])
    return [(w.cpu().numpy().copy(), b.cpu().numpy().copy()) for w, b in found]


def _inputs(first: "_Twice | _InTime") -> int:
    if isinstance(first, _Twice):
        return first.own.in_features
    return first.rows * first.history + first.beside.in_features


def set_weights(mlp: nn.Sequential, weights: Weights) -> None:
    """Copy weights into the linear layers; of layers that treat left and right alike, one half of them."""
    layers = [layer for layer in mlp if isinstance(layer, nn.Linear | _Twice)]
    with torch.no_grad():
        for layer, (w, b) in zip(layers, weights, strict=True):
            own = layer.own if isinstance(layer, _Twice) else layer
            mean = isinstance(layer, _Twice) and layer.answered is not None
            rows, columns = own.weight.shape
            own.weight.copy_(torch.tensor(w[:rows, :columns]) * (2.0 if mean else 1.0))
            own.bias.copy_(torch.tensor(b[:rows]))


class Interface:
    """Observations [N, n] to the network's inputs [n, M], and its outputs [n, k] to commands [3, n]."""

    def __init__(
        self, task: str, history: int, prior: str = "", device: str = "cpu", change: float = 0.0
    ) -> None:
        self.inputs = features(task, history).numel_out(0)
        self.outputs = OUTPUTS[task]
        self._commands = Kernel(commands(task, history, prior, change))
        self._features = Kernel(features(task, history))
        low, high = zip(*(LIMITS[name] for name in ACTIONS), strict=True)
        self.low = torch.tensor(low, device=device)[:, None]
        self.high = torch.tensor(high, device=device)[:, None]

    def sizes(self, layers: Sequence[int]) -> list[int]:
        """Widths of a network with these hidden layers."""
        return [self.inputs, *layers, self.outputs]

    def features(self, observation: Tensor) -> Tensor:
        """[N, n] -> [n, M]."""
        return self._features(observation)[0].T

    def asked(self, y: Tensor, observation: Tensor) -> Tensor:
        """Commands [3, n] before they are limited."""
        return self._commands(y.T, observation)[0]

    def limited(self, asked: Tensor, leak: float = 0.0) -> Tensor:
        """Within the limits; with `leak` a share of the gradient passes at a limit."""
        return _Limited.apply(asked, self.low, self.high, leak)  # type: ignore[return-value]


class _Limited(torch.autograd.Function):
    """Commands within their limits, as one operation."""

    @staticmethod
    def forward(ctx: Any, asked: Tensor, low: Tensor, high: Tensor, leak: float) -> Tensor:  # type: ignore[override]
        within = torch.minimum(torch.maximum(asked, low), high)
        ctx.leak = leak
        ctx.save_for_backward(asked, within)
        return within

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Any, ...]:  # type: ignore[override]
        asked, within = ctx.saved_tensors
        return gradients[0] * ((asked == within) + ctx.leak), None, None, None
