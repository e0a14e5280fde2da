"""The policy network in torch, and the way from observations to commands around it."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn

from learning.policy.export import Weights
from learning.policy.features import OUTPUTS, commands, features
from learning.policy.kernel import Kernel
from specs.policy import ACTIONS, LIMITS

LEAK = 0.1  # of the gradient that passes a command at its limit


def perceptron(sizes: Sequence[int]) -> nn.Sequential:
    """Linear layers with tanh between them and a linear output (paper); the last layer starts near 0."""
    layers: list[nn.Module] = []
    for a, b in pairwise(sizes):
        layers += [nn.Linear(a, b), nn.Tanh()]
    last = layers[-2]
    with torch.no_grad():
        last.weight.mul_(0.1)  # type: ignore[operator]
        last.bias.zero_()  # type: ignore[operator]
    return nn.Sequential(*layers[:-1])


def weights_of(mlp: nn.Sequential) -> Weights:
    """(weight [out, in], bias [out]) of each linear layer, float32."""
    linear = [layer for layer in mlp if isinstance(layer, nn.Linear)]
    return [(la.weight.detach().cpu().numpy().copy(), la.bias.detach().cpu().numpy().copy()) for la in linear]


def set_weights(mlp: nn.Sequential, weights: Weights) -> None:
    """Copy weights into the linear layers."""
    linear = [layer for layer in mlp if isinstance(layer, nn.Linear)]
    with torch.no_grad():
        for layer, (w, b) in zip(linear, weights, strict=True):
            layer.weight.copy_(torch.tensor(w))
            layer.bias.copy_(torch.tensor(b))


class Interface:
    """Observations [N, n] to the network's inputs [n, M], and its outputs [n, k] to commands [3, n]."""

    def __init__(self, task: str, history: int, prior: str = "", device: str = "cpu") -> None:
        self.inputs = features(task, history).numel_out(0)
        self.outputs = OUTPUTS[task]
        self._commands = Kernel(commands(task, history, prior))
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
