"""The policy network in torch, and the way from observations to commands around it."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn

from learning.policy.attention import EACH, EPSILON, HEADS, WIDTH
from learning.policy.export import Policy, Weights
from learning.policy.features import OUTPUTS, SCALES, SLEW_CHANNELS, commands, features, mirrored
from learning.policy.recipe import Recipe
from learning.policy.simulation.kernel import Kernel
from specs.ahead import NOTHING, Ahead
from specs.policy import ACTIONS, LIMITS

LEAK = 0.1  # of the gradient that passes a command at its limit


def perceptron(sizes: Sequence[int]) -> nn.Sequential:
    """Linear layers with tanh between them and a linear output (paper); the last layer starts near 0."""
    return _stacked([nn.Linear(a, b) for a, b in pairwise(sizes)])


def shaped(recipe: Recipe, way: "Interface", more: int = 0) -> nn.Sequential:
    """The recipe's network: the paper's, one that is dense layers once it is trained, or a transformer.

    `more` inputs after the interface's: the paper's network only.
    """
    sizes = way.sizes(recipe.layers)
    if recipe.network == "mirror":
        ends = ("inputs", "outputs")
        signs = [torch.tensor(mirrored(recipe.task, recipe.history, end, recipe.ahead)) for end in ends]
        layers = [_Twice(a, b) for a, b in pairwise(sizes)]
        layers[0].seen, layers[-1].answered = signs
        return _stacked(layers)
    rows = len(SCALES) if recipe.task == "full" else len(SLEW_CHANNELS)
    if recipe.network == "transformer":
        first = _Tokens(rows, recipe.history, sizes[0])
        return nn.Sequential(first, *_encoder(WIDTH, recipe.layers, sizes[-1]))
    if recipe.network == "convolution":
        first = _InTime(rows, recipe.history, sizes[0])
        return _stacked([first, *(nn.Linear(a, b) for a, b in pairwise([first.wide, *sizes[1:]]))])
    return perceptron([sizes[0] + more, *sizes[1:]])


def _stacked(layers: Sequence[nn.Module]) -> nn.Sequential:
    """Layers with tanh between them; the last one's weights start near 0."""
    parts = [part for layer in layers for part in (layer, nn.Tanh())]
    return nn.Sequential(*parts[:-2], _small(layers[-1]))


@torch.no_grad()
def _small(last: nn.Module) -> nn.Module:
    for name, weight in last.named_parameters():
        weight.mul_(0.1 if name.endswith("weight") else 0.0)
    return last


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


class _Tokens(nn.Module):
    """A token for each instant, oldest first, and one for what has no history: [n, history + 1, WIDTH]."""

    def __init__(self, rows: int, history: int, inputs: int) -> None:
        super().__init__()
        self.rows, self.history = rows, history
        self.instant = nn.Linear(rows, WIDTH)
        self.place = nn.Parameter(torch.zeros(history, WIDTH))
        self.beside = nn.Linear(inputs - rows * history, WIDTH)

    def forward(self, x: Tensor) -> Tensor:
        split = self.rows * self.history
        old = x[..., :split].reshape(-1, self.rows, self.history).transpose(1, 2)
        return torch.cat([self.instant(old) + self.place, self.beside(x[..., split:])[:, None]], 1)


class _Attention(nn.Module):
    """One encoder layer, norms first and without weights (attention.py): [n, tokens, width] to the same.

    `newest`: of the last layer, of which the last token alone is read; the others are not computed.
    """

    def __init__(self, width: int, hidden: int, newest: bool) -> None:
        super().__init__()
        self.newest = newest
        self.seen, self.mixed = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.up, self.down = nn.Linear(width, hidden), nn.Linear(hidden, width)

    def forward(self, x: Tensor) -> Tensor:
        q, k, v = self.seen(_normed(x)).unflatten(-1, (3, HEADS, -1)).permute(2, 0, 3, 1, 4)
        if self.newest:
            x, q = x[:, -1:], q[:, :, -1:]
        found = nn.functional.scaled_dot_product_attention(q, k, v)  # [n, heads, tokens, size]
        x = x + self.mixed(found.transpose(1, 2).flatten(2))
        return x + self.down(torch.tanh(self.up(_normed(x))))


