"""The slew networks in PyTorch, all with one interface, and their way into plain weights.

A batch is normalised histories: u, p_l, p_r, omega [n, 10] and inertia [n, 1]; `Pair.step` gives the next
p_l, p_r, omega, each [n, 1].  Every network maps [n, channels, 10] and inertia to changes (or values) in
units of what one step changes, so that all outputs weigh alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

from fmus.models.slew_nn.network import HISTORY, Mlp, SlewNetwork
from learning.slew.recipe import Recipe
from learning.slew.trajectory import Windows

WIDTHS = {"pressure": (128, 128, 128, 128, 32), "velocity": (128, 128, 128, 32)}  # the paper's
NAMES = ("u", "p_l", "p_r", "omega", "inertia")
State = tuple[Tensor, Tensor, Tensor]  # p_l, p_r, omega


@dataclass(frozen=True)
class Scales:
    """Mean and deviation of each quantity; how far a step changes pressures and speed, in deviations."""

    mean: dict[str, float]
    std: dict[str, float]
    step: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, data: Windows) -> "Scales":
        """Scales that a mirror image has as well: joystick and speed about 0, both chambers alike."""
        p = np.concatenate([data.p_l.ravel(), data.p_r.ravel()])
        mean = {"u": 0.0, "p_l": float(p.mean()), "omega": 0.0, "inertia": float(data.inertia.mean())}
        std = {
            "u": _spread(data.u, 0.0),
            "p_l": _spread(p, mean["p_l"]),
            "omega": _spread(data.omega, 0.0),
            "inertia": _spread(data.inertia, mean["inertia"]),
        }
        steps = {"p_l": np.diff(data.p_l), "omega": np.diff(data.omega)}
        step = {name: _spread(change, 0.0) / std[name] for name, change in steps.items()}
        for group in (mean, std, step):
            group["p_r"] = group["p_l"]
        return cls(mean, std, step)

    def normalised(self, name: str, values: np.ndarray) -> Tensor:
        """Values in deviations from the mean, float32."""
        return torch.from_numpy(((values - self.mean[name]) / self.std[name]).astype(np.float32))


def _spread(values: np.ndarray, about: float) -> float:
    return float(np.sqrt(np.mean((values - about) ** 2))) or 1.0


class Flat(nn.Module):
    """The paper's multilayer perceptron over the flattened history."""

    def __init__(self, channels: int, outputs: int, widths: tuple[int, ...], inertia: bool) -> None:
        super().__init__()
        sizes = (channels * HISTORY + inertia, *widths, outputs)
        layers = [layer for a, b in pairwise(sizes) for layer in (nn.Linear(a, b), nn.ReLU())]
        self.layers = nn.Sequential(*layers[:-1])

    def forward(self, history: Tensor, inertia: Tensor) -> Tensor:
        """[n, channels, 10], [n, 0 or 1] -> [n, outputs]."""
        return self.layers(torch.cat([history.flatten(1), inertia], dim=1))


class Convolutions(nn.Module):
    """Three causal, dilated convolutions; the last instant's features and the inertia give the outputs."""

    def __init__(self, channels: int, outputs: int, inertia: bool, width: int = 48) -> None:
        super().__init__()
        sizes = [channels + inertia, width, width, width]
        self.convolutions = nn.ModuleList(
            nn.Conv1d(a, b, 3, dilation=2**i) for i, (a, b) in enumerate(pairwise(sizes))
        )
        self.head = nn.Sequential(nn.Linear(width, 64), nn.ReLU(), nn.Linear(64, outputs))

    def forward(self, history: Tensor, inertia: Tensor) -> Tensor:
        """[n, channels, 10], [n, 0 or 1] -> [n, outputs]."""
        x = torch.cat([history, inertia[:, :, None].expand(-1, -1, HISTORY)], dim=1)
        for i, convolution in enumerate(self.convolutions):
            x = torch.relu(convolution(nn.functional.pad(x, (2 * 2**i, 0))))
        return self.head(x[:, :, -1])


