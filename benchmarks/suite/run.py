"""All cases of a suite, over local processes or a Dask cluster; goes on where it stopped."""

import importlib.util
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.suite.ledger import Ledger
from benchmarks.suite.plan import Settings
from benchmarks.suite.work import PLAIN, Task, work
from specs.errors import InputError, RunError
from specs.progress import Report
from verification.campaign import pool

Results = list[dict[str, Any]]


def run_suite(
    settings: Settings,
    count: int,
    out: Path,
    workers: int = 1,
    scheduler: str | None = None,
    baselines: bool = True,
    again: bool = False,
    report: Report | None = None,
    experiments: bool = True,
    ledger: Ledger | None = None,
) -> Results:
    """Do the cases of 0 .. count - 1 that neither the folder nor the ledger has; all results, in order.

    `again`: answer the cases that are there once more; `experiments`: drive what ambiguous ones propose.
    A KeyboardInterrupt passes; what was done is kept.
    Raises InputError for less than one case or worker, RunError when cases have no result (a worker that
    died, say), the others done.
    """
    if count < 1:
        raise InputError(f"--cases {count}: at least 1")
    if workers < 1:
        raise InputError(f"--workers {workers}: at least 1")
    say = report or (lambda what, done=None, total=None: None)
    check_packages(scheduler, baselines)
    tasks = [_task(settings, n, out, baselines, again, experiments) for n in range(count)]
    ledger = ledger or Ledger(None, settings)
    todo = [t for t in tasks if again or not _done(t, ledger)]
    done, undrawn = 0, []
    say("cases", 0, len(todo))
    for results in _finished(todo, workers, scheduler):
        done += len(results)
        ledger.keep(results)
        undrawn += [f"case {r['key']}: {r['failed']}" for r in results if r["failed"]]
        say("cases", done, len(todo))
    if undrawn:
        raise RunError(f"{len(undrawn)} cases have no result, all others are kept; {undrawn[0]}")
    return there(out, count, ledger)


def there(out: Path, count: int | None = None, ledger: Ledger | None = None) -> Results:
    """The results in a suite's folder or ledger, of the first `count` cases."""
    found = dict(ledger.results) if ledger else {}
    found |= {p.parent.name: json.loads(p.read_text()) for p in (out / "cases").glob("*/result.json")}
    return [found[key] for key in sorted(found) if count is None or int(key) < count]


def _finished(todo: Sequence[Task], workers: int, scheduler: str | None) -> Iterator[Results]:
    if scheduler:
        yield from pool.cluster(todo, scheduler, work)
    elif workers == 1:
        yield from (work([task]) for task in todo)
    elif todo:
        yield from pool.local(todo, workers, work)


def check_packages(scheduler: str | None, baselines: bool) -> None:
    """Say before any case is drawn what will be missing."""
    if scheduler and importlib.util.find_spec("distributed") is None:
        raise InputError("--dask needs Dask: install slewright[campaign]")
    if baselines and importlib.util.find_spec("pysindy") is None:
        raise InputError("plain SINDy needs pysindy: install slewright[suite], or say --no-baselines")


def _task(
    settings: Settings, number: int, out: Path, baselines: bool, again: bool, experiments: bool
) -> Task:
    case = settings.case(number)
    folder = (out / "cases" / case.key).resolve()
    return {
        "key": case.key,
        "ssp": "",  # what the pool keeps together: nothing, so that the first cases are of every system
        "system": case.system,
        "digest": "",
        "folder": str(folder),
        "seed": case.seed,
        "noise": settings.noise,
        "visible": settings.visible,
        "baselines": baselines,
        "experiments": experiments,
        "again": again,
    }


def _done(task: Task, ledger: Ledger) -> bool:
    """Whether there is a result with all that is wanted; where something failed it is done again."""
    path = Path(task["folder"]) / "result.json"
    found = json.loads(path.read_text()) if path.is_file() else ledger.results.get(task["key"])
    if found is None:
        return False
    plain = found["baselines"]
    if task["baselines"] and (len(plain) < len(PLAIN) or any(b["workflow_failed"] for b in plain.values())):
        return False
    if task["experiments"] and found["verdict"] == "ambiguous":
        after = found.get("experiment")
        if not after or after.get("workflow_failed"):
            return False
    return not found["workflow_failed"]
