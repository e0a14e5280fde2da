"""One case of the suite: drawn, answered, scored.  What is done is a file in the case's folder.

given/         recordings, plain model, case.json with the hash of the truth
sealed/        truth.json
report.json    the workflow's answer (or how it failed)
after.json     of an ambiguous case: the answer after its proposed experiment
result.json    the score; is there when the case is done
"""

import json
import shutil
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.suite import child, measures
from benchmarks.suite.answers import FAILED, code, model, scored, write
from benchmarks.suite.experiment import AFTER, settle
from benchmarks.suite.membership import completed
from benchmarks.suite.proposal import keep
from blindtest import case as cases, folder as folders
from blindtest.score import read_truth
from specs.errors import RunError

REDRAWS = 3  # seeds that are tried where one gives no clear case
PLAIN = ("sindy", "greedy_bic")
PARTS = ("report.json", "result.json", AFTER, *(f"{name}.json" for name in PLAIN))
# key, ssp (for the pool), system, digest, folder, seed, noise, visible, baselines, experiments, again
Task = dict[str, Any]


def work(tasks: Sequence[Task]) -> list[dict[str, Any]]:
    """Do cases one after the other; results are in their folders and returned."""
    return [_one(task) for task in tasks]


def _one(task: Task) -> dict[str, Any]:
    folder = Path(task["folder"])
    if task["again"]:
        for name in PARTS:
            (folder / name).unlink(missing_ok=True)
    try:
        if not (folder / "given").is_dir():
            _draw(task, folder)
    except RunError as error:
        return {"key": task["key"], "digest": "", "failed": str(error)}
    told = json.loads((folder / "given" / "case.json").read_text())
    recorded, named = told["runs"], model(told["model"])
    command = ["slewright", "reconcile", *recorded, "--model", named, "--out", "../out", "--report-only"]
    _answer(folder, "report", command)
    for method in PLAIN if task["baselines"] else ():
        _answer(folder, method, ["reconcile.plain", method, named, "../out", *recorded])
    result = {"key": task["key"], "digest": "", "failed": "", **_result(task, folder, told["truth_sha256"])}
    write(folder / "result.json", result)
    return result


def _draw(task: Task, folder: Path) -> None:
    """Draw the case and write it whole: folder appears when everything is in it."""
    began = time.process_time()
    part = folder.with_name(folder.name + ".part")
    shutil.rmtree(part, ignore_errors=True)
    drawn = _clear(task)
    folders.write(drawn, part / "given", part / "sealed")
    write(part / "drawn.json", {"seconds": time.process_time() - began})
    part.replace(folder)


def _clear(task: Task) -> cases.Case:
    """The case of a task: the first of its seeds that gives a clear one."""
    visible = {"drawn": None, "none": 0, "outside": 1}[task["visible"]]
    for more in range(REDRAWS):
        try:
            seed = task["seed"] + more
            outside = task["visible"] == "outside"
            return cases.draw(seed, task["noise"], task["system"], visible, outside)
        except RunError:
            if more == REDRAWS - 1:
                raise
    raise AssertionError("never here")


def _answer(folder: Path, name: str, command: Sequence[str]) -> None:
    """Run `python -m COMMAND` in a folder of its own, far from the truth, unless NAME.json is there.

    What failed is tried again by the next go.
    """
    path = folder / f"{name}.json"
    if path.is_file() and not json.loads(path.read_text()).get("failed"):
        return
    with tempfile.TemporaryDirectory(prefix="reconcile-") as room:
        given = Path(room) / "given"
        shutil.copytree(folder / "given", given)
        ended = child.run(["-m", *command], given)
        report = Path(room) / "out" / "report.json"
        content = FAILED | {"failed": ended.said or f"ended with {ended.code}"}
        if report.is_file():
            content = json.loads(report.read_text())
        if name == "report":
            keep(report.parent, folder)
        write(path, content | {"core_seconds": ended.seconds, "code": code()})


def _result(task: Task, folder: Path, sha256: str) -> dict[str, Any]:
    sealed = read_truth(folder / "sealed" / "truth.json", sha256)
    content = sealed.content
    report = json.loads((folder / "report.json").read_text())
    truth = completed(sealed, report, folder / "sealed", lambda: _clear(task))
    after = settle(folder, truth, lambda: _clear(task)) if task["experiments"] else None
    return {
        "truth_sha256": sha256,
        "system": content["system"],
        "seed": content["seed"],
        "redrawn": content["redrawn"],
        "visible": content["visible"],
        "outside": truth.outside,
        "equivalents": [sorted(s) for s in truth.equivalents],
        "equivalents_added": len(truth.equivalents) - len(sealed.equivalents),
        "draw_seconds": json.loads((folder / "drawn.json").read_text())["seconds"],
        **scored(truth, report),
        **measures.of_report(content, report),
        "claims": measures.claims([content["visible"], *truth.equivalents], report),
        "experiment": after,
        "baselines": {
            name: scored(truth, json.loads(path.read_text()))
            for name in PLAIN
            if (path := folder / f"{name}.json").is_file()
        },
    }