class Attention(nn.Module):
    """A small transformer encoder over the ten instants."""

    def __init__(self, channels: int, outputs: int, inertia: bool, width: int = 32) -> None:
        super().__init__()
        self.embed = nn.Linear(channels + inertia, width)
        self.place = nn.Parameter(torch.zeros(HISTORY, width))
        layer = nn.TransformerEncoderLayer(width, 4, 2 * width, 0.0, batch_first=True, norm_first=True)
        self.encoder = nn.TransformerEncoder(layer, 2, enable_nested_tensor=False)
        self.head = nn.Linear(width, outputs)

    def forward(self, history: Tensor, inertia: Tensor) -> Tensor:
        """[n, channels, 10], [n, 0 or 1] -> [n, outputs]."""
        x = torch.cat([history, inertia[:, :, None].expand(-1, -1, HISTORY)], dim=1).transpose(1, 2)
        return self.head(self.encoder(self.embed(x) + self.place)[:, -1])


class Pair(nn.Module):
    """Pressure network and velocity network (or the latter alone), stepped together."""

    def __init__(self, recipe: Recipe, scales: Scales) -> None:
        super().__init__()
        self.recipe, self.scales = recipe, scales
        self.pressure = _make(recipe, "pressure", 4, 2) if recipe.pressure else None
        self.velocity = _make(recipe, "velocity", 4 if recipe.pressure else 2, 1)

    def step(self, u: Tensor, past: Sequence[Tensor], inertia: Tensor, detach: bool = False) -> State:
        """Next (p_l, p_r, omega) after `past`; `detach`: the speed's error does not train the pressures."""
        found = self._one_way(u, past, inertia, detach)
        if not self.recipe.symmetric:
            return found
        # The mirror image of a pressure below its mean is one below the mean: both chambers share it.
        p_l, p_r, omega = past
        left, right, speed = self._one_way(-u, (p_r, p_l, -omega), inertia, detach)
        return (found[0] + right) / 2, (found[1] + left) / 2, (found[2] - speed) / 2

    def _one_way(self, u: Tensor, past: Sequence[Tensor], inertia: Tensor, detach: bool) -> State:
        p_l, p_r, omega = past
        inertia = inertia if self.recipe.inertia else inertia[:, :0]
        left, right, history = p_l[:, -1:], p_r[:, -1:], [u, omega]
        if self.pressure is not None:
            p = self._output("p_l") * self.pressure(torch.stack([u, *past], dim=1), inertia)
            left, right = self._last(left) + p[:, :1], self._last(right) + p[:, 1:]
            now = (left.detach(), right.detach()) if detach else (left, right)
            newer = [torch.cat([a[:, 1:], b], dim=1) for a, b in zip((p_l, p_r), now, strict=True)]
            history = [u, *newer, omega]
        change = self._output("omega") * self.velocity(torch.stack(history, dim=1), inertia)
        return left, right, self._last(omega[:, -1:]) + change

    def _output(self, name: str) -> float:
        return self.scales.step[name] if self.recipe.residual else 1.0

    def _last(self, value: Tensor) -> Tensor:
        return value if self.recipe.residual else torch.zeros_like(value)


def _make(recipe: Recipe, part: str, channels: int, outputs: int) -> nn.Module:
    if recipe.architecture == "tcn":
        return Convolutions(channels, outputs, recipe.inertia)
    if recipe.architecture == "transformer":
        return Attention(channels, outputs, recipe.inertia)
    return Flat(channels, outputs, WIDTHS[part], recipe.inertia)


def plain(pair: Pair) -> SlewNetwork:
    """The pair as plain weights; its recipe must be `recipe.exportable`."""
    pressure = (_plain(pair, "pressure"),) if pair.pressure is not None else ()
    return SlewNetwork(pressure, (_plain(pair, "velocity"),), pair.recipe.symmetric)


def _plain(pair: Pair, part: str) -> Mlp:
    scales, residual = pair.scales, pair.recipe.residual
    histories = NAMES[:4] if pair.recipe.pressure else ("u", "omega")
    order = [name for name in histories for _ in range(HISTORY)] + ["inertia"] * pair.recipe.inertia
    outputs = ["p_l", "p_r"] if part == "pressure" else ["omega"]
    linear = [layer for layer in getattr(pair, part).layers if isinstance(layer, nn.Linear)]
    return Mlp(
        tuple(layer.weight.detach().numpy().copy() for layer in linear),
        tuple(layer.bias.detach().numpy().copy() for layer in linear),
        np.array([scales.mean[n] for n in order]),
        np.array([scales.std[n] for n in order]),
        np.array([0.0 if residual else scales.mean[n] for n in outputs]),
        np.array([scales.std[n] * (scales.step[n] if residual else 1.0) for n in outputs]),
        residual,
    )
