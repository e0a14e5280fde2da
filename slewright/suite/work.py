"""One case of the suite: drawn, answered, scored.  What is done is a file in the case's folder.

given/         recordings, plain model, case.json with the hash of the truth
sealed/        truth.json
report.json    the workflow's answer (or failed.json: how it ended)
result.json    the score; is there when the case is done
"""

import json
import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from blindtest import case as cases, folder as folders
from blindtest.score import Truth, read_truth, score
from slewright.suite import child, measures
from specs.errors import RunError

REDRAWS = 3  # seeds that are tried where one gives no clear case
FAILED = {"verdict": "failed", "effects": [], "alternatives": [], "gap": {}}
PARTS = ("report.json", "failed.json", "result.json")
Task = dict[str, Any]  # key, ssp (its system, for the pool), digest, folder, seed, noise, visible, baselines


def work(tasks: Sequence[Task]) -> list[dict[str, Any]]:
    """Do cases one after the other; results are in their folders and returned."""
    return [_one(task) for task in tasks]


def _one(task: Task) -> dict[str, Any]:
    folder = Path(task["folder"])
    if task["again"]:
        for name in PARTS:
            (folder / name).unlink(missing_ok=True)
    if not (folder / "given").is_dir():
        _draw(task, folder)
    _answer(folder)
    result = {"key": task["key"], "digest": "", "failed": "", **_result(folder)}
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
    visible = {"drawn": None, "none": 0, "outside": 1}[task["visible"]]
    for more in range(REDRAWS):
        try:
            seed = task["seed"] + more
            outside = task["visible"] == "outside"
            return cases.draw(seed, task["noise"], task["ssp"], visible, outside)
        except RunError:
            if more == REDRAWS - 1:
                raise
    raise AssertionError("never here")


def _answer(folder: Path) -> None:
    """Run the workflow in a folder of its own, far from the truth, unless that is done."""
    if (folder / "report.json").is_file():
        return
    with tempfile.TemporaryDirectory(prefix="reconcile-") as room:
        given = Path(room) / "given"
        shutil.copytree(folder / "given", given)
        told = json.loads((given / "case.json").read_text())
        arguments = ["-m", "slewright", "reconcile", *told["runs"], "--model", model(told["model"])]
        ended = child.run([*arguments, "--out", "../out", "--report-only"], given)
        report = Path(room) / "out" / "report.json"
        if report.is_file():
            content = json.loads(report.read_text())
            write(folder / "report.json", content | {"core_seconds": ended.seconds})
        else:
            write(folder / "failed.json", FAILED | {"core_seconds": ended.seconds, "failed": ended.said})


def model(told: str) -> str:
    """What --model is given: the folder beside the recordings, or the name of a model of the project."""
    return told if told == "model" else Path(told).stem


def _result(folder: Path) -> dict[str, Any]:
    told = json.loads((folder / "given" / "case.json").read_text())
    truth = read_truth(folder / "sealed" / "truth.json", told["truth_sha256"])
    path = folder / "report.json"
    report = json.loads((path if path.is_file() else folder / "failed.json").read_text())
    content = truth.content
    return {
        "truth_sha256": told["truth_sha256"],
        "system": content["system"],
        "seed": content["seed"],
        "redrawn": content["redrawn"],
        "visible": content["visible"],
        "outside": truth.outside,
        "equivalents": [sorted(s) for s in truth.equivalents],
        "verdict": report["verdict"],
        "seconds": report["core_seconds"],
        "draw_seconds": json.loads((folder / "drawn.json").read_text())["seconds"],
        "workflow_failed": report.get("failed", ""),
        **scored(truth, report),
        **measures.of_report(content, report),
    }


def scored(truth: Truth, report: Mapping[str, Any]) -> dict[str, Any]:
    """The contract's score of an answer; a workflow that failed abstains."""
    found = score(truth, report)
    return {
        "result": "abstained" if report["verdict"] == "failed" else found.result,
        "named": [list(names) for names in found.named],
        "false_positive": found.false_positive,
        "unambiguous": found.unambiguous,
    }


def write(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON whole or not at all."""
    part = path.with_name(path.name + ".part")
    part.parent.mkdir(parents=True, exist_ok=True)
    part.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    part.replace(path)
