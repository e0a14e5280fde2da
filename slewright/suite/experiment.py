"""Ambiguous cases after the experiment that the workflow proposed: run on the hidden machine, answered again.

experiment.csv, experiment.toml   the proposal, kept beside report.json
after.json                        the answer to the recordings and the new one together
"""

import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from blindtest import case as cases, extra as extras
from blindtest.score import read_truth
from blindtest.systems.system import STEP
from records.formats import read_measurement
from slewright.suite import child, work
from slewright.suite.proposal import TABLE

RUN = "run_experiment.parquet"


def settle(folder: Path, visible: int | None, outside: bool) -> dict[str, Any] | None:
    """What became of an ambiguous case after its experiment; None for a case that was not ambiguous.

    {"proposed", "predicted_margin", "verdict", "result", "seconds"}: `result` is the contract's word for the
    second answer.  `visible`, `outside`: as the case was drawn with.
    """
    report = json.loads((folder / "report.json").read_text())
    if report["verdict"] != "ambiguous":
        return None
    proposal = report.get("next_experiment") or {}
    if not proposal.get("plan") or not (folder / TABLE).is_file():
        return {"proposed": False, "predicted_margin": proposal.get("predicted_margin")}
    told = json.loads((folder / "given" / "case.json").read_text())
    truth = read_truth(folder / "sealed" / "truth.json", told["truth_sha256"])
    path = folder / "after.json"
    if not path.is_file():
        content = truth.content
        case = cases.draw(content["seed"], content["noise"], content["system"], visible, outside)
        start = proposal["excitation"]["start"]
        run = extras.extra(case, _commands(folder / TABLE, proposal["duration_s"]), start)
        work.write(path, _answer(folder, case, run, told))
    after = json.loads(path.read_text())
    found = {"proposed": True, "predicted_margin": proposal["predicted_margin"]}
    return found | work.scored(truth, after)


def _commands(path: Path, duration_s: float) -> dict[str, np.ndarray]:
    """The inputs of a proposal, held from one row of its table to the next, every STEP."""
    measured = read_measurement(path)
    time = STEP * np.arange(round(duration_s / STEP))
    found = {}
    for name, channel in measured.channels.items():
        at = np.searchsorted(channel.time, time + 1e-6, side="right") - 1
        found[name] = channel.values[np.clip(at, 0, None)]
    return found


def _answer(folder: Path, case: cases.Case, run: cases.Recorded, told: Mapping[str, Any]) -> dict[str, Any]:
    """Answer the recordings and the new run, far from the truth."""
    with tempfile.TemporaryDirectory(prefix="reconcile-") as room:
        given = Path(room) / "given"
        shutil.copytree(folder / "given", given)
        extras.write(case, run, given / RUN)
        command = ["-m", "slewright", "reconcile", RUN, *told["runs"], "--model", work.model(told["model"])]
        ended = child.run([*command, "--out", "../out", "--report-only"], given)
        report = Path(room) / "out" / "report.json"
        content = work.FAILED | {"failed": ended.said or f"ended with {ended.code}"}
        if report.is_file():
            content = json.loads(report.read_text())
        return content | {"core_seconds": ended.seconds}
