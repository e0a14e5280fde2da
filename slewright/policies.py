"""Policies as controllers: an ONNX file becomes a model folder that stands where the systems have theirs."""

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from specs.errors import InputError

FOLDER = Path("build/policies")
LOADS = ("empty", "2t", "unknown")
FIGURES = ("speed", "overshoot", "overshoot_max", "error", "tool", "missed")


def model_folder(path: Path) -> Path:
    """A model folder as it is, or the one that is made of an ONNX policy; InputError if it is neither."""
    if path.suffix != ".onnx":
        return path
    from learning.policy.controller import write_folder
    from learning.policy.export import read

    policy = read(path)
    name = re.sub(r"\W", "_", path.stem)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
    name = name if name[:1].isalpha() else f"policy_{name}"
    return write_folder(policy, name, FOLDER / digest)


def question(
    path: Path, draw_set: str, machines: int, paces: Sequence[float], loads: Sequence[str]
) -> tuple[Any, Any]:
    """(what is asked, the policy): one policy on its task, on machines of a set."""
    from baselines import registry
    from baselines.compare.plan import Question
    from learning.policy.export import read

    policy = read(path)
    folder = model_folder(path)
    controller = registry.foreign(folder, f"policy_{folder.name}", f"policy {path.name}")
    asked = Question(
        controllers=[controller], tasks=[policy.contract.task], loads=list(loads), draw_set=draw_set,
        machines=machines, paces=list(paces), singles=False,
    )  # fmt: skip
    return asked, policy


def evaluate(
    path: Path,
    out: Path,
    draw_set: str = "validation",
    machines: int = 24,
    pace: float = 1.0,
    loads: Sequence[str] = LOADS,
    jobs: int = 1,
    opened: Any = None,
    report: Any = None,
) -> dict[str, Any]:
    """Run a policy through the orchestrator on re-drawn machines; figures by load and by machine."""
    from baselines.compare.plan import make_plan
    from orchestrator.campaign.run import record_path, run_campaign
    from records.record import read as read_record

    paces = (1.0,) if pace == 1.0 else (1.0, pace)
    asked, policy = question(path, draw_set, machines, paces, loads)
    plan = make_plan(asked, opened)
    runs = tuple(r for r in plan.runs if r.spec["pace"] == pace)
    plan = replace(plan, runs=runs, keep="all")
    done = run_campaign(plan, out, jobs, None, progress=report)
    rows = []
    for run in runs:
        result = done.results[run.key]
        row = {"load": run.spec["load"], "draw": run.spec["draw"], "failed": result["failed"]}
        if not result["failed"]:
            error = "slew_error" if policy.contract.task == "slew" else "error"
            row |= {k: result["figures"][error if k == "error" else k] for k in FIGURES}
            row["terminations"] = terminated(read_record(record_path(out, run.key)))
        rows.append(row)
    return {
        "task": policy.contract.task, "policy": str(path), "draw_set": draw_set, "machines": machines,
        "pace": pace, "made": dict(policy.contract.made),
        "loads": {load: _mean(r for r in rows if r["load"] == load) for load in loads},
        "draws": {d: _mean(r for r in rows if r["draw"] == d) for d in {r["draw"]: 0 for r in rows}},
        "seeds": {str(policy.contract.made.get("seed", "")): _mean(rows)},
        "failed": {f"{r['load']}/{r['draw']}": r["failed"] for r in rows if r["failed"]},
    }  # fmt: skip


def terminated(record: Any) -> int:
    """1 if the grab came lower or nearer to the slew axis than is allowed, else 0."""
    import numpy as np

    from specs import parameters

    g = parameters.load("geometry")
    x, y, z = (record.column(f"true_tool_{axis}") for axis in "xyz")
    low = z < g["keepout_height"].value
    return int(np.any(low | (np.hypot(x, y) < g["keepout_radius"].value)))


def _mean(rows: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    chosen = [r for r in rows if not r["failed"]]
    found: dict[str, Any] = {"n": len(chosen)}
    if not chosen:
        return found
    for name in FIGURES:
        values = [r[name] for r in chosen]
        if name in ("missed", "overshoot_max"):
            found[name] = sum(values) if name == "missed" else max(values)
        else:
            found[name] = sum(values) / len(values)
    found["terminations"] = sum(r["terminations"] for r in chosen)
    return found


def markdown(found: Mapping[str, Any]) -> str:
    """The figures by load as a Markdown table, with what made the policy."""
    made, unit = found["made"], "°" if found["task"] == "slew" else "m"
    head = f"`{Path(found['policy']).name}`, pace {found['pace']:g}, {found['machines']} machines of the "
    head += f"{found['draw_set']} draws, simulated. Made by `{made.get('command', '')}`, "
    lines = [
        f"{head}commit {made.get('commit', '')}.",
        "",
        f"| load | speed °/s | overshoot ° | largest ° | error {unit} | tool °/s | missed | ended | runs |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for load, cell in found["loads"].items():
        means = [f"{cell[n]:.2f}" for n in FIGURES[:5]] if cell["n"] else ["–"] * 5
        counts = [str(cell.get(n, "–")) for n in ("missed", "terminations", "n")]
        lines.append(f"| {' | '.join([load, *means, *counts])} |")
    return "\n".join([*lines, ""])


def warnings(path: Path, draw_set: str, machines: int) -> Iterator[str]:
    """What of the machines lies outside the policy's trained ranges, in words, each once."""
    from learning.policy.export import read
    from specs import draws, policy as contract

    ranges = read(path).contract.ranges
    seen: set[str] = set()
    for index in range(machines if draw_set != draws.SEALED else 0):
        for text in contract.outside(ranges, draws.draw(draw_set, index)):
            name = text.split()[0]
            if name not in seen:
                seen.add(name)
                yield f"{draw_set}-{index}: {text}"


def check_machines(machines: int) -> None:
    """InputError for a number that is none."""
    if machines < 1:
        raise InputError(f"--machines {machines}: valid are 1 and more")
