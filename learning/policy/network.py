"""The policy network in torch, and the way from observations to commands around it."""

from collections.abc import Sequence
from itertools import pairwise

import casadi as ca
import numpy as np
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
        self._split(features(task, history), device)
        low, high = zip(*(LIMITS[name] for name in ACTIONS), strict=True)
        self.low = torch.tensor(low, device=device)[:, None]
        self.high = torch.tensor(high, device=device)[:, None]

    def sizes(self, layers: Sequence[int]) -> list[int]:
        """Widths of a network with these hidden layers."""
        return [self.inputs, *layers, self.outputs]

    def _split(self, f: ca.Function, device: str) -> None:
        """The inputs that are linear in the observation as one product, the others by their expressions."""
        x = ca.SX.sym("x", f.numel_in(0))
        y = f(x)
        bent = np.array(ca.which_depends(y, x, 2, True))
        straight = np.flatnonzero(~bent)
        slope = np.array(ca.DM(ca.jacobian(y[straight.tolist()], x)))
        at_zero = np.array(f(np.zeros(f.numel_in(0)))).ravel()[straight]
        self._slope = torch.tensor(slope, dtype=torch.float32, device=device)
        self._offset = torch.tensor(at_zero, dtype=torch.float32, device=device)[:, None]
        curved = y[np.flatnonzero(bent).tolist()]
        needed = [i for i in range(f.numel_in(0)) if ca.depends_on(curved, x[i])]
        self._needed = torch.tensor(needed, device=device)
        self._bent = Kernel(ca.Function("bent", [x[needed]], [ca.cse(curved)]))
        order = np.argsort(np.concatenate([straight, np.flatnonzero(bent)]))
        self._order = torch.tensor(order, device=device)

    def features(self, observation: Tensor) -> Tensor:
        """[N, n] -> [n, M]."""
        straight = torch.addmm(self._offset, self._slope, observation)
        (bent,) = self._bent(observation[self._needed])
        return torch.cat([straight, bent])[self._order].T

    def asked(self, y: Tensor, observation: Tensor) -> Tensor:
        """Commands [3, n] before they are limited."""
        return self._commands(y.T, observation)[0]

    def limited(self, asked: Tensor, leak: float = 0.0) -> Tensor:
        """Within the limits; with `leak` a share of the gradient passes at a limit."""
        within = torch.minimum(torch.maximum(asked, self.low), self.high)
        return within + leak * (asked - asked.detach()) if leak else within
