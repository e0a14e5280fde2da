"""Numbers that are none any more: where they are, and which of them came first.

One NaN makes all others in a few steps, so that the last of them to be seen says little about the cause.
Looked for where a training fails, and before anything is kept.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from typing import Any

import torch
from torch import Tensor, nn

from learning.policy.simulation.plant import State
from learning.policy.simulation.situation import Step

SHOWN = 3  # names in a message


def infinite(value: Any, name: str = "") -> list[str]:
    """Names of the tensors and numbers in nested mappings, lists and situations that are not finite."""
    if isinstance(value, Tensor):
        return [] if bool(torch.isfinite(value).all()) else [name]
    if isinstance(value, float):
        return [] if value - value == 0.0 else [name]
    if is_dataclass(value):
        value = value.__dict__
    if isinstance(value, list | tuple):
        value = dict(enumerate(value))
    if not isinstance(value, Mapping):
        return []
    return [found for k, v in value.items() for found in infinite(v, f"{name}.{k}" if name else str(k))]


def shown(names: Sequence[str]) -> str:
    """Some of them, and how many there are."""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def weights(networks: Mapping[str, nn.Module]) -> list[str]:
    """Names of the parameters that are not finite."""
    return [f"{n}.{k}" for n, net in networks.items() for k in infinite(dict(net.named_parameters()))]


def cause(steps: "Iterable[Step]", sources: Sequence[str]) -> str:
    """What came first in these steps, the answer or the simulation's state; "" if both stayed finite.

    `sources`: the slew networks, each of which drives an equal share of the machines.
    """
    for step in steps:
        if wrong := infinite(step.before.state):
            return _state(step.before.state, wrong, sources)
        if infinite(step.asked):
            return "the policy's answer"
        if wrong := infinite(step.after.state):
            return _state(step.after.state, wrong, sources)
    return ""


def _state(state: State, wrong: Sequence[str], sources: Sequence[str]) -> str:
    bad = torch.zeros(state.q.shape, dtype=torch.bool, device=state.q.device)
    for value in state.__dict__.values():
        bad |= ~torch.isfinite(value).reshape(-1, len(bad)).all(0)
    groups = bad.view(len(sources), -1).any(1).tolist()
    driven = [name for name, some in zip(sources, groups, strict=True) if some]
    return (
        f"the simulation's state ({', '.join(wrong)}) of machines with the slew network {', '.join(driven)}"
    )
