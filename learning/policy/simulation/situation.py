"""All that the training environment remembers between two steps, and how a gradient goes back through it."""

from dataclasses import dataclass, fields, replace
from typing import Any

import torch
from torch import Tensor

from learning.policy.simulation.plant import Machine, State

HIDDEN = 12  # of `hidden`


@dataclass
class Situation:
    """All that an environment remembers; tensors [rows, n] or [n]."""

    state: State
    machine: Machine
    sensors: Tensor  # [channels, history, n]: the observation's rows, the slew angle as the error
    rates: Tensor  # [LATE + 1, 2, n] of boom and stick, oldest first
    action: Tensor  # [3, n] last commands
    start: Tensor  # slew error when the target came
    target: Tensor  # [2, n] radius, height
    way: Tensor  # [3, periods, n] angle, radius, height of a target that moves; of one that stands one period
    things: Tensor  # [count, rows, n] beside its way (field.py), in the way's own frame; none: [0, 0, n]
    told: Tensor  # load told
    pace: Tensor
    bias: Tensor  # [7, n] of q_slew, q_boom, q_stick, roll, pitch, roll rate, pitch rate
    age: Tensor  # [n] periods since the target came (int64)

    def take(self, other: "Situation", where: Tensor) -> "Situation":
        """This one, but `other` where the mask [n] says so."""
        pairs = {k: (v, getattr(other, k)) for k, v in self.__dict__.items()}
        joined: dict[str, Any] = {
            k: a.take(b, where) if isinstance(a, State | Machine) else torch.where(where, b, a)
            for k, (a, b) in pairs.items()
        }
        return Situation(**joined)

    def cut(self) -> "Situation":
        """The same numbers, cut off from what they were computed from."""
        plain = {k: v.detach() for k, v in self.__dict__.items() if isinstance(v, Tensor)}
        return replace(self, state=self.state.copy(), **plain)

    def on(self, device: str) -> "Situation":
        """The same on a device of torch."""
        placed: dict[str, Any] = {k: _on(v, device) for k, v in self.__dict__.items()}
        return Situation(**placed)

    def faded(self, share: float, most: float = 0.0) -> "Situation":
        """The same; of the gradient that comes back through the state, `share` goes on.

        Of no machine more than `most` times the median over machines (0: without limit).
        """
        if share == 1.0 and not most:
            return self
        values = (*self.state.__dict__.values(), self.sensors, self.rates, self.action)
        found = iter(_Fade.apply(share, most, *values))  # type: ignore[arg-type]
        state = State(**{name: next(found) for name in self.state.__dict__})
        return replace(self, state=state, sensors=next(found), rates=next(found), action=next(found))


def hidden(s: Situation) -> Tensor:
    """What no sensor tells of the machine, about -1 … 1 [n, HIDDEN]: for critics and teachers alone."""
    m = s.machine
    return torch.stack([
        m.load / 2000.0, (m.named("tool_length_x") - 1.7) / 0.5, (m.dead_band - 0.13) / 0.04,
        (m.inertia_scale - 1.0) / 0.2, (m.gain - 1.05) / 0.2, (m.latency - 2.5) / 2.5,
        (m.boom_delay + m.stick_delay - 28.0) / 8.0, s.bias[3] / 0.02, s.bias[4] / 0.02,
        s.state.p_l[-1] / 1e7, s.state.p_r[-1] / 1e7, s.age / 100.0,
    ], dim=1)  # fmt: skip


def hidden_mirrored(seen: Tensor) -> Tensor:
    """`hidden` with left and right exchanged: the bias of roll turns, the pressures change places."""
    mirrored = seen[:, [0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 9, 11]]
    mirrored[:, 7] *= -1.0
    return mirrored


def _on(value: Tensor | State | Machine, device: str) -> Any:
    if isinstance(value, Tensor):
        return value.to(device)
    return type(value)(**{f.name: getattr(value, f.name).to(device) for f in fields(value)})


class _Fade(torch.autograd.Function):
    """Nothing forward; backward a share of the gradient, each machine's held to some medians of all."""

    @staticmethod
    def forward(ctx: Any, share: float, most: float, *values: Tensor) -> tuple[Tensor, ...]:  # type: ignore[override]
        ctx.share, ctx.most = share, most
        ctx.set_materialize_grads(False)
        return tuple(v.view_as(v) for v in values)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor | None) -> tuple[Any, ...]:  # type: ignore[override]
        scale: Any = ctx.share
        some = [g for g in gradients if g is not None]
        if ctx.most and some:
            size = sum(g.square().reshape(-1, g.shape[-1]).sum(0) for g in some).sqrt()  # type: ignore[union-attr]
            scale = ctx.share * (ctx.most * size.median() / size.clamp(min=1e-30)).clamp(max=1.0)
        return (None, None, *(g if g is None else g * scale for g in gradients))


@dataclass(frozen=True)
class Step:
    """A period of control: the situations around it, and the commands [3, n] before they were limited."""

    before: Situation
    after: Situation
    asked: Tensor
