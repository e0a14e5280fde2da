"""`slewright evaluate`: policies of one task on re-drawn machines, at a pace or at a speed asked for."""

import hashlib
import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from learning.policy.export import read
from records.record import read as read_record
from specs import parameters
from verification.campaign.run import record_path, run_campaign
from verification.comparison.figures import interval
from verification.comparison.plan import make_plan
from verification.evaluation import training_range
from verification.evaluation.policies import LOADS, question, task_of

FIGURES = ("speed", "overshoot", "overshoot_max", "error", "tool", "missed")
MEANS = ("speed", "overshoot", "error", "tool")
NEAR = 0.1  # °/s: a mean speed this near to the one asked for is that speed
TRIES = 4  # paces at most on the way there
SLOPE = 8.0  # °/s by a pace of 1, of the first step; the next ones know better
SEED = re.compile(r"--seed \S+")
Rows = list[dict[str, Any]]


@dataclass(frozen=True)
class Request:
    """On which machines with which loads, and at which pace or (`matched`) mean speed in °/s."""

    draw_set: str = "validation"
    machines: int = 24
    loads: Sequence[str] = LOADS
    pace: float = 1.0
    matched: float | None = None
    jobs: int = 1
    opened: Any = None


def evaluate(paths: Sequence[Path], out: Path, asked: Request, report: Any = None) -> dict[str, Any]:
    """Figures by load, machine and seed; several policies of one task are seeds of one recipe."""
    contracts, task = [read(path).contract for path in paths], task_of(paths)
    rows: Rows = []
    paces, made = {}, {}
    for path, contract in zip(paths, contracts, strict=True):
        run = _runner(path, task, _folder(out, path), asked, report)
        seed = _name(contract.made.get("seed", ""), paces)
        found, paces[seed] = at_speed(run, asked, contract.ranges.get("pace", (0.0, 2.0)))
        made[seed] = {name: contract.made.get(name, "") for name in ("command", "commit")}
        rows += [{**row, "seed": seed} for row in found]
    return {
        "task": task, "policy": str(paths[0]), "draw_set": asked.draw_set,
        "machines": asked.machines, "pace": next(iter(paces.values())), "matched": asked.matched,
        "made": dict(contracts[0].made),
        "loads": {load: mean_figures(rows, load=load) for load in asked.loads},
        "draws": {d: mean_figures(rows, draw=d) for d in {r["draw"]: 0 for r in rows}},
        "seeds": {s: {"pace": pace, **made[s], **mean_figures(rows, seed=s)} for s, pace in paces.items()},
        "worst": worst(rows),
        "runs": rows, "failed": {f"{r['load']}/{r['draw']}": r["failed"] for r in rows if r["failed"]},
    }  # fmt: skip


def _name(seed: Any, known: Mapping[str, Any]) -> str:
    """What a seed is called: two of the same are told apart."""
    again = sum(name.split(" ")[0] == str(seed) for name in known)
    return f"{seed} ({again + 1})" if again else str(seed)


def _folder(out: Path, path: Path) -> Path:
    """A policy's own folder of results: seeds share a file name."""
    return out / hashlib.sha256(path.read_bytes()).hexdigest()[:8]


def at_speed(run: Callable[[float], Rows], asked: Request, paces: tuple[float, float]) -> tuple[Rows, float]:
    """(rows, pace): at the pace told, or at the one whose mean speed is the one asked for (secant)."""
    if asked.matched is None:
        return run(asked.pace), asked.pace
    pace, slope, tried = max(paces[0], min(paces[1], 1.0)), SLOPE, {}
    for _ in range(TRIES):
        rows = run(pace)
        tried[pace] = (_speed(rows), rows)
        off = asked.matched - tried[pace][0]
        if abs(off) <= NEAR:
            break
        if len(tried) > 1:
            (p, (v, _)), (q, (w, _)) = list(tried.items())[-2:]
            slope = (w - v) / (q - p) if abs(w - v) > 1e-6 else slope
        step = max(-0.4, min(0.4, off / max(slope, 1.0)))
        pace = round(max(paces[0], min(paces[1], pace + step)), 2)
        if pace in tried:
            break
    best = min(tried, key=lambda p: abs(tried[p][0] - asked.matched))
    return tried[best][1], best


def _speed(rows: Rows) -> float:
    good = [r["speed"] for r in rows if not r["failed"]]
    return sum(good) / len(good) if good else 0.0


