"""Ambiguous cases after the experiment that the workflow proposed: run on the hidden machine, answered again.

experiment.csv, experiment.toml   the proposal, kept beside report.json
after.json                        the answer to the recordings and the new one together
"""

import json
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.suite import answers, child
from benchmarks.suite.proposal import TABLE
from blindtest import case as cases, extra as extras
from blindtest.score import Truth
from blindtest.systems.system import STEP
from records.formats import read_measurement

RUN = "run_experiment.parquet"
AFTER, BEFORE = "after.json", "before.json"


def settle(folder: Path, truth: Truth, drawn: Callable[[], cases.Case]) -> dict[str, Any] | None:
    """What became of an ambiguous case after its experiment; None for a case that was not ambiguous.

    {"proposed", "predicted_margin", "separable", "sentence", "pairs", "verdict", "result", "seconds", ...}:
    `result` is the contract's word for the second answer; `pairs` hold predicted and achieved margins, and
    whether one was `promised`; `separable`: for all of them.  `drawn` draws the case again.
    """
    report = json.loads((folder / "report.json").read_text())
    if report["verdict"] != "ambiguous":
        return None
    proposal = report.get("next_experiment") or {}
    found = {k: proposal.get(k) for k in ("predicted_margin", "separable", "sentence")}
    if not proposal.get("plan") or not (folder / TABLE).is_file():
        return found | {"proposed": False, "pairs": [_told(p) for p in proposal.get("pairs", ())]}
    told = json.loads((folder / "given" / "case.json").read_text())
    path = folder / AFTER
    if not path.is_file() or json.loads(path.read_text()).get("failed"):
        case = drawn()
        start = proposal["excitation"]["start"]
        run = extras.extra(case, _commands(folder / TABLE, proposal["duration_s"]), start)
        answers.write(path, _answer(folder, case, run, told))
    after = json.loads(path.read_text())
    pairs = (after.get("experiment") or proposal)["pairs"]
    return found | {"proposed": True, "pairs": [_told(p) for p in pairs]} | answers.scored(truth, after)


def _told(p: Mapping[str, Any]) -> dict[str, Any]:
    """A pair of alternatives with its margins."""
    names = ("one", "other", "predicted_margin", "achieved_margin")
    return {k: p.get(k) for k in names} | {"promised": bool(p.get("promised"))}


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
        shutil.copy(folder / "report.json", Path(room) / BEFORE)
        command = [
            "-m",
            "slewright",
            "reconcile",
            RUN,
            *told["runs"],
            "--model",
            answers.model(told["model"]),
        ]
        ended = child.run([*command, "--before", f"../{BEFORE}", "--out", "../out", "--report-only"], given)
        report = Path(room) / "out" / "report.json"
        content = answers.FAILED | {"failed": ended.said or f"ended with {ended.code}"}
        if report.is_file():
            content = json.loads(report.read_text())
        return content | {"core_seconds": ended.seconds}
