"""A campaign from plan to results: DIR/results.parquet, summary.html, campaign.json, records/."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from orchestrator.files import scratch
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from specs.errors import InputError, nearest
from specs.progress import Report
from specs.version import VERSION
from verification.campaign import pool
from verification.campaign.journal import Journal, content_hash
from verification.campaign.plan import Plan, Run, content, digest
from verification.campaign.summary import write_summary
from verification.campaign.worker import Result, Task
from verification.runs import replacement

JOURNAL = "results.jsonl"
KEPT_WORST = 10  # records of the worst runs that `keep = "worst"` keeps


@dataclass(frozen=True)
class Campaign:
    """What came of it: results by key in the plan's order, those of them that were done now."""

    plan: Plan
    results: Mapping[str, Result]
    done: int
    content_hash: str
    summary: Path

    @property
    def failed(self) -> list[str]:
        """Keys of runs that failed."""
        return [key for key, r in self.results.items() if r["failed"]]

    @property
    def missed(self) -> list[str]:
        """Keys of runs that miss a limit of their scenario."""
        return [key for key, r in self.results.items() if r["missed_limits"]]


def run_campaign(
    plan: Plan,
    out: Path,
    jobs: int = 2,
    scheduler: str | None = None,
    only: Sequence[str] = (),
    retry_failed: bool = False,
    record: bool = False,
    progress: Report | None = None,
) -> Campaign:
    """Do what is not done yet of `plan`, and write results and summary to `out`.

    A result counts as done when its key, its specification and the FMUs are the same as now.  `only`: keys to
    do (again) alone; `retry_failed`: do those that failed again.  `scheduler`: address of a Dask scheduler,
    whose workers do the runs; None: `jobs` local processes.  `record`: keep the records of
    the runs that are done now, whatever the plan says.

    Raises InputError for keys that the plan lacks, before anything runs; on KeyboardInterrupt all results
    that came are kept.
    """
    report = progress or (lambda what, done=None, total=None: None)
    by_key = {run.key: run for run in plan.runs}
    for key in only:
        if key not in by_key:
            raise InputError(f"plan {plan.name} has no run '{key}'; {nearest(key, by_key)}")
    report("building")
    tasks = _tasks(plan, out)
    with Journal(out / JOURNAL) as journal:
        todo = [t for t in tasks if _is_due(t, journal.results.get(t["key"]), only, retry_failed)]
        if record or plan.keep == "all":
            todo = [_recorded(t, out) for t in todo]
        finished = pool.cluster(todo, scheduler) if scheduler else pool.local(todo, jobs)
        done = 0
        for results in finished:
            journal.append(results)
            done += len(results)
            report("runs", done, len(todo))
        current = {t["key"]: journal.results[t["key"]] for t in tasks if t["key"] in journal.results}
    wanted = set(_worth_keeping(plan, current))
    again = [_recorded(t, out) for t in tasks if t["key"] in wanted]
    for _ in pool.local([t for t in again if not Path(t["record"]).is_file()], jobs):
        report("keeping records")
    scratch.clean()  # what workers that were killed by an FMU left
    return _conclude(plan, out, current, done)


def _is_due(task: Task, result: Result | None, only: Sequence[str], retry_failed: bool) -> bool:
    if only:
        return task["key"] in only
    stale = result is None or result["digest"] != task["digest"]
    return stale or (retry_failed and bool(result["failed"]))  # type: ignore[index]


def _tasks(plan: Plan, out: Path) -> list[Task]:
    """Every run with the file of its system and the digest of all that it depends on."""
    packed: dict[tuple[str, str], Path] = {}
    for system, controller in plan.systems:
        models = replacement(plan.controllers[controller], [system])
        packed[system, controller] = pack_system(system, out=out / "systems" / controller, models=models)
    hashes: dict[Path, dict[str, str]] = {}
    said, tasks = cache(content), []
    for run in plan.runs:
        ssp = _system_of(run, packed)
        if ssp not in hashes:
            system = load_system(ssp, run.spec.get("step_s"))
            hashes[ssp] = {name: c.sha256 for name, c in system.components.items()}
        tasks.append(
            {"key": run.key, "digest": digest(run, hashes[ssp], said), "spec": run.spec, "ssp": str(ssp)}
        )
    return tasks


def _recorded(task: Task, out: Path) -> Task:
    return task | {"record": str(record_path(out, task["key"]))}


def _worth_keeping(plan: Plan, results: Mapping[str, Result]) -> list[str]:
    """Keys of runs whose records the plan wants, once it is known how they ended."""
    if plan.keep == "failed":
        return [key for key, r in results.items() if r["failed"]]
    if plan.keep == "worst":
        errors = {key: r["figures"].get("error") for key, r in results.items()}
        known = {key: value for key, value in errors.items() if value is not None}
        return sorted(known, key=lambda key: (-known[key], key))[:KEPT_WORST]
    return []


def _system_of(run: Run, packed: Mapping[tuple[str, str], Path]) -> Path:
    if "scenario" in run.spec:
        return packed[run.spec["system"], run.spec["controller"]]
    return Path(run.spec["path"])


def record_path(out: Path, key: str) -> Path:
    """Where the record of a run goes, if it is kept."""
    path = out / "records" / f"{key.replace('/', '--')}.parquet"
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def _conclude(plan: Plan, out: Path, results: Mapping[str, Result], done: int) -> Campaign:
    _write_parquet(plan, results, out / "results.parquet")
    total = content_hash(list(results.values()))
    page = write_summary(plan, results, total, out)
    campaign = Campaign(plan, results, done, total, page)
    figures = {
        "plan": plan.name,
        "runs": len(plan.runs),
        "finished": len(results),
        "failed": {key: results[key]["failed"] for key in campaign.failed},
        "missed_limits": {key: results[key]["missed_limits"] for key in campaign.missed},
        "content_hash": total,
        "version": VERSION,
    }
    (out / "campaign.json").write_text(json.dumps(figures, indent=2, sort_keys=True) + "\n", encoding="utf-8")
    return campaign


def _write_parquet(plan: Plan, results: Mapping[str, Result], path: Path) -> None:
    """One row a run, in the plan's order: what it was, its figures, why it failed."""
    rows = [
        {"key": run.key, **run.group, **results[run.key]["figures"]}
        | {
            "failed": results[run.key]["failed"],
            "missed_limits": ", ".join(results[run.key]["missed_limits"]),
        }
        | {"run_hash": results[run.key].get("run_hash", "")}
        for run in plan.runs
        if run.key in results
    ]
    names = list(dict.fromkeys(name for row in rows for name in row))
    table = pa.table({name: [row.get(name) for row in rows] for name in names})
    part = path.with_suffix(".part")
    pq.write_table(table, part, compression="zstd")
    part.replace(path)
