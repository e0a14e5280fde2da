"""The pack on all masters: what came of each case, as one word each."""

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.testpack import ours
from benchmarks.testpack.case import Case
from benchmarks.testpack.masters import MASTERS, PACKAGES
from benchmarks.testpack.pack import write

RIGHT = "right"  # the values are right; or it is refused, and what is wrong is named
REFUSED = "refused"  # a system that is right is not taken
UNNAMED = "unnamed"  # what is wrong is refused, but not named
WRONG = "wrong"  # it runs, says nothing, and the values are wrong; or what is wrong is accepted
CRASHED = "crashed"  # its process ended
HUNG = "hung"
UNSEEN = "unseen"  # it ran, but its interface does not show the values
IDLE = "—"  # not asked
MISSING = "not installed"

ROOT = Path(__file__).parents[2]
Row = dict[str, Any]
Progress = Callable[[str], None]


def outcomes(cases: Iterable[Case], progress: Progress = lambda _: None) -> dict[str, dict[str, Row]]:
    """For each master, this project's first: case -> {"verdict", "message"}."""
    chosen = list(cases)
    progress("slewright")
    found = {"slewright": {case.name: _ours(case) for case in chosen}}
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder), chosen)
        for key in MASTERS:
            progress(key)
            found[key] = of_master(key, chosen, Path(folder))
    return found


def versions() -> dict[str, str]:
    """Of the masters' packages; "" where one is not installed."""
    return {key: _version(package) for key, package in PACKAGES.items()}


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def _ours(case: Case) -> Row:
    problem = ours.judge(case)
    if not problem:
        return {"verdict": RIGHT, "message": ""}
    if "does not name" in problem:
        return {"verdict": UNNAMED, "message": problem}
    refused = case.kind == "right" and problem.startswith(("InputError", "RunError"))
    return {"verdict": REFUSED if refused else WRONG, "message": problem}


def of_master(key: str, cases: list[Case], folder: Path) -> dict[str, Row]:
    if not _version(PACKAGES[key]):
        return {case.name: {"verdict": MISSING, "message": ""} for case in cases}
    asked = [case for case in cases if not _idle(case)]
    command = [sys.executable, "-m", "benchmarks.testpack.masters", key, str(folder)]
    names = "".join(f"{case.name}\n" for case in asked)
    done = subprocess.run(command, cwd=ROOT, input=names, capture_output=True, text=True, check=True)
    answers = dict(zip((c.name for c in asked), map(json.loads, done.stdout.splitlines()), strict=True))
    verdicts = {
        c.name: judged(c, answers[c.name]) if c.name in answers else {"verdict": IDLE, "message": ""}
        for c in cases
    }
    for c in cases:
        plain = verdicts.get(f"plain-fmi{c.fmi_version}")
        if plain and plain["verdict"] != RIGHT and c.kind != "right":  # all is refused: an error is no merit
            verdicts[c.name] = {"verdict": IDLE, "message": f"no system of FMI {c.fmi_version} is taken"}
    return verdicts


def _idle(case: Case) -> bool:
    """Whether other masters cannot be asked."""
    return case.own or "slw:Component" in case.package.ssd or case.times == (0.0,)


def named(case: Case, message: str) -> bool:
    """Whether a message names what it must, in its own manner of writing: b.u may be b::u, or gain.fmu/u."""
    sources = dict(re.findall(r'<ssd:Component name="([^"]*)" source="(?:resources/)?([^".]*)', case.ssd))
    words = set(re.findall(r"[\w-]+(?:\.[a-z]{3})?|[\w.-]+", message))
    words |= {part for word in words for part in word.split(".")}

    def said(part: str) -> bool:
        return part in words or sources.get(part, part) in words

    return all(all(map(said, _parts(name))) or name in message for name in case.names)


def _parts(name: str) -> list[str]:
    name = name.strip("'").removeprefix("component ")
    return [name] if re.search(r"\.(fmu|ss.|txt|xml)$", name) else name.split(".")


def judged(case: Case, answer: Mapping[str, Any]) -> Row:
    """The verdict on what a master did with a case; its last values count."""
    outcome, message = answer["outcome"], answer.get("message", "")
    if outcome in (CRASHED, HUNG):
        return {"verdict": outcome, "message": message}
    if outcome != "ran":
        return {"verdict": _of_error(case, message), "message": message}
    if case.kind != "right":
        return {"verdict": WRONG, "message": "it ran to its end and said nothing"}
    return _of_values(case, answer["values"])


def _of_error(case: Case, message: str) -> str:
    if case.kind == "right":
        return REFUSED
    if case.kind == "ends":
        return RIGHT
    return RIGHT if named(case, message) else UNNAMED


def _of_values(case: Case, values: Mapping[str, float]) -> Row:
    last = case.checked_times[-1:]
    for name in case.expect:
        if name not in values:
            return {"verdict": UNSEEN, "message": f"{name} cannot be read"}
        wanted = float(case.values(name, last)[0])
        if not np.abs(values[name] - wanted) <= case.tolerance:
            return {"verdict": WRONG, "message": f"{name} = {values[name]:.6g}, expected {wanted:.6g}"}
    return {"verdict": RIGHT, "message": ""}