def planned_runs(path: Path, asked: Request, pace: float) -> Any:
    """The runs of a policy at a pace, of which the records are kept."""
    paces = (1.0,) if pace == 1.0 else (1.0, pace)
    whole, _ = question(path, asked.draw_set, asked.machines, paces, asked.loads)
    plan = make_plan(whole, asked.opened)
    return replace(plan, runs=tuple(r for r in plan.runs if r.spec["pace"] == pace), keep="all")


def warnings(paths: Iterable[Path], asked: Request) -> Iterator[str]:
    """What of the machines, loads and pace lies outside the policies' trained ranges; before they run.

    The pace of a speed asked for is searched within the trained ones.
    """
    for path in paths:
        specs = [run.spec for run in planned_runs(path, asked, asked.pace).runs]
        yield from training_range.warnings(path, specs, () if asked.matched is None else ("pace",))


def _runner(path: Path, task: str, out: Path, asked: Request, report: Any) -> Callable[[float], Rows]:
    """pace -> a row of figures for every machine and load."""

    def run(pace: float) -> Rows:
        plan = planned_runs(path, asked, pace)
        done = run_campaign(plan, out, asked.jobs, None, progress=report)
        rows = []
        for one in plan.runs:
            row = _row(one.spec, done.results[one.key], task)
            if not row["failed"]:
                row["terminations"] = terminated(read_record(record_path(out, one.key)))
            rows.append(row)
        return rows

    return run


def _row(spec: Mapping[str, Any], result: Mapping[str, Any], task: str) -> dict[str, Any]:
    row = {"load": spec["load"], "draw": spec["draw"], "failed": result["failed"]}
    if not result["failed"]:
        error = "slew_error" if task == "slew" else "error"
        row |= {k: result["figures"][error if k == "error" else k] for k in FIGURES}
    return row


def terminated(record: Any) -> int:
    """1 if the grab came lower or nearer to the slew axis than is allowed, else 0."""
    g = parameters.load("geometry")
    x, y, z = (record.column(f"true_tool_{axis}") for axis in "xyz")
    low = z < g["keepout_height"].value
    return int(np.any(low | (np.hypot(x, y) < g["keepout_radius"].value)))


def mean_figures(rows: Iterable[Mapping[str, Any]], **where: str) -> dict[str, Any]:
    """Figures over the runs of `where`, with 95 % intervals over machines (means of seeds and loads)."""
    chosen = [r for r in rows if not r["failed"] and all(r[k] == v for k, v in where.items())]
    found: dict[str, Any] = {"n": len(chosen)}
    if not chosen:
        return found
    for name in MEANS:
        found[name] = sum(r[name] for r in chosen) / len(chosen)
    found["overshoot_max"] = max(r["overshoot_max"] for r in chosen)
    found["missed"] = sum(r["missed"] for r in chosen)
    found["terminations"] = sum(r["terminations"] for r in chosen)
    found["ci95"] = {name: _interval(chosen, name) for name in MEANS}
    return found


def worst(rows: Rows) -> dict[str, float]:
    """A metric on its worst machine over the mean of machines, loads averaged (speed: mean over slowest)."""
    machines = [mean_figures(rows, draw=d) for d in {r["draw"]: 0 for r in rows}]
    machines = [m for m in machines if m["n"]]
    if not machines:
        return {}
    mean = {name: sum(m[name] for m in machines) / len(machines) for name in MEANS}
    far = {name: max(m[name] for m in machines) / mean[name] for name in MEANS[1:] if mean[name] > 0}
    return {"speed": mean["speed"] / min(m["speed"] for m in machines), **far}


def _interval(rows: Sequence[Mapping[str, Any]], name: str) -> list[float] | None:
    ordered = sorted(rows, key=lambda r: r["draw"])
    by_machine = [[r[name] for r in group] for _, group in itertools.groupby(ordered, lambda r: r["draw"])]
    return interval([sum(values) / len(values) for values in by_machine])


