"""The slew drive, batched in torch: its networks, and the histories that they are given.

Weights stay as they are, so that of all derivatives only those by the inputs are wanted: networks and
histories are operations with derivatives of their own.  Held to numpy's networks and to the FMUs by tests.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
import torch
from torch import Tensor

from fmus.models.slew_nn.network import CELL_AXES, PARTS, TOLERANCE, Mlp, SlewNetwork


class Drive:
    """Slew networks on [41, n]: machines are shared out among them in equal, contiguous shares.

    Networks of any sizes; neighbours of the same ones are computed together.  `ahead`: by how many periods
    each network runs ahead of the clock (plant.py).
    """

    def __init__(
        self,
        networks: Sequence[SlewNetwork],
        device: str = "cpu",
        dtype: Any = torch.float32,
        ahead: Sequence[int] = (),
    ):
        for network in networks:
            network.check_whole()
        self.networks = tuple(networks)
        self.ahead = tuple(ahead) or (0,) * len(networks)
        alike = [tuple(found) for _, found in groupby(networks, _shape)]
        self.groups = [_Group(found, device, dtype) for found in alike]
        self.maps = [_visited(n, device) for n in networks]

    def __call__(
        self, u: Tensor, p_l: Tensor, p_r: Tensor, omega: Tensor, inertia: Tensor
    ) -> tuple[Tensor, ...]:
        """Next p_l, p_r, omega [n]; u [10, n] up to now, the others [10, n] up to the last instant."""
        return self._of_groups(lambda group, *own: group(*own), u, p_l, p_r, omega, inertia)

    def onward(self, past: Sequence[Tensor], joystick: Tensor, inertia: Tensor) -> tuple[Tensor, ...]:
        """Histories u [9, n], p_l, p_r, omega [10, n] a period on, with the joystick [n] held from now on."""
        u, p_l, p_r, omega = past
        known = self._known(u, joystick)
        p_l, p_r, omega = self._of_groups(_Group.onward, known, p_l, p_r, omega, inertia)
        return torch.cat([u[1:], joystick[None]]), p_l, p_r, omega

    def _known(self, u: Tensor, joystick: Tensor) -> Tensor:
        """The joystick [10, n] as each network sees it: one that runs ahead, the newest held from now on."""
        share = len(joystick) // len(self.ahead)
        parts, start = [], 0
        for ahead, alike in groupby(self.ahead):
            end = start + share * len(list(alike))
            held = joystick[start:end].expand(ahead + 1, -1)
            parts.append(torch.cat([u[ahead:, start:end], held]))
            start = end
        return parts[0] if len(parts) == 1 else torch.cat(parts, dim=1)

    def _of_groups(self, f: Callable[..., tuple[Tensor, ...]], *inputs: Tensor) -> tuple[Tensor, ...]:
        """What f makes of each group and its columns of the inputs, side by side."""
        if len(self.groups) == 1:
            return f(self.groups[0], *inputs)
        share = inputs[0].shape[-1] // len(self.networks)
        sizes = [share * group.count for group in self.groups]
        columns = zip(*(x.split(sizes, dim=-1) for x in inputs), strict=True)
        found = [f(group, *own) for group, own in zip(self.groups, columns, strict=True)]
        return tuple(torch.cat(rows, dim=-1) for rows in zip(*found, strict=True))

    def outside(self, inertia: Tensor, u: Tensor, omega: Tensor) -> Tensor:
        """Which of n states lie where the networks saw no data, bool [n] (SlewNetwork.outside)."""
        groups = [v.view(len(self.maps), -1) for v in (inertia, u, omega)]
        return torch.cat([_outside(m, *(g[i] for g in groups)) for i, m in enumerate(self.maps)])


def _shape(network: SlewNetwork) -> tuple[Any, ...]:
    """What networks that are computed together have in common."""
    return network.symmetric, *((net.sizes, net.residual) for part in PARTS for net in getattr(network, part))


class _Group:
    """Networks of the same sizes, each for an equal share of the columns."""

    def __init__(self, networks: Sequence[SlewNetwork], device: str, dtype: Any) -> None:
        self.count, self.symmetric = len(networks), networks[0].symmetric
        kind = {"device": device, "dtype": dtype}
        self.parts = {
            name: [_stack(nets, kind) for nets in zip(*(getattr(n, name) for n in networks), strict=True)]
            for name in PARTS
        }
        self.adds = [getattr(networks[0], part)[0].residual for part in PARTS]
        self.plain = not self.symmetric and all(len(members) == 1 for members in self.parts.values())

    def __call__(
        self, u: Tensor, p_l: Tensor, p_r: Tensor, omega: Tensor, inertia: Tensor
    ) -> tuple[Tensor, ...]:
        """As `Drive`'s."""
        found = self._one_way(u, p_l, p_r, omega, inertia)
        if not self.symmetric:
            return found
        left, right, speed = self._one_way(-u, p_r, p_l, -omega, inertia)
        return (found[0] + right) / 2, (found[1] + left) / 2, (found[2] - speed) / 2

    def onward(
        self, u: Tensor, p_l: Tensor, p_r: Tensor, omega: Tensor, inertia: Tensor
    ) -> tuple[Tensor, ...]:
        """Histories p_l, p_r, omega [10, n] a period on."""
        if self.plain:
            return _Onward.apply(self, u, p_l, p_r, omega, inertia)  # type: ignore[return-value]
        new = self(u, p_l, p_r, omega, inertia)
        return tuple(torch.cat([old[1:], row[None]]) for old, row in zip((p_l, p_r, omega), new, strict=True))

    def _one_way(
        self, u: Tensor, p_l: Tensor, p_r: Tensor, omega: Tensor, inertia: Tensor
    ) -> tuple[Tensor, ...]:
        seen = inertia[None]
        p = self._mean(0, torch.cat([u, p_l, p_r, omega, seen]), torch.stack([p_l[-1], p_r[-1]]))
        newer = [p_l[1:], p[:1], p_r[1:], p[1:]]
        w = self._mean(1, torch.cat([u, *newer, omega, seen]), omega[-1:])
        return p[0], p[1], w[0]

    def _mean(self, part: int, x: Tensor, last: Tensor) -> Tensor:
        """Mean over the members [outputs, n] of PARTS[part] for raw inputs x [41, n]."""
        members = self.parts[PARTS[part]]
        y = _shared(x, self.count)
        found = _joined(sum(_forward(member, y) for member in members) / len(members))  # type: ignore[arg-type]
        return found + last if self.adds[part] else found


