"""Showcases: a plain model, recordings of the simulated reference machine, what reconcile adds to it.

Each collects its recordings, reconciles the plain model with them, and compares plain and extended model with
the reference machine in the scenarios of an empty grab, in two ways: `whole`, the nominal system with either
model in it, where the faults of all other models take part; and `isolated`, either model moved as the
machine moved (benchmarks/showcases/isolated_replay.py).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.showcases.isolated_replay import moved
from fmus.toolchain.build import build_fmu
from learning.collection.collect import collect
from learning.collection.plan import load_plan
from reconcile.workflow import reconcile
from records.metrics import compute
from records.record import read
from specs.errors import RunError
from specs.progress import Report
from specs.scenario import find
from specs.version import VERSION
from verification.verify import Controller, verify

PLAN = "showcases"
SCENARIOS = ("four_targets_empty", "five_targets_empty")
METRICS = ("speed", "overshoot", "error", "tool")
METRIC_UNITS = {"speed": "°/s", "overshoot": "°", "error": "m", "tool": "°/s", "slew_error": "°"}
Values = dict[str, list[float]]  # metric -> of every target
Runs = Mapping[str, Mapping[str, Values]]  # system -> scenario


@dataclass(frozen=True)
class Showcase:
    """`model`: the plain one, a folder or a model's name; `part`: of the plan; `lacks`: what must be named.

    One of `lacks` is enough.  `moves`: the metrics that must come closer when the model alone is looked at.
    """

    name: str
    model: str
    part: str
    lacks: tuple[str, ...]
    moves: tuple[str, ...]


COUPLINGS = ("coriolis_coupling", "centrifugal_coupling", "euler_coupling")
SHOWCASES = {
    "tool": Showcase("tool", "tool", "slewing", COUPLINGS, ("error", "tool")),
    "slew": Showcase(
        "slew",
        "docs/results/showcases/slew_one_pose",
        "reaching",
        ("pose_dependent_inertia",),
        ("speed", "overshoot", "slew_error"),
    ),
}


def measure(chosen: Showcase, out: Path, seed: int = 1, report: Report | None = None) -> dict[str, Any]:
    """Figures of a showcase; recordings, report and verification lie in `out`.

    `seed`: of the scenarios' sensor noise.  Raises InputError for a folder with something else in it;
    RunError when a run fails.
    """
    said = report or (lambda *_: None)
    sets = record(chosen, out / "recordings", said)
    folder = out / chosen.name
    answer = reconcile(sets["train"], chosen.model, folder, sets["validation"], sets["test"], report=said)
    extended = folder / "model" if "model" in answer else None
    compared = {
        "whole": compared_by(METRICS, verified(chosen, extended, out / "verify", seed, said)),
        "isolated": compared_by(chosen.moves, alone(chosen, extended, out / "verify", seed, said)),
    }
    kept = ("verdict", "sentence", "residual_status", "alternatives", "effects", "reestimated", "gap")
    found = {k: answer[k] for k in kept} | compared
    recordings = {which: [p.name for p in paths] for which, paths in sets.items()}
    return found | {"recordings": recordings, "seed": seed, "versions": {"slewright": VERSION}}


def record(chosen: Showcase, out: Path, report: Report | None = None) -> dict[str, list[Path]]:
    """The showcase's recordings by split, made where they are not there yet."""
    manifest = collect(load_plan(Path(PLAN)), out, parts=[chosen.part], report=report)
    found: dict[str, list[Path]] = {"train": [], "validation": [], "test": []}
    for row in manifest["recordings"]:
        if row["part"] == chosen.part:
            found[row["split"]].append(out / row["file"])
    return found


def verified(
    chosen: Showcase, extended: Path | None, out: Path, seed: int, report: Report | None = None
) -> dict[str, dict[str, Values]]:
    """Metrics of all targets by system (plain, extended, machine) and scenario.

    Without an extended model, those of the others.
    """
    plain = Path(chosen.model) if Path(chosen.model).is_dir() else None
    wanted = {"plain": ("nominal", plain), "extended": ("nominal", extended), "machine": ("reference", None)}
    found = {}
    for name, (system, model) in wanted.items():
        if name == "extended" and extended is None:
            continue
        folder = out / chosen.name / name
        done = verify(
            SCENARIOS,
            (system,),
            seed,
            folder,
            Controller(models=[model] if model else ()),
            jobs=1,
            progress=report,
        )
        found[name] = {s: metrics_of(done.own.runs[s][system], METRICS) for s in SCENARIOS}
    return found