class _Last(nn.Module):
    """The last token, normed."""

    def forward(self, x: Tensor) -> Tensor:
        return _normed(x[:, -1])


def _normed(x: Tensor) -> Tensor:
    return nn.functional.layer_norm(x, x.shape[-1:], eps=EPSILON)


def _encoder(width: int, hidden: Sequence[int], outputs: int) -> list[nn.Module]:
    """What follows the tokens."""
    layers = [_Attention(width, h, newest=k + 1 == len(hidden)) for k, h in enumerate(hidden)]
    return [*layers, _Last(), _small(nn.Linear(width, outputs))]


@torch.no_grad()
def weights_of(mlp: nn.Sequential) -> Weights:
    """(weight [out, in], bias [out]) of each linear map, float32: its answers to 0 and to unit vectors."""
    found, inputs = [], None
    for layer in mlp:
        if isinstance(layer, nn.Linear):
            found.append((layer.weight.detach(), layer.bias.detach()))
        elif isinstance(layer, _Attention):
            found += [(own.weight, own.bias) for own in (layer.seen, layer.mixed, layer.up, layer.down)]
        elif isinstance(layer, _Twice | _InTime | _Tokens):
            units = torch.eye(inputs or _inputs(layer), device=next(layer.parameters()).device)
            bias = layer(torch.zeros_like(units[:1])).flatten()
            found.append(((layer(units).flatten(1) - bias).T, bias))
        inputs = len(found[-1][1])
    return [(w.cpu().numpy().copy(), b.cpu().numpy().copy()) for w, b in found]


def _inputs(first: "_Twice | _InTime | _Tokens") -> int:
    if isinstance(first, _Twice):
        return first.own.in_features
    return first.rows * first.history + first.beside.in_features


def set_weights(mlp: nn.Sequential, weights: Weights) -> None:
    """Copy weights into the linear layers; of layers that treat left and right alike, one half of them."""
    inside = [
        own for layer in mlp for own in (layer.children() if isinstance(layer, _Attention) else [layer])
    ]
    layers = [layer for layer in inside if isinstance(layer, nn.Linear | _Twice)]
    with torch.no_grad():
        for layer, (w, b) in zip(layers, weights, strict=True):
            own = layer.own if isinstance(layer, _Twice) else layer
            mean = isinstance(layer, _Twice) and layer.answered is not None
            rows, columns = own.weight.shape
            own.weight.copy_(torch.tensor(w[:rows, :columns]) * (2.0 if mean else 1.0))
            own.bias.copy_(torch.tensor(b[:rows]))


def opened(policy: Policy) -> nn.Sequential:
    """An exported policy's network in torch, of what it was exported as."""
    weights = policy.weights
    mlp = perceptron([weights[0][0].shape[1], *(len(b) for _, b in weights)])
    if policy.contract.network:
        (wide, inputs), width = weights[0][0].shape, weights[-1][0].shape[1]
        hidden = [len(b) for _, b in weights[3:-1:EACH]]
        tokens = nn.Unflatten(1, (wide // width, width))
        mlp = nn.Sequential(nn.Linear(inputs, wide), tokens, *_encoder(width, hidden, len(weights[-1][1])))
    set_weights(mlp, weights)
    return mlp


class Interface:
    """Observations [N, n] to the network's inputs [n, M], and its outputs [n, k] to commands [3, n]."""

    def __init__(
        self,
        task: str,
        history: int,
        prior: str = "",
        device: str = "cpu",
        change: float = 0.0,
        ahead: Ahead = NOTHING,
    ) -> None:
        self.inputs = features(task, history, ahead).numel_out(0)
        self.outputs = OUTPUTS[task]
        self._commands = Kernel(commands(task, history, prior, change, ahead))
        self._features = Kernel(features(task, history, ahead))
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
