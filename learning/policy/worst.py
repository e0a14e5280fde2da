"""The worst that a policy does over a family of drives, and the rule by which one of several is chosen.

    python -m learning.policy.worst POLICY... [--networks FILE]... [--machines 64] [--pace 1] [--change C]

Each slew network is driven as it is and as its mirror image, and each of the two changed in one thing at a
time (CHANGES), in the training environment, load not told.  Changes are at or beyond the ends of what the
recipe `family` is trained over; "retrained" is the network with its weights disturbed, another network of
about the same machine.  Beside them stand two drives that no network was trained on (simulation/lag.py).

The rule: of each figure of LIMITS the worst over the plants, over its limit; the policy with the smallest sum
is chosen.  A share of 1 % missed weighs as much as 2 degrees of overshoot, so that a policy that misses is
chosen only where all do.
"""

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from fmus.models.slew_nn.network import PARTS, Mlp, SlewNetwork
from learning.policy.export import Policy, read
from learning.policy.judge import judge_file
from learning.policy.recipe import RECIPES, Randomisation
from learning.policy.session import FAMILY
from learning.policy.simulation.environment import load_networks
from learning.policy.simulation.lag import lag

LIMITS = {"missed": 0.01, "overshoot": 2.0, "error": 0.47, "tool": 10.0}  # of which less is better
SPEED = 10.8  # degrees per second, of which more is better
DISTURBED, DISTURBED_SEED = 0.03, 7  # of a layer's weights: their deviation as a share
CHANGES: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "as it is": {},
    "less gain": {"gain": (0.75, 0.75)},
    "more gain": {"gain": (1.33, 1.33)},
    "0.15 s later": {"slew_delay": (0.15, 0.15)},
    "0.3 s later": {"slew_delay": (0.3, 0.3)},
    "sharper": {"edge": (0.5, 0.5)},
    "light": {"inertia_scale": (0.7, 0.7)},
    "heavy": {"inertia_scale": (1.4, 1.4)},
    "wide dead band": {"dead_band": (0.18, 0.18)},
}


def fixed(random: Randomisation) -> Randomisation:
    """The recipe's machines with the drive as its network makes it: what CHANGES change one at a time."""
    nominal = Randomisation().off()
    names = ("gain", "slew_delay", "edge", "inertia_scale", "dead_band")
    return replace(random, latency=(1.0, 1.0), **{name: getattr(nominal, name) for name in names})


def disturbed(network: SlewNetwork, seed: int = DISTURBED_SEED) -> SlewNetwork:
    """Another network of about the same machine: every weight off by a few percent of its layer's spread."""
    rng = np.random.default_rng(seed)

    def other(net: Mlp) -> Mlp:
        moved = tuple(w + DISTURBED * w.std() * rng.standard_normal(w.shape) for w in net.weights)
        return replace(net, weights=tuple(w.astype(np.float32) for w in moved))

    return replace(network, **{part: tuple(other(m) for m in getattr(network, part)) for part in PARTS})


def plants(networks: Mapping[str, SlewNetwork]) -> dict[str, tuple[SlewNetwork, Mapping[str, object]]]:
    """Every plant of the family by name: a network, and what of the machine is changed."""
    found: dict[str, tuple[SlewNetwork, Mapping[str, object]]] = {
        "sketched drive": (lag(), {}), "sketched drive, late and lively": (lag(delay=4, lag_s=0.15), {}),
    }  # fmt: skip
    for name, network in networks.items():
        for side, one in (("", network), (", mirrored", network.mirrored())):
            found |= {f"{name}{side}, {change}": (one, how) for change, how in CHANGES.items()}
            found[f"{name}{side}, retrained"] = (disturbed(one), {})
    return found


def judged(
    policy: Policy, networks: Mapping[str, SlewNetwork], pace: float = 1.0, n: int = 64
) -> dict[str, dict[str, float]]:
    """Figures of a policy by plant, load not told."""
    base = fixed(RECIPES["family" if policy.contract.task == "full" else "slew"].random)
    found = {}
    for name, (network, how) in plants(networks).items():
        machines = replace(base, **how)  # type: ignore[arg-type]
        found[name] = judge_file(policy, [network], machines, pace, n, ("unknown",), ahead_s=0.0)["unknown"]
    return found


def worst(found: Mapping[str, Mapping[str, float]]) -> dict[str, tuple[float, str]]:
    """Of each figure the worst and its plant."""
    names = next(iter(found.values()))
    return {
        figure: min((row[figure], plant) for plant, row in found.items())
        if figure == "speed"
        else max((row[figure], plant) for plant, row in found.items())
        for figure in names
    }


def score(found: Mapping[str, Mapping[str, float]]) -> float:
    """The rule: less is better; 5 where every worst figure is at its limit."""
    at = worst(found)
    slow = SPEED / at["speed"][0] if at["speed"][0] > 0.0 else math.inf
    return slow + sum(at[name][0] / limit for name, limit in LIMITS.items())


def main(words: Sequence[str] | None = None) -> None:
    """Print score and worst figures of each policy as JSON, the best one first."""
    parser = argparse.ArgumentParser(prog="python -m learning.policy.worst")
    parser.add_argument("policy", type=Path, nargs="+")
    parser.add_argument("--networks", type=Path, action="append", default=[])
    parser.add_argument("--machines", type=int, default=64)
    parser.add_argument("--pace", type=float, default=1.0)
    parser.add_argument("--change", type=float, help="limit on the joystick, in place of the policy's own")
    parser.add_argument("--all", action="store_true", help="every plant, not only the worst")
    told = parser.parse_args(words)
    torch.set_num_threads(1)
    paths = told.networks or list(FAMILY)
    networks = dict(
        zip(
            (path.parent.name if path.stem == "weights" else path.stem for path in paths),
            load_networks(paths),
            strict=True,
        )
    )
    rows = []
    for path in told.policy:
        policy = read(path)
        if told.change is not None:
            policy = replace(policy, contract=replace(policy.contract, change=told.change))
        found = judged(policy, networks, told.pace, told.machines)
        row = {"policy": str(path), "score": score(found), "worst": worst(found)}
        rows.append(row | {"plants": found} if told.all else row)
    print(json.dumps(sorted(rows, key=lambda row: row["score"]), indent=1))


if __name__ == "__main__":
    main()