def alone(
    chosen: Showcase, extended: Path | None, out: Path, seed: int, report: Report | None = None
) -> dict[str, dict[str, Values]]:
    """As `verified`, whose records of the machine must lie in `out`; the models moved as the machine was."""
    known = {"plain": chosen.model, "extended": extended}
    fmus = {name: build_fmu(model) for name, model in known.items() if model is not None}
    found: dict[str, dict[str, Values]] = {n: {} for n in (*fmus, "machine")}
    for s in SCENARIOS:
        if report:
            report(f"{s}: moved as the machine moves")
        run = read(out / chosen.name / "machine" / "records" / f"{s}-reference.parquet")
        (scenario,) = find(s)
        runs = {n: moved(fmu, chosen.name, run, scenario, seed) for n, fmu in fmus.items()} | {"machine": run}
        for name, record in runs.items():
            found[name][s] = metrics_of(record, chosen.moves)
    return found


def metrics_of(record: Any, names: Iterable[str]) -> Values:
    """Metrics of a run by name, of every target that has them."""
    metrics = compute(record)
    return {m: metrics.values(m) for m in names}


def compared_by(metrics: Iterable[str], runs: Runs) -> dict[str, Any]:
    """`runs` with, by system and metric, mean and distance to the machine over the scenarios, and `closer`.

    The distance is the mean of the distances at every target: in a mean over targets errors cancel, and a
    model that misses each by degrees, one short and one beyond, would come out right.
    Raises RunError for runs of different targets.
    """
    metrics = tuple(metrics)
    mean = {s: {m: _mean(_mean(r[m]) for r in by.values()) for m in metrics} for s, by in runs.items()}
    true = runs["machine"]
    distance = {
        s: {m: _mean(_apart(by[n][m], true[n][m]) for n in by) for m in metrics}
        for s, by in runs.items()
        if s != "machine"
    }
    return {"runs": runs, "mean": mean, "distance": distance, "closer": closer(metrics, distance)}


def _apart(values: Sequence[float], true: Sequence[float]) -> float:
    if len(values) != len(true):
        raise RunError("a run ended before its last target: there is nothing to compare with the machine's")
    return _mean(abs(v - t) for v, t in zip(values, true, strict=True))


def closer(metrics: Iterable[str], distance: Mapping[str, Mapping[str, float]]) -> dict[str, float | None]:
    """By metric, the share of the distance to the machine that the extended model took away (< 0: added).

    None where plain model and machine do not differ, or nothing was extended.
    """
    shares: dict[str, float | None] = {}
    for m in metrics:
        known = "extended" in distance and distance["plain"][m] > 0.0
        shares[m] = 1.0 - distance["extended"][m] / distance["plain"][m] if known else None
    return shares


def missed(chosen: Showcase, figures: Mapping[str, Any]) -> list[str]:
    """What is wanted of a showcase and was missed; of the metrics, what the model alone is to blame for."""
    named = {e["name"] for e in figures["effects"]}
    found = []
    if not named & set(chosen.lacks):
        found.append(f"{chosen.name}: none of {', '.join(chosen.lacks)} is named: {figures['sentence']}")
    for name, gap in figures["gap"].items():
        if named and not _less(gap["after"], gap["nominal"]):
            found.append(f"{chosen.name}: the gap of {name} did not shrink")
    for m in chosen.moves:
        share = figures["isolated"]["closer"][m]
        if share is not None and share <= 0.0:
            found.append(f"{chosen.name}: {m} of the model alone did not move towards the machine")
    return found


def _less(after: float | None, before: float | None) -> bool:
    return after is not None and (before is None or after < before)


def _mean(values: Iterable[float]) -> float:
    known = list(values)
    return sum(known) / len(known)