def markdown(found: Mapping[str, Any]) -> str:
    """The figures by load and, if there are several, by seed as Markdown tables, with the command."""
    unit = "°" if found["task"] == "slew" else "m"
    lines = [
        f"`{Path(found['policy']).name}`, {_pace(found)}, {found['machines']} machines of the "
        f"{found['draw_set']} draws, simulated; ±: 95 % interval over machines. Made by {_made(found)}.",
        "",
        f"| load | speed °/s | overshoot ° | largest ° | error {unit} | tool °/s | missed | ended | runs |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    lines += [f"| {' | '.join([load, *cells(cell)])} |" for load, cell in found["loads"].items()]
    return "\n".join([*lines, *_by_seed(found, unit), *_by_worst(found), ""])


def unreached(found: Mapping[str, Any]) -> dict[str, float]:
    """Seed -> mean speed of those that did not come to the one that was asked for."""
    speeds = {seed: cell["speed"] for seed, cell in found.get("seeds", {}).items() if cell["n"]}
    wanted = found.get("matched")
    return {s: v for s, v in speeds.items() if abs(v - wanted) > NEAR} if wanted else {}


def _pace(found: Mapping[str, Any]) -> str:
    """The pace, and if a speed was asked for, whether that is the one that was reached."""
    pace, wanted = f"pace {found['pace']:g}", found.get("matched")
    if not wanted:
        return pace
    several, far = len(found["seeds"]) > 1, unreached(found)
    which = "each seed's own pace" if several else pace
    if not far:
        return f"{which}, set to {wanted:g} °/s in the mean over loads"
    speeds = ", ".join(f"{v:.1f}" + f" (seed {s})" * several for s, v in far.items())
    return (
        f"{which}, the nearest to {wanted:g} °/s in the mean over loads, which was not reached: {speeds} °/s"
    )


def _made(found: Mapping[str, Any]) -> str:
    """Commands and commits of the policies, those that differ in the seed alone together."""
    each = [cell for cell in found.get("seeds", {}).values() if "command" in cell] or [found["made"]]
    alike: dict[tuple[str, str], list[str]] = {}
    for one in each:
        command, commit = str(one.get("command", "")), str(one.get("commit", ""))
        alike.setdefault((SEED.sub("--seed N", command), commit), []).append(command)
    return "; ".join(_commands(*name, commands) for name, commands in alike.items())


def _commands(pattern: str, commit: str, commands: Sequence[str]) -> str:
    if len(set(commands)) == 1:
        return f"`{commands[0]}`, commit {commit}"
    seeds = ", ".join(SEED.findall(command)[0].split()[-1] for command in commands)
    return f"`{pattern}`, N = {seeds}, commit {commit}"


def _by_worst(found: Mapping[str, Any]) -> list[str]:
    if not (ratios := found.get("worst")):
        return []
    text = ", ".join(f"{name} {ratio:.2f}" for name, ratio in ratios.items())
    return [
        "",
        f"Worst machine over the mean of machines (means over loads; speed: mean over slowest): {text}.",
    ]


def _by_seed(found: Mapping[str, Any], unit: str) -> list[str]:
    if len(found.get("seeds", {})) < 2:
        return []
    head = ["seed", "pace", "speed °/s", "overshoot °", "largest °", f"error {unit}", "tool °/s", "missed",
            "ended", "runs"]  # fmt: skip
    lines = ["", f"| {' | '.join(head)} |", "|---|" + "--:|" * 9]
    for seed, cell in found["seeds"].items():
        lines.append(f"| {' | '.join([seed, str(cell['pace']), *cells(cell)])} |")
    return lines


def tables(found: Mapping[str, Any], title: str) -> Iterator[tuple[str, Sequence[str], list[list[str]]]]:
    """Title, columns and rows: the figures by load, and by seed where there are several."""
    unit = "deg" if found["task"] == "slew" else "m"
    columns = ("speed °/s", "overshoot °", "largest °", f"error {unit}", "tool °/s", "missed", "ended", "n")
    rows = [[load, *cells(cell)] for load, cell in found["loads"].items()]
    yield f"{title}, pace {found['pace']:g}", ("load", *columns), rows
    if len(found["seeds"]) > 1:
        rows = [[seed, f"{c['pace']:g}", *cells(c)] for seed, c in found["seeds"].items()]
        yield "By seed, all loads", ("seed", "pace", *columns), rows


def cells(cell: Mapping[str, Any]) -> list[str]:
    """Speed, overshoot, largest, error, tool, missed, ended, runs; a dash for what there is not."""
    if not cell["n"]:
        return ["–"] * 7 + ["0"]
    order = ("speed", "overshoot", "overshoot_max", "error", "tool")
    means = [f"{cell[n]:.2f}{_half(cell, n)}" for n in order]
    return [*means, *(str(cell[n]) for n in ("missed", "terminations", "n"))]


def _half(cell: Mapping[str, Any], name: str) -> str:
    ends = (cell.get("ci95") or {}).get(name)
    return f" ± {(ends[1] - ends[0]) / 2:.2f}" if ends else ""
