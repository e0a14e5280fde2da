"""What each idea gave: trainings judged at one speed in the training environment, as a Markdown page.

    python -m learning.policy.ablation OUT... [--speed 10] [--out FILE]

Every OUT is a folder of `slewright train policy` that ended.  The first is the base: a row names fields
of the recipe that differ from it.  All are judged on the same machines, those of the base, at several
paces; figures are linear between the paces beside the speed, or those of the nearest pace (marked <, >) where
a policy does not reach it.  Folders that differ in the seed alone share a row.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import torch

from learning.policy import checkpoint
from learning.policy.environment import load_networks
from learning.policy.export import read
from learning.policy.judge import judge_file
from learning.policy.recipe import Randomisation
from learning.policy.session import NETWORKS
from specs.errors import InputError

PACES = (0.5, 0.75, 1.0, 1.25, 1.5)
MACHINES = 96
METRICS = ("speed", "overshoot", "error", "slew_error", "tool", "missed")
COST = ("iterations", "envs", "episode_s")  # said of every row, not as a difference
Figures = dict[str, float]


def recipe_of(out: Path) -> dict[str, Any]:
    """The recipe that a folder was trained with, as plain values; InputError if it holds none."""
    path = out / checkpoint.NAME
    if not path.is_file():
        raise InputError(f"{out} holds no {checkpoint.NAME}: name folders of slewright train policy")
    return torch.load(path, map_location="cpu", weights_only=True)["recipe"]


def front(out: Path, task: str, machines: Randomisation) -> list[Figures]:
    """Mean metrics over the loads at each pace, on machines like these."""
    policy, networks = read(out / f"{task}.onnx"), load_networks(NETWORKS)
    return [_mean(judge_file(policy, networks, machines, pace, MACHINES)) for pace in PACES]


def _mean(by_load: Mapping[str, Figures]) -> Figures:
    return {m: sum(cell[m] for cell in by_load.values()) / len(by_load) for m in METRICS}


def at_speed(points: Sequence[Figures], speed: float) -> tuple[str, Figures]:
    """("", figures) at that speed, linear between neighbours; ("<" or ">", the nearest) beyond the front."""
    for a, b in pairwise(points):
        low, high = sorted((a["speed"], b["speed"]))
        if low <= speed <= high and high > low:
            share = (speed - a["speed"]) / (b["speed"] - a["speed"])
            return "", {m: (1 - share) * a[m] + share * b[m] for m in METRICS}
    nearest = min(points, key=lambda p: abs(p["speed"] - speed))
    return ("<" if nearest["speed"] < speed else ">"), nearest


def difference(base: Mapping[str, Any], other: Mapping[str, Any], group: str = "") -> list[str]:
    """ "field value" of every field in which a recipe is another than the base."""
    found: list[str] = []
    for name in {**other, **base}:
        value = other.get(name, "")
        if isinstance(value, Mapping):
            found += difference(base.get(name) or {}, value, f"{name}.")
        elif (base.get(name) or "") != (value or "") and name not in (*COST, "name", "why", "kind"):
            found.append(f"{group}{name} {_short(value)}")
    return found


def _joined(found: Sequence[str]) -> list[str]:
    """Several ranges of the machines as one."""
    ranges = [one.split(" ")[0].removeprefix("random.") for one in found if one.startswith("random.")]
    if len(ranges) < 3:
        return list(found)
    rest = [one for one in found if not one.startswith("random.")]
    return [*rest, f"other ranges of {', '.join(ranges)}"]


def _short(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " … ".join(f"{v:g}" if isinstance(v, float | int) else str(v) for v in value)
    return f"{value:g}" if isinstance(value, float) else str(value) or "none"


def table(outs: Sequence[Path], speed: float) -> str:
    """The Markdown table, the base first."""
    recipes = [recipe_of(out) for out in outs]
    task = recipes[0]["task"]
    machines = Randomisation(**{k: v for k, v in recipes[0]["random"].items() if k != "kind"})
    rows: dict[str, list[tuple[str, Figures]]] = {}
    for out, told in zip(outs, recipes, strict=True):
        what = ", ".join(_joined(difference(recipes[0], told))) or "base"
        cost = f"{told['iterations']} × {told['envs']} × {told['episode_s']:g} s"
        rows.setdefault(f"{what} | {cost}", []).append(at_speed(front(out, task, machines), speed))
    unit = "°" if task == "slew" else "m"
    head = f"| what differs | iterations × machines × time | seeds | speed °/s | overshoot ° | error {unit} "
    lines = [head + "| tool °/s | missed |", "|---|---|--:|--:|--:|--:|--:|--:|"]
    return "\n".join([*lines, *(_line(name, found, task) for name, found in rows.items()), ""])


def page(outs: Sequence[Path], speed: float, words: str) -> str:
    """The table with what it is and what made each of its trainings."""
    made = [read(next(out.glob("*.onnx"))).contract.made for out in outs]
    trained = {str(one["command"]): None for one in made}
    about = (
        f"Made by `python -m learning.policy.ablation {words}`. Judged in the training environment: one "
        f"target for 15 s on {MACHINES} random machines a load (empty, 2 t told, 0 … 2 t not told), means "
        f"over the loads, linear between paces to {speed:g} °/s; `<` and `>`: the nearest pace of one that "
        "does not reach that speed. These are no results on the reference machine, and one seed of a short "
        "training is little to go by. Tool rate and share of missed targets are what counts here."
    )
    commands = "\n".join(trained)
    head = f"# What each idea gave\n\n{about}\n\n{table(outs, speed)}"
    return f"{head}\nTrained by\n\n```sh\n{commands}\n```\n"


def _line(name: str, found: Sequence[tuple[str, Figures]], task: str) -> str:
    error = "slew_error" if task == "slew" else "error"
    mean = {m: sum(f[m] for _, f in found) / len(found) for m in METRICS}
    sign = found[0][0]
    cells = [f"{mean[m]:.2f}" for m in ("overshoot", error, "tool", "missed")]
    return f"| {name} | {len(found)} | {sign}{mean['speed']:.1f} | {' | '.join(cells)} |"


def main(words: Sequence[str] | None = None) -> None:
    """Print the table, and write it to --out."""
    parser = argparse.ArgumentParser(prog="python -m learning.policy.ablation")
    parser.add_argument("outs", nargs="+", type=Path)
    parser.add_argument("--speed", type=float, default=10.0)
    parser.add_argument("--out", type=Path, help="a file for the table")
    told = parser.parse_args(words)
    torch.set_num_threads(1)
    text = page(told.outs, told.speed, " ".join(words or sys.argv[1:]))
    if told.out:
        told.out.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
