"""Every wiring fault in the simulated machine, one after the other: which step finds it, and by what.

A case runs the steps that look at wiring on a machine of its own until one fails.  Cases are independent:
they go to worker processes, each with the seed of the session, and what is done is kept for a later
`--resume`.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from deployment.commissioning.bench import Bench, Failed
from deployment.commissioning.procedure import WIRING, find
from deployment.commissioning.rig import Rig
from deployment.commissioning.simulated import SimulatedMachine, SimulatedOperator
from deployment.commissioning.wiring import Fault
from orchestrator.run.processes import warm_up
from records.figures_file import write_text
from records.report.markers import fill
from runtime.bundle import load
from runtime.policy import open_core
from specs.progress import Report

FILE = "wiring.json"


@dataclass(frozen=True)
class Case:
    """A fault and what became of it; `step` and `check` are of the first failure."""

    name: str
    group: str
    found: bool
    step: str = ""
    check: str = ""
    seconds: float = 0.0  # of machine time, until it was found


def run_case(bundle: Path, fault: Fault, seed: int = 1, which: str = "nominal", blind: bool = False) -> Case:
    """One case; with `blind`, an operator who sees nothing and says yes."""
    with SimulatedMachine((fault,), seed, which) as machine:
        rig = Rig(open_core(load(bundle)), machine, machine, simulated=True)
        operator, before = SimulatedOperator(machine, blind), {}
        for name in WIRING:
            bench = Bench(rig, operator, before)
            try:
                find(name).run(bench)
            except Failed:
                failed = next(c for c in bench.checks if not c.passed)
                return Case(fault.name, fault.group, True, name, str(failed), rig.tick * 0.02)
            bench.neutral()
            before[name] = bench.found
    return Case(fault.name, fault.group, False)


def run(
    bundle: Path,
    faults: Sequence[Fault],
    folder: Path,
    report: Report,
    seed: int = 1,
    which: str = "nominal",
    workers: int = 1,
) -> list[Case]:
    """All cases, in the order of `faults`; those in the folder's file are not run again."""
    done = _read(folder / FILE, seed, which)
    left = [f for f in faults if f.name not in done]
    for case in _cases(bundle, left, seed, which, workers):
        done[case.name] = case
        report(f"wiring: {case.name}", len(done), len(faults))
        head = {"seed": seed, "machine": which}
        write_text(
            folder / FILE, json.dumps({**head, "cases": [asdict(c) for c in done.values()]}, indent=1) + "\n"
        )
    return [done[f.name] for f in faults]


def _cases(bundle: Path, faults: Sequence[Fault], seed: int, which: str, workers: int) -> Iterator[Case]:
    if workers <= 1:
        yield from (run_case(bundle, fault, seed, which) for fault in faults)
        return
    with ProcessPoolExecutor(workers, get_context("spawn"), initializer=warm_up) as pool:
        waiting = [pool.submit(run_case, bundle, fault, seed, which) for fault in faults]
        try:
            for one in as_completed(waiting):
                yield one.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _read(path: Path, seed: int, which: str) -> dict[str, Case]:
    if not path.is_file():
        return {}
    data = json.loads(path.read_text(encoding="utf-8"))
    if (data.get("seed"), data.get("machine")) != (seed, which):
        return {}
    return {case["name"]: Case(**case) for case in data["cases"]}


def by_group(cases: Sequence[Case]) -> dict[str, dict[str, Any]]:
    """How many of each kind were injected and found, and in which steps."""
    groups: dict[str, dict[str, Any]] = {}
    for case in cases:
        row = groups.setdefault(case.group, {"injected": 0, "found": 0, "steps": {}})
        row["injected"] += 1
        row["found"] += case.found
        if case.found:
            row["steps"][case.step] = row["steps"].get(case.step, 0) + 1
    return groups


def steps_of(row: Mapping[str, Any]) -> str:
    """In which steps, in their order."""
    return ", ".join(f"{step} {row['steps'][step]}" for step in WIRING if step in row["steps"])


def markdown(path: Path, cases: Sequence[Case], seed: int, version: str) -> None:
    """Fill the table in a document."""
    rows = [
        f"| {group} | {row['injected']} | {row['found']} | {steps_of(row)} |"
        for group, row in by_group(cases).items()
    ]
    head = f"Version {version}, seed {seed}, simulated reference machine; found by which step:\n\n"
    table = ["| wired wrong | injected | found | by step |", "|---|--:|--:|---|", *rows]
    fill(path, "wiring", head + "\n".join(table) + "\n")
