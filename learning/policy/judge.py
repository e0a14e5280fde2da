"""The four metrics of a policy in the training environment: cheap, to compare trainings; no result.

Every machine gets one target for 15 s, as the scenarios do; the metrics are those of records/metrics.py, at
the 10 Hz of the environment: the slew angle between targets over the time to enter and stay within 3
degrees, the angle past the target, the mean error of the last second, the mean rate of the tool.

    python -m learning.policy.judge POLICY [--machines 256] [--pace 1]
"""

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from fmus.models.slew_nn.network import SlewNetwork
from learning.policy.export import Policy, read
from learning.policy.network import Interface, opened
from learning.policy.recipe import RECIPES, Randomisation, Recipe
from learning.policy.session import NETWORKS
from learning.policy.simulation.environment import Environment, load_networks
from records.metrics import BAND_DEG, LAST_S
from specs.policy import SPACING_S, check_signals

DURATION_S = 15.0
REST_S = 5.0  # of the end, in which a machine should rest
TRAVEL = (math.radians(45), math.radians(135))  # of the scenarios
LOADS = {
    "empty": (0.0, 0.0, 1.0),
    "2t": (2000.0, 2000.0, 1.0),
    "unknown": (0.0, 2000.0, 0.0),
}  # told: the last


def judge(
    recipe: Recipe,
    networks: Sequence[SlewNetwork],
    mlp: nn.Module,
    pace: float = 1.0,
    n: int = 256,
    seed: int = 99,
    loads: Sequence[str] = tuple(LOADS),
) -> dict[str, dict[str, float]]:
    """Metrics by load at one pace, on random machines of the recipe; a seed of its own, not training's."""
    found = {}
    for load in loads:
        low, high, told = LOADS[load]
        random = replace(
            recipe.random,
            load=(low, high),
            load_told=told,
            pace=(pace, pace),
            slew_error=TRAVEL,
            small_moves=0.0,
        )
        environment = Environment(replace(recipe, random=random, episode_s=DURATION_S), networks, n, seed)
        found[load] = metrics(*roll_out(environment, mlp))
    return found


def judge_file(
    policy: Policy,
    networks: Sequence[SlewNetwork],
    machines: Randomisation,
    pace: float,
    n: int = 256,
    loads: Sequence[str] = tuple(LOADS),
    **changed: Any,
) -> dict[str, dict[str, float]]:
    """`judge` of an exported policy on machines of these ranges."""
    c = policy.contract
    check_signals(c, "this policy")  # no target of this environment stands on a way
    recipe = replace(
        RECIPES[c.task], history=c.history, prior=c.prior, change=c.change, random=machines, **changed
    )
    return judge(recipe, networks, opened(policy), pace, n, loads=loads)


@torch.no_grad()
def roll_out(e: Environment, mlp: nn.Module) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Slew error [periods + 1, n] rad; distance m, tool rate rad/s, joystick [periods, n]; ended [n]."""
    way = Interface(e.recipe.task, e.recipe.history, e.recipe.prior, e.device, e.recipe.change)
    s = e.fresh()
    slew, distance, tool, lever, ended = [s.state.q], [], [], [], torch.zeros(e.n, dtype=torch.bool)
    for _ in range(e.periods):
        observation = e.observe(s)
        s = e.advance(s, way.limited(way.asked(mlp(way.features(observation)), observation)))
        slew.append(s.state.q)
        distance.append(e.error(s).norm(dim=0))
        tool.append(torch.hypot(s.state.tool[2], s.state.tool[3]))
        lever.append(s.action[0])
        ended = ended | e.ended(s)
    return torch.stack(slew), torch.stack(distance), torch.stack(tool), torch.stack(lever), ended


def metrics(slew: Tensor, distance: Tensor, tool: Tensor, lever: Tensor, ended: Tensor) -> dict[str, float]:
    """The four metrics, means over machines; °/s, °, m (and ° for the slew alone), °/s; and how calm it is.

    Beside them: ° from peak to peak in the last REST_S, sign changes of the joystick a second.
    """
    travel = torch.rad2deg(slew[0].abs())
    past = torch.rad2deg(slew * -torch.sign(slew[0]))  # positive beyond the target
    outside = past.abs() > BAND_DEG
    periods = torch.arange(1, len(slew) + 1)[:, None]
    settled = (outside * periods).max(dim=0).values  # periods until it stays inside
    missed = settled == len(slew)
    time = torch.where(missed, float(len(slew) - 1), settled.float().clamp(min=1.0)) * SPACING_S
    last, rest = round(LAST_S / SPACING_S), past[-round(REST_S / SPACING_S) :]
    turned = torch.sign(lever[1:]) * torch.sign(lever[:-1]) < 0
    found: dict[str, Any] = {
        "speed": (travel / time).mean(),
        "overshoot": past.max(dim=0).values.clamp(min=0.0).mean(),
        "error": distance[-last:].mean(),
        "slew_error": past[-last:].abs().mean(),
        "tool": torch.rad2deg(tool.mean()),
        "rest_peak_to_peak": (rest.max(dim=0).values - rest.min(dim=0).values).mean(),
        "sign_changes": turned.float().sum(0).mean() / (len(lever) * SPACING_S),
        "missed": missed.float().mean(),
        "ended": ended.float().mean(),
    }
    return {name: float(value) for name, value in found.items()}


def main(words: Sequence[str] | None = None) -> None:
    """Print the metrics of a policy by load as JSON."""
    parser = argparse.ArgumentParser(prog="python -m learning.policy.judge")
    parser.add_argument("policy", type=Path)
    parser.add_argument("--machines", type=int, default=256)
    parser.add_argument("--pace", type=float, default=1.0)
    told = parser.parse_args(words)
    torch.set_num_threads(1)
    policy = read(told.policy)
    machines = RECIPES[policy.contract.task].random
    found = judge_file(policy, load_networks(NETWORKS), machines, told.pace, told.machines)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
