"""`python -m benchmarks campaign`: scaling against independent processes, cost beside stepping.

All in one run, interleaved: a campaign on one and on two workers, and the same runs in one and in two
processes that know nothing of each other.  Start-up of processes is left out of all four.
"""

import json
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import Any

from orchestrator.run.processes import warm_up
from orchestrator.system.pack import pack_system
from specs.progress import Report
from verification.campaign import pool
from verification.campaign.worker import Result, Task, work

RUNS = 200
STOP_S = 15.0
BLOCKS = 5
LEAST_SCALING, MOST_OVERHEAD_MS = 0.9, 5.0


def measure(blocks: int = BLOCKS, runs: int = RUNS, report: Report | None = None) -> dict[str, Any]:
    """Runs per second of each way (medians over blocks), scalings, their ratio, overhead of a run [ms]."""
    say = report or (lambda what, done=None, total=None: None)
    ssp = str(pack_system("nominal"))
    tasks = [_task(ssp, seed, STOP_S) for seed in range(runs)]
    ways: dict[str, Callable[[], float]] = {
        "campaign_1": lambda: _rate(_pooled(tasks, 1)),
        "campaign_2": lambda: _rate(_pooled(tasks, 2)),
        "independent_1": lambda: _rate(_independent([tasks])),
        "independent_2": lambda: _rate(_independent([tasks[::2], tasks[1::2]])),
    }
    found: dict[str, list[float]] = {name: [] for name in ways}
    for block in range(blocks):
        for name, way in ways.items():
            say(name.replace("_", ", processes: "), block, blocks)
            found[name].append(way())
    say("overhead")
    short = _pooled([_task(ssp, seed, 0.02) for seed in range(runs)], 1)
    scaling = [b / a for a, b in zip(found["campaign_1"], found["campaign_2"], strict=True)]
    theirs = [b / a for a, b in zip(found["independent_1"], found["independent_2"], strict=True)]
    return {
        "runs_per_second": {name: median(values) for name, values in found.items()},
        "scaling": median(scaling),
        "scaling_independent": median(theirs),
        "scaling_ratio": median(a / b for a, b in zip(scaling, theirs, strict=True)),
        "overhead_ms": 1e3 / _rate(short),
    }


def missed(figures: dict[str, Any]) -> list[str]:
    """The musts that the figures do not meet, in words."""
    found = []
    if figures["scaling_ratio"] < LEAST_SCALING:
        found.append(f"scaling_ratio = {figures['scaling_ratio']:.3g}, must be at least {LEAST_SCALING:g}")
    if figures["overhead_ms"] > MOST_OVERHEAD_MS:
        found.append(f"overhead_ms = {figures['overhead_ms']:.3g}, must be at most {MOST_OVERHEAD_MS:g}")
    return found


def _task(ssp: str, seed: int, stop_s: float) -> Task:
    spec = {
        "scenario": "four_targets_unknown",
        "source": "four_targets_unknown",
        "system": "nominal",
        "draw": "nominal",
        "fault": "no-fault",
        "controller": "pi",
        "seed": seed,
        "faults": [],
        "machine": {},
        "parameters": {},
        "stop_s": stop_s,
    }
    return {"key": str(seed), "digest": "", "spec": spec, "ssp": ssp}


def timed(tasks: Sequence[Task]) -> list[Result]:
    """`work`, each result with its batch's begin and end on the clock that all processes share."""
    began = time.monotonic()
    results = work(tasks)
    ended = time.monotonic()
    return [r | {"began": began, "ended": ended} for r in results]


def _rate(results: Iterable[Result]) -> float:
    """Runs per second between the first begin and the last end, batches that fill caches left out."""
    known = sorted(results, key=lambda r: r["began"])
    settled = [r for r in known if r["began"] > known[0]["ended"]] or known
    return len(settled) / (max(r["ended"] for r in settled) - min(r["began"] for r in settled))


def _pooled(tasks: Sequence[Task], jobs: int) -> list[Result]:
    return [r for results in pool.local(tasks, jobs, timed) for r in results]


def _independent(shares: Sequence[Sequence[Task]]) -> list[Result]:
    context = get_context("spawn")
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / str(i) for i in range(len(shares))]
        processes = [
            context.Process(target=_share, args=(share, str(file)))
            for share, file in zip(shares, files, strict=True)
        ]
        for process in processes:
            process.start()
        for process in processes:
            process.join()
        return [r for file in files for r in _read(file)]


def _share(tasks: Sequence[Task], path: str) -> None:
    """A process of its own: batches as the pool's, so that both pay alike for measuring."""
    warm_up()
    results = [r for i in range(0, len(tasks), pool.BATCH) for r in timed(tasks[i : i + pool.BATCH])]
    Path(path).write_text(json.dumps(results))


def _read(path: Path) -> list[Result]:
    return json.loads(path.read_text())
