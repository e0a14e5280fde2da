"""Scenes × controllers × machines in processes of their own; rows are kept as they come, and gone on from."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from baselines.following import follower
from baselines.planning.legs import Legs
from baselines.planning.planner import Planner
from orchestrator.run.processes import interrupts_held, warm_up
from records.figures_file import make_folder
from specs.progress import Report
from specs.scene import Scene
from specs.schema import ROOT
from verification.scenes import best, kept, run as runs
from verification.scenes.run import GUARDED, Case, Guarding
from verification.scenes.score import PICTURE, SAMPLES, guarded, score, summary

ROWS = "rows.jsonl"
PACKAGES = ("coal", "ompl", "toppra")
# Whose sources decide what runs give
ROOMS = ("specs", "fmus", "orchestrator", "runtime", "baselines", "verification", "deployment")
Machines = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Job:
    """All machines of one scene with one controller: the plan is made once."""

    scene: Scene
    controller: str
    machines: Machines
    seed: int
    guarding: Guarding | None = None
    records: Path | None = None  # folder of what is kept of each run

    def cases(self) -> Iterator[Case]:
        """The runs."""
        for name, drawn in self.machines.items():
            yield Case(self.scene, self.controller, name, drawn, self.seed, self.guarding)

    @property
    def label(self) -> str:
        """What progress calls it."""
        return f"{self.controller} in {self.scene.name}"

    @property
    def asked(self) -> str:
        """What its rows are an answer to."""
        return f"{self.scene!r}|{self.controller}|{sorted(self.machines)}|{self.seed}"

    def rows(self) -> list[dict[str, Any]]:
        """A row of each machine; the first one can be drawn."""
        rows = []
        for case in self.cases():
            ran = runs.run(case)
            if self.records is not None:
                kept.keep(self.records, ran)
            row = score(ran)
            rows.append({k: v for k, v in row.items() if not rows or k != PICTURE})
        return rows

    def complete(self, rows: Sequence[Mapping[str, Any]] | None) -> bool:
        """Whether there are rows, and all that is to be kept of the runs that were driven."""
        if rows is None or self.records is None:
            return rows is not None
        pairs = zip(self.cases(), rows, strict=True)
        return all(kept.there(self.records, case) for case, row in pairs if row["driven"])


@dataclass(frozen=True)
class Optimum:
    """The best cycle time of one scene."""

    scene: Scene
    seed: int

    @property
    def label(self) -> str:
        """What progress calls it."""
        return f"optimum of {self.scene.name}"

    @property
    def asked(self) -> str:
        """What its row is an answer to."""
        return f"{self.scene!r}|optimum|{self.seed}"

    def rows(self) -> list[dict[str, Any]]:
        """One row."""
        return [best.best(self.scene, self.seed)]

    def complete(self, rows: Sequence[Mapping[str, Any]] | None) -> bool:
        """Whether it is known."""
        return rows is not None


def check_controllers(controllers: Sequence[str]) -> None:
    """Raise InputError for an unknown controller, ModuleNotFoundError for a package that runs will need."""
    for package in PACKAGES:
        import_module(package)
    for controller in controllers:
        runs.check(controller)


def check_scenes(scenes: Sequence[Scene], guarding: Guarding | None = None) -> None:
    """Raise InputError for a scene that machine or guard do not fit into, before anything runs."""
    for scene in scenes:
        Legs(Planner(scene)).check()
        if guarding:
            guarding(scene)


def study(
    scenes: Sequence[Scene], controllers: Sequence[str], machines: Machines, seed: int, jobs: int, out: Path,
    report: Report, guarding: Guarding | None = None, records: Path | None = None, optimum: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """The figures: of each controller, with a guard of each with and without it, and every row.

    With `optimum` cycle times are held against the best that optimal control finds.
    """
    make_folder(out)
    kinds = ("", GUARDED) if guarding else ("",)
    controllers = [f"{c}{kind}" for c in controllers for kind in kinds]
    asked = [
        Job(scene, c, machines, seed, guarding if c.endswith(GUARDED) else None, records)
        for c in controllers
        for scene in scenes
    ]
    bests = [Optimum(scene, seed) for scene in scenes] if optimum else []
    known = _known(out / ROWS)
    missing = [job for job in (*asked, *bests) if not job.complete(known.get(_key(job)))]
    with ProcessPoolExecutor(jobs, get_context("spawn"), initializer=warm_up) as pool:
        try:
            with interrupts_held():  # the processes start here, and inherit it
                waiting = {pool.submit(_run, job): job for job in missing}
            for number, done in enumerate(as_completed(waiting), 1):
                job = waiting[done]
                known[_key(job)] = done.result()
                with (out / ROWS).open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"key": _key(job), "rows": known[_key(job)]}) + "\n")
                report(job.label, number, len(missing))
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    rows = {c: [row for job in asked if job.controller == c for row in known[_key(job)]] for c in controllers}
    least = {job.scene.name: known[_key(job)][0]["seconds"] for job in bests}
    return {
        "controllers": _figures(rows, least),
        **({"optima": least} if optimum else {}),
        "labels": {c: label(c) for c in controllers},
        PICTURE: [row for of in rows.values() for row in of if PICTURE in row],
        "rows": [
            {name: value for name, value in row.items() if name not in (SAMPLES, PICTURE)}
            for of in rows.values()
            for row in of
        ],
    }


def label(controller: str) -> str:
    """What tables call a controller."""
    known = follower.KINDS
    if controller in known:
        return known[controller].label
    if controller.endswith(GUARDED):
        return f"{label(controller.removesuffix(GUARDED))}, the guard behind it"
    led = controller.endswith(runs.LED)
    return "its target moved along the planned path" if led else "straight to the target, blind to the scene"


def _figures(
    rows: Mapping[str, Sequence[Mapping[str, Any]]], least: Mapping[str, float | None]
) -> dict[str, dict[str, Any]]:
    """Of each controller and its families; of those that were also guarded, what the guard did to them."""
    figures = {c: {**_summary(of, least), "families": _families(of, least)} for c, of in rows.items()}
    for c in [c for c in figures if f"{c}{GUARDED}" in figures]:
        behind = figures[f"{c}{GUARDED}"]
        figures[c] |= guarded(figures[c], behind)
        for family, found in figures[c]["families"].items():
            found |= guarded(found, behind["families"][family])
    return figures


def _summary(rows: Sequence[Mapping[str, Any]], least: Mapping[str, float | None]) -> dict[str, Any]:
    return {**summary(rows), **(best.ratios(rows, least) if least else {})}


def _families(rows: Sequence[Mapping[str, Any]], least: Mapping[str, float | None]) -> dict[str, Any]:
    names = sorted({row["family"] for row in rows})
    return {name: _summary([row for row in rows if row["family"] == name], least) for name in names}


def _run(job: Job | Optimum) -> list[dict[str, Any]]:
    """Its rows, in a process of the pool: only here may Ctrl-C interrupt it."""
    with interrupts_held("SIG_UNBLOCK"):
        return job.rows()


def _known(path: Path) -> dict[str, list[dict[str, Any]]]:
    """Rows of an earlier call, by key; a line that was cut off is left out."""
    found = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else ():
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue
        found[entry["key"]] = entry["rows"]
    return found


def _key(job: Job | Optimum) -> str:
    """The same for the same question and the same sources."""
    return hashlib.sha256(f"{_sources()}|{job.asked}".encode()).hexdigest()[:16]


_digest: dict[str, str] = {}


def _sources() -> str:
    """A digest of what decides the runs."""
    if "" not in _digest:
        found = hashlib.sha256()
        for room in ROOMS:
            for path in sorted((ROOT.parent / room).rglob("*")):
                if path.suffix in (".py", ".toml", ".c", ".h") and "__pycache__" not in path.parts:
                    found.update(path.read_bytes())
        _digest[""] = found.hexdigest()
    return _digest[""]
