"""The slew drive, batched in torch: its networks, and the histories that they are given.

Weights stay as they are, so that of all derivatives only those by the inputs are wanted: networks and
histories are operations with derivatives of their own.  Held to numpy's networks and to the FMUs by tests.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from fmus.models.slew_nn.network import CELL_AXES, TOLERANCE, Mlp, SlewNetwork


class Drive:
    """Slew networks on [41, n]: machines are shared out among them in equal, contiguous groups."""

    def __init__(self, networks: Sequence[SlewNetwork], device: str = "cpu", dtype: Any = torch.float32):
        for network in networks:
            network.check_whole()
        self.networks = tuple(networks)
        self.symmetric = networks[0].symmetric
        kind = {"device": device, "dtype": dtype}
        self.parts = {
            name: [_stack(nets, kind) for nets in zip(*(getattr(n, name) for n in networks), strict=True)]
            for name in ("pressure", "velocity")
        }
        self.maps = [_visited(n, device) for n in networks]

    def __call__(
        self, u: Tensor, p_l: Tensor, p_r: Tensor, omega: Tensor, inertia: Tensor
    ) -> tuple[Tensor, ...]:
        """Next p_l, p_r, omega [n]; u [10, n] up to now, the others [10, n] up to the last instant."""
        found = self._one_way(u, p_l, p_r, omega, inertia)
        if not self.symmetric:
            return found
        left, right, speed = self._one_way(-u, p_r, p_l, -omega, inertia)
        return (found[0] + right) / 2, (found[1] + left) / 2, (found[2] - speed) / 2

    def onward(
        self, past: Sequence[Tensor], joystick: Tensor, inertia: Tensor, ahead: int
    ) -> tuple[Tensor, ...]:
        """Histories u [9, n], p_l, p_r, omega [10, n] a period on, with the joystick [n] held from now on."""
        u, p_l, p_r, omega = past
        if len(self.networks) == 1 and not self.symmetric and len(self.parts["pressure"]) == 1:
            return _Onward.apply(self, ahead, *past, joystick, inertia)  # type: ignore[return-value]
        known = torch.cat([u[ahead:], joystick.expand(ahead + 1, -1)])
        new = self(known, p_l, p_r, omega, inertia)
        rows = zip(past, (joystick, *new), strict=True)
        return tuple(torch.cat([old[1:], row[None]]) for old, row in rows)

    def _one_way(
        self, u: Tensor, p_l: Tensor, p_r: Tensor, omega: Tensor, inertia: Tensor
    ) -> tuple[Tensor, ...]:
        seen = inertia[None]
        p = self._mean("pressure", torch.cat([u, p_l, p_r, omega, seen]), torch.stack([p_l[-1], p_r[-1]]))
        newer = [p_l[1:], p[:1], p_r[1:], p[1:]]
        w = self._mean("velocity", torch.cat([u, *newer, omega, seen]), omega[-1:])
        return p[0], p[1], w[0]

    def _mean(self, part: str, x: Tensor, last: Tensor) -> Tensor:
        """Mean over the members [outputs, n] for raw inputs x [41, n]."""
        groups = len(self.networks)
        y = x.view(len(x), groups, -1).transpose(0, 1)  # [groups, 41, n / groups]
        total = sum(_forward(member, y) for member in self.parts[part]) / len(self.parts[part])
        found = total.transpose(0, 1).reshape(last.shape)  # type: ignore[union-attr]
        residual = getattr(self.networks[0], part)[0].residual
        return found + last if residual else found

    def outside(self, inertia: Tensor, u: Tensor, omega: Tensor) -> Tensor:
        """Which of n states lie where the networks saw no data, bool [n] (SlewNetwork.outside)."""
        groups = [v.view(len(self.maps), -1) for v in (inertia, u, omega)]
        return torch.cat([_outside(m, *(g[i] for g in groups)) for i, m in enumerate(self.maps)])


class _Onward(torch.autograd.Function):
    """`Drive.onward` for one network of each kind, as one operation: half of what its parts cost.

    Rows of the networks' input: 0-9 joystick, 10-19 left and 20-29 right pressure, 30-39 speed, 40 inertia.
    """

    @staticmethod
    def forward(  # type: ignore[override]
        ctx: Any, drive: Drive, ahead: int, u: Tensor, p_l: Tensor, p_r: Tensor, omega: Tensor,
        joystick: Tensor, inertia: Tensor,
    ) -> tuple[Tensor, ...]:  # fmt: skip
        x = torch.cat([u[ahead:], joystick.expand(ahead + 1, -1), p_l, p_r, omega, inertia[None]])
        (pressure,), (velocity,) = drive.parts["pressure"], drive.parts["velocity"]
        keep = any(ctx.needs_input_grad)
        p, ctx.kept_p = _run(pressure, x, keep)
        adds = [getattr(drive.networks[0], part)[0].residual for part in ("pressure", "velocity")]
        if adds[0]:
            p[0] += p_l[-1]
            p[1] += p_r[-1]
        newer = torch.cat([x[:10], x[11:20], p[:1], x[21:30], p[1:], x[30:]])
        w, ctx.kept_w = _run(velocity, newer, keep)
        if adds[1]:
            w += omega[-1:]
        ctx.parts, ctx.adds, ctx.ahead = (pressure, velocity), adds, ahead
        speeds, levers = torch.cat([omega[1:], w]), torch.cat([u[1:], joystick[None]])
        return levers, newer[10:20], newer[20:30], speeds

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Any, ...]:  # type: ignore[override]
        levers, left, right, speeds = gradients
        later = _back(ctx.parts[1], ctx.kept_w, speeds[9:])
        later[10:20] += left
        later[20:30] += right
        p = torch.stack([later[19], later[29]])
        x = _back(ctx.parts[0], ctx.kept_p, p)
        x[:10] += later[:10]
        x[11:20] += later[10:19]
        x[21:30] += later[20:29]
        x[30:] += later[30:]
        if ctx.adds[0]:
            x[19] += p[0]
            x[29] += p[1]
        x[31:40] += speeds[:9]
        if ctx.adds[1]:
            x[39] += speeds[9]
        kept = len(levers) - ctx.ahead  # values of the joystick that the networks saw before the new one
        u = torch.zeros_like(levers)
        u[ctx.ahead :] = x[:kept]
        u[1:] += levers[:-1]
        joystick = x[kept:10].sum(0) + levers[-1]
        return None, None, u, x[10:20], x[20:30], x[30:40], joystick, x[40]


def _run(layers: Sequence[tuple[Tensor, Tensor]], x: Tensor, keep: bool) -> tuple[Tensor, list[Tensor]]:
    """(outputs, what lies between the layers if `keep`) of networks with relu, x [(groups,) inputs, n].

    What is not kept is free for the next layer: it is still in the cache then.
    """
    kept, y = [], x if x.dim() == 3 else x[None]
    for number, (w, b) in enumerate(layers):
        y = torch.baddbmm(b, w, y)
        if number + 1 < len(layers):
            y.relu_()
            if keep:
                kept.append(y)
    return y if x.dim() == 3 else y[0], kept


def _back(layers: Sequence[tuple[Tensor, Tensor]], kept: Sequence[Tensor], g: Tensor) -> Tensor:
    """Gradient by the inputs of `_run` for a gradient by its outputs."""
    y = g if g.dim() == 3 else g[None]
    for number in reversed(range(len(layers))):
        if number + 1 < len(layers):
            y = torch.ops.aten.threshold_backward(y, kept[number], 0)
        y = torch.bmm(layers[number][0].transpose(1, 2), y)
    return y if g.dim() == 3 else y[0]


def _stack(nets: Sequence[Mlp], kind: Mapping[str, Any]) -> list[tuple[Tensor, Tensor]]:
    """Layers of one member of each network, stacked, with scaling folded into the first and the last."""
    layers: list[list[tuple[np.ndarray, np.ndarray]]] = []
    for net in nets:
        w = [np.asarray(a, np.float64) for a in net.weights]
        b = [np.asarray(a, np.float64) for a in net.biases]
        b[0] = b[0] - w[0] @ (net.mean_in / net.std_in)
        w[0] = w[0] / net.std_in
        w[-1], b[-1] = net.std_out[:, None] * w[-1], net.std_out * b[-1] + net.mean_out
        layers.append(list(zip(w, b, strict=True)))
    rows = [[np.stack(values) for values in zip(*row, strict=True)] for row in zip(*layers, strict=True)]
    return [(torch.tensor(w, **kind), torch.tensor(b[..., None], **kind)) for w, b in rows]


def _forward(layers: Sequence[tuple[Tensor, Tensor]], x: Tensor) -> Tensor:
    """Layers with relu between them, [groups, inputs, n] -> [groups, outputs, n], as one operation."""
    return _Layers.apply(layers, x)  # type: ignore[return-value]


class _Layers(torch.autograd.Function):
    """Layers whose weights stay as they are: only the gradient by the inputs is wanted."""

    @staticmethod
    def forward(ctx: Any, layers: Sequence[tuple[Tensor, Tensor]], x: Tensor) -> Tensor:  # type: ignore[override]
        ctx.layers = layers
        y, ctx.kept = _run(layers, x, any(ctx.needs_input_grad))
        return y

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Any, ...]:  # type: ignore[override]
        return None, _back(ctx.layers, ctx.kept, gradients[0])


def _visited(network: SlewNetwork, device: str) -> dict[str, Any]:
    cells = None if network.visited is None else torch.tensor(network.visited.copy(), device=device)
    return {"cells": cells, "region": network.region}


def _outside(known: Mapping[str, Any], inertia: Tensor, u: Tensor, omega: Tensor) -> Tensor:
    index, beyond = [], torch.zeros_like(u, dtype=torch.bool)
    for (name, count), value in zip(CELL_AXES.items(), (inertia, u, omega), strict=True):
        if name not in known["region"]:
            continue
        low, high = known["region"][name]
        share = (value - low) / (high - low)
        beyond |= (share < -TOLERANCE) | (share > 1 + TOLERANCE)
        index.append((share * count).long().clamp(0, count - 1))
    return beyond if known["cells"] is None else beyond | ~known["cells"][tuple(index)]
