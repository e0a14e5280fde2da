"""What each idea of a training gave: policies on re-drawn reference machines at one speed, as a page.

    python -m verification.evaluation.ablation OUT... [--matched 11.2] [--machines 6] [--jobs 1]
                                        [--page FILE.md [--mark NAME]]

Every OUT is a folder of `slewright train policy` that ended.  The first is the base: a row names fields of
the recipe that differ from it.  Each is run by `slewright evaluate` at the pace with this mean speed, on the
same machines and loads.  Folders that differ in the seed alone share a row.  ±: half a 95 % interval over the
machines, of the tool rate and of its difference from the base on the same machines; what another seed would
change is not in it.
"""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from learning.policy import checkpoint
from learning.policy.export import read
from records.report.markers import fill
from specs.errors import InputError
from verification.comparison.figures import interval
from verification.evaluation import evaluation
from verification.evaluation.policies import LOADS

MARK = "policy-ideas"  # of the page, unless --mark names another
COST = ("iterations", "envs", "episode_s")  # said of every row, not as a difference
SILENT = ("name", "why", "kind", "imitation")  # the last says nothing without a teacher, which is said
HEAD = (
    "what differs", "iterations × machines × time", "seeds", "pace", "speed °/s", "overshoot °", "error m",
    "tool empty °/s", "tool 2t", "tool unknown", "tool, mean", "less the base", "missed",
)  # fmt: skip
Found = dict[str, Any]


def recipe_of(out: Path) -> dict[str, Any]:
    """The recipe that a folder was trained with and its slew networks, plain; InputError if it holds none."""
    told = checkpoint.read(out / checkpoint.NAME)
    return {**told["recipe"], "slew networks": told["data_sha256"][:8]}


def policy_of(out: Path) -> Path:
    """The policy in a folder; InputError for a training that has not ended, or made a teacher."""
    found = sorted(out.glob("*.onnx"))
    if not found:
        raise InputError(f"{out} holds no policy: name trainings that ended, and were not of a teacher")
    return found[0]


def difference(base: Mapping[str, Any], other: Mapping[str, Any], group: str = "") -> list[str]:
    """ "field value" of every field in which a recipe is another than the base."""
    found: list[str] = []
    for name in {**other, **base}:
        value = other.get(name, "")
        if isinstance(value, Mapping):
            found += difference(base.get(name) or {}, value, f"{name}.")
        elif (base.get(name) or "") != (value or "") and name not in (*COST, *SILENT):
            found.append(f"{group}{name} {_short(value)}")
    return found


def _joined(found: Sequence[str]) -> list[str]:
    """Several weights or ranges of the machines as one."""
    for group, what in (("random.", "other ranges of"), ("weights.", "other weights of")):
        names = [one.split(" ")[0].removeprefix(group) for one in found if one.startswith(group)]
        if len(names) > 3:
            found = [*(one for one in found if not one.startswith(group)), f"{what} {', '.join(names)}"]
    return list(found)


def _short(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " … ".join(f"{v:g}" if isinstance(v, float | int) else str(v) for v in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value) or "none"


def named(recipes: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """(what differs from the first, what it cost) of each."""
    found = []
    for told in recipes:
        what = ", ".join(_joined(difference(recipes[0], told))) or "base"
        found.append((what, f"{told['iterations']} × {told['envs']} × {told['episode_s']:g} s"))
    return found


def table(rows: Mapping[tuple[str, str], Sequence[Found]]) -> str:
    """The Markdown table; each row the mean over seeds of what `evaluation.evaluate` found."""
    lines = [f"| {' | '.join(HEAD)} |", "|---|---|" + "--:|" * (len(HEAD) - 2)]
    base = by_machine(next(iter(rows.values())))
    return "\n".join([*lines, *(_line(*name, found, base) for name, found in rows.items()), ""])


def by_machine(found: Sequence[Found]) -> dict[str, float]:
    """Tool rate on each machine, °/s: mean over loads and seeds."""
    rates: dict[str, list[float]] = {}
    for run in (run for one in found for run in one["runs"] if not run["failed"]):
        rates.setdefault(run["draw"], []).append(run["tool"])
    return {machine: sum(values) / len(values) for machine, values in rates.items()}


def _half(values: Sequence[float]) -> str:
    ends = interval(values)
    return f" ± {(ends[1] - ends[0]) / 2:.2f}" if ends else ""


def _line(what: str, cost: str, found: Sequence[Found], base: Mapping[str, float]) -> str:
    def mean(get: Callable[[Found], float]) -> float:
        return sum(get(one) for one in found) / len(found)

    overall = {
        name: mean(lambda one, name=name: sum(one["loads"][at][name] for at in LOADS) / len(LOADS))
        for name in ("speed", "overshoot", "error", "tool", "missed")
    }
    tools = [mean(lambda one, at=at: one["loads"][at]["tool"]) for at in LOADS]
    own = by_machine(found)
    more = [own[machine] - base[machine] for machine in base if machine in own]
    less = f"{sum(more) / len(more):+.2f}{_half(more)}" if any(more) else "–"
    cells = [
        str(len(found)), f"{mean(lambda one: one['pace']):.2f}",
        *(f"{overall[name]:.2f}" for name in ("speed", "overshoot", "error")),
        *(f"{tool:.2f}" for tool in tools), f"{overall['tool']:.2f}{_half([*own.values()])}", less,
        f"{len(LOADS) * overall['missed']:g}",
    ]  # fmt: skip
    return f"| {what} | {cost} | {' | '.join(cells)} |"


def page(outs: Sequence[Path], asked: evaluation.Request, words: str, results: Path) -> str:
    """The table with what it is and what made each of its trainings."""
    files = [policy_of(out) for out in outs]
    rows: dict[tuple[str, str], list[Found]] = {}
    for name, file in zip(named([recipe_of(out) for out in outs]), files, strict=True):
        rows.setdefault(name, []).append(evaluation.evaluate([file], results, asked))
    made = [read(file).contract.made for file in files]
    commands = "\n".join({f"{one['command']}  # at {one['commit']}": None for one in made})
    about = (
        f"Made by `python -m verification.evaluation.ablation {words}`: each at the pace with a mean speed "
        f"of {asked.matched:g} °/s over the loads, or the nearest it has, on {asked.machines} machines of "
        f"the {asked.draw_set} draws, simulated; means over machines and seeds. "
        "±: half of the 95 % interval over machines; of a difference from the base on the same machines."
    )
    return f"{about}\n\n{table(rows)}\nTrained by\n\n```sh\n{commands}\n```\n"


def main(words: Sequence[str] | None = None) -> None:
    """Print the page, or fill it in between the markers of --page."""
    parser = argparse.ArgumentParser(prog="python -m verification.evaluation.ablation")
    parser.add_argument("outs", nargs="+", type=Path)
    parser.add_argument("--matched", type=float, default=11.2)
    parser.add_argument("--machines", type=int, default=6)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--results", type=Path, default=Path("out/evaluate"))
    parser.add_argument("--page", type=Path)
    parser.add_argument("--mark", default=MARK)
    told = parser.parse_args(words)
    asked = evaluation.Request(machines=told.machines, matched=told.matched, jobs=told.jobs)
    text = page(told.outs, asked, " ".join(words or sys.argv[1:]), told.results)
    if told.page:
        fill(told.page, told.mark, text)
    print(text)


if __name__ == "__main__":
    main()