def _shared(x: Tensor, count: int) -> Tensor:
    """[rows, n] -> [count, rows, n / count]."""
    return x.view(len(x), count, -1).transpose(0, 1)


def _joined(y: Tensor) -> Tensor:
    """[count, rows, n / count] -> [rows, n]."""
    return y.transpose(0, 1).reshape(y.shape[1], -1)


class _Onward(torch.autograd.Function):
    """`_Group.onward` for one network of each kind, as one operation: half of what its parts cost.

    Rows of the networks' input: 0-9 joystick, 10-19 left and 20-29 right pressure, 30-39 speed, 40 inertia.
    """

    @staticmethod
    def forward(  # type: ignore[override]
        ctx: Any, group: _Group, u: Tensor, p_l: Tensor, p_r: Tensor, omega: Tensor, inertia: Tensor
    ) -> tuple[Tensor, ...]:
        x = torch.cat([u, p_l, p_r, omega, inertia[None]])
        pressure, velocity = (group.parts[part][0] for part in PARTS)
        keep = any(ctx.needs_input_grad)
        y, ctx.kept_p = _run(pressure, _shared(x, group.count), keep)
        p = _joined(y)
        if group.adds[0]:
            p = p + torch.stack([p_l[-1], p_r[-1]])
        newer = torch.cat([x[:10], x[11:20], p[:1], x[21:30], p[1:], x[30:]])
        y, ctx.kept_w = _run(velocity, _shared(newer, group.count), keep)
        w = _joined(y)
        if group.adds[1]:
            w = w + omega[-1:]
        ctx.parts, ctx.adds, ctx.count = (pressure, velocity), group.adds, group.count
        return newer[10:20], newer[20:30], torch.cat([omega[1:], w])

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Any, ...]:  # type: ignore[override]
        left, right, speeds = gradients
        later = _joined(_back(ctx.parts[1], ctx.kept_w, _shared(speeds[9:], ctx.count)))
        later[10:20] += left
        later[20:30] += right
        p = torch.stack([later[19], later[29]])
        x = _joined(_back(ctx.parts[0], ctx.kept_p, _shared(p, ctx.count)))
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
        return None, x[:10], x[10:20], x[20:30], x[30:40], x[40]


def _run(layers: Sequence[tuple[Tensor, Tensor]], x: Tensor, keep: bool) -> tuple[Tensor, list[Tensor]]:
    """(outputs, what lies between the layers if `keep`) of networks with relu, x [groups, inputs, n].

    What is not kept is free for the next layer: it is still in the cache then.
    """
    kept, y = [], x
    for number, (w, b) in enumerate(layers):
        y = torch.baddbmm(b, w, y)
        if number + 1 < len(layers):
            y.relu_()
            if keep:
                kept.append(y)
    return y, kept


def _back(layers: Sequence[tuple[Tensor, Tensor]], kept: Sequence[Tensor], g: Tensor) -> Tensor:
    """Gradient by the inputs of `_run` for a gradient by its outputs."""
    y = g
    for number in reversed(range(len(layers))):
        if number + 1 < len(layers):
            y = torch.ops.aten.threshold_backward(y, kept[number], 0)
        y = torch.bmm(layers[number][0].transpose(1, 2), y)
    return y


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
