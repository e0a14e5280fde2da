"""The paper's seven reward terms, each a function of what happened in a step of 0.1 s; and seven of our own.

e: grab point less target [3, n] in m (full), or the slew error times ARC [1, n] (slew-only); all else as
named. Each term is what the paper writes, without its weight; a recipe weighs them, and leaves one out by a
weight of 0.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

ARC = 10.0  # m: how far from the axis the slew-only task counts its error, so that both tasks have one scale
MARGIN_M = 0.6  # above the keep-out height
NEAR_M, STILL = 0.5, 0.02  # paper: where one-shot begins; m and rad/s
STILL_TOOL = 0.005  # rad/s: below it the tool counts as still, so that the root has a slope
KEEP_M = 0.5  # to things: a plan's clearance of 0.3 m and some of the room that it leaves for the swing
ACTION_SCALE = (1.0, 0.2, 0.2)  # sigma_u: joystick, rad/s, rad/s


@dataclass(frozen=True)
class Shape:
    """Widths of the terms, which the curriculum moves."""

    balance_m: float = 1.0  # paper: 1
    target_m: float = 1.0
    overshoot_rad: float = 1.0
    settle_rad: float = 1.0


@dataclass(frozen=True)
class Instant:
    """What a reward depends on, tensors [n] unless said."""

    error: Tensor  # [3, n] or [1, n], m
    action: Tensor  # [actions, n], over ACTION_SCALE
    before: Tensor  # [actions, n], the action before it
    slew: Tensor  # slew error now, rad
    start: Tensor  # slew error when the target came, rad
    slew_rate: Tensor
    boom_rate: Tensor
    stick_rate: Tensor
    roll_rate: Tensor
    pitch_rate: Tensor
    roll: Tensor
    pitch: Tensor
    low: Tensor  # m, of the grab below the keep-out height and MARGIN_M above it; 0 above
    beyond: Tensor  # of the network's answer past the limits, squared, over ACTION_SCALE
    near: Tensor | None = None  # [parts, n] m, from specs.ahead.PARTS to what is nearest; None without things


def balance(i: Instant, s: Shape) -> Tensor:
    """exp(-|e|_1) - 1."""
    return torch.exp(-i.error.abs().sum(0) / s.balance_m) - 1.0


def target(i: Instant, s: Shape) -> Tensor:
    """exp(-|e|_2^2)."""
    return torch.exp(-i.error.square().sum(0) / s.target_m**2)


def action(i: Instant, s: Shape) -> Tensor:
    """-|du / sigma|_2^2."""
    return -(i.action - i.before).square().sum(0)


def overshoot(i: Instant, s: Shape) -> Tensor:
    """exp(-|q_ovs|) - 1; q_ovs: how far the slew is past the target."""
    past = torch.where(i.start < 0, i.slew.clamp(min=0.0), i.slew.clamp(max=0.0))
    return torch.exp(-past.abs() / s.overshoot_rad) - 1.0


def oscillation(i: Instant, s: Shape) -> Tensor:
    """-|tool rates|_1."""
    return -(i.roll_rate.abs() + i.pitch_rate.abs())


def decouple(i: Instant, s: Shape) -> Tensor:
    """-|slew rate| (|boom rate| + |stick rate|)."""
    return -i.slew_rate.abs() * (i.boom_rate.abs() + i.stick_rate.abs())


def one_shot(i: Instant, s: Shape) -> Tensor:
    """-|u / sigma|_2^2 once near the target and still."""
    there = (i.error.detach().norm(dim=0) < NEAR_M) & (i.slew_rate.detach().abs() < STILL)
    return -i.action.square().sum(0) * there


def closing(i: Instant, s: Shape) -> Tensor:
    """Ours: -|e|_1 / 10 m, which also tells the way from far off, where `balance` is flat."""
    return -i.error.abs().sum(0) / 10.0


def swing(i: Instant, s: Shape) -> Tensor:
    """Ours: -(energy of the swing): squared rates, and squared angles as a pendulum of 2 m weighs them."""
    return -(i.roll_rate.square() + i.pitch_rate.square() + 4.9 * (i.roll.square() + i.pitch.square()))


def settle(i: Instant, s: Shape) -> Tensor:
    """Ours: -q^2 / (q^2 + width^2) of the slew error: nearly -1 until the slew has arrived, then 0."""
    return -i.slew.square() / (i.slew.square() + s.settle_rad**2)


def sway(i: Instant, s: Shape) -> Tensor:
    """Ours: -|tool rates|_2, as the metric counts the tool's rate."""
    return -(i.roll_rate.square() + i.pitch_rate.square() + STILL_TOOL**2).sqrt()


def keep_out(i: Instant, s: Shape) -> Tensor:
    """Ours: -(depth within MARGIN_M of the keep-out height), a slope where a termination is a cliff."""
    return -i.low


def limits(i: Instant, s: Shape) -> Tensor:
    """Ours: -(what is asked for beyond the limits)^2."""
    return -i.beyond


def clearance(i: Instant, s: Shape) -> Tensor:
    """Ours: -(share of KEEP_M that a part is nearer than that to a thing)^2, summed over parts.

    From a contact on it grows with the depth alone, so that few machines deep in a thing do not rule.
    """
    if i.near is None:
        return torch.zeros_like(i.slew)
    share = ((KEEP_M - i.near) / KEEP_M).clamp(min=0.0)
    return -torch.where(share < 1.0, share.square(), 2.0 * share - 1.0).sum(0)


TERMS: Mapping[str, Callable[[Instant, Shape], Tensor]] = {
    f.__name__: f
    for f in (
        balance,
        target,
        action,
        overshoot,
        oscillation,
        decouple,
        one_shot,
        closing,
        swing,
        settle,
        sway,
        keep_out,
        limits,
        clearance,
    )
}
PAPER = ("balance", "target", "action", "overshoot", "oscillation", "decouple", "one_shot")
SLEW_ONLY = ("balance", "target", "action", "overshoot", "one_shot")  # of the paper's slew-only policy


def weigh(i: Instant, s: Shape, weights: Mapping[str, float | Tensor]) -> dict[str, Tensor]:
    """Every term with a weight, weighed, by name."""
    return {name: weights[name] * TERMS[name](i, s) for name in TERMS if _used(weights.get(name, 0.0))}


def _used(weight: float | Tensor) -> bool:
    return isinstance(weight, Tensor) or weight != 0.0
