"""One rig: reconcile in a child process with a limit of processor time, and what its answer is worth."""

import json
import os
import resource
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from specs.errors import InputError, nearest
from specs.schema import read_toml

ROOT = Path(__file__).resolve().parents[2]

CPU_S = 300.0
SURE = 0.9  # probability of a kind from which on it counts as named
GOOD = ("right", "kind_right")
KEYS = {"data", "fit", "confirm", "holdout", "map", "model", "null_model", "truth", "kind", "also"}
NEEDED = ("data", "fit", "model", "truth")


@dataclass(frozen=True)
class Rig:
    """Recordings and a model; `truth`: names that are right, none for a null control."""

    name: str
    fit: tuple[Path, ...]
    model: Path
    truth: tuple[str, ...]
    kind: str = ""
    confirm: tuple[Path, ...] = ()
    holdout: tuple[Path, ...] = ()
    names: Path | None = None
    also: tuple[str, ...] = ()  # what these recordings show whatever the model

    def command(self, out: Path) -> list[str]:
        """The command line of its reconcile."""
        found = [sys.executable, "-m", "slewright", "reconcile", *map(str, self.fit)]
        found += ["--model", str(self.model), "--out", str(out), "--report-only"]
        for option, paths in (("--confirm", self.confirm), ("--holdout", self.holdout)):
            found += [a for p in paths for a in (option, str(p))]
        return found + (["--map", str(self.names)] if self.names else [])


def read_rigs(file: Path, only: Sequence[str] = ()) -> list[Rig]:
    """The rigs of a table, each followed by its null control; InputError for one that is not complete."""
    tables = read_toml(file)
    found = [rig for name, t in tables.items() for rig in _rig(file, name, t)]
    for name in only:
        if name not in tables:
            raise InputError(f"--only {name}: {nearest(name, tables)}")
    return [r for r in found if not only or r.name.partition("/")[0] in only]


def _rig(file: Path, name: str, t: Any) -> list[Rig]:
    where = f"{file}: [{name}]"
    if not isinstance(t, dict):
        raise InputError(f"{where}: write a table")
    if wrong := sorted(set(t) - KEYS):
        raise InputError(f"{where}: unknown key '{wrong[0]}'; {nearest(wrong[0], KEYS)}")
    if missing := [k for k in NEEDED if k not in t]:
        raise InputError(f"{where}: no '{missing[0]}'")
    data = ROOT / t["data"]
    sets: dict[str, Any] = {k: tuple(data / f for f in t.get(k, ())) for k in ("fit", "confirm", "holdout")}
    names = file.parent / t["map"] if "map" in t else None
    also = tuple(t.get("also", ()))
    rig = Rig(
        name,
        model=file.parent / t["model"],
        truth=tuple(t["truth"]),
        kind=t.get("kind", ""),
        names=names,
        also=also,
        **sets,
    )
    null = (
        [Rig(f"{name}/null", model=file.parent / t["null_model"], truth=(), names=names, also=also, **sets)]
        if ("null_model" in t)
        else []
    )
    for path in [
        *sets["fit"],
        *sets["confirm"],
        *sets["holdout"],
        *(r.model / "model.py" for r in (rig, *null)),
    ]:
        if not path.is_file():
            raise InputError(f"{where}: there is no {path}")
    return [rig, *null]


def run_rig(rig: Rig, cpu_s: float = CPU_S) -> dict[str, Any]:
    """Reconcile a rig and judge the answer."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        code, used, said = _child(rig.command(out), cpu_s, Path(folder))
        file = out / "report.json"
        report = json.loads(file.read_text(encoding="utf-8")) if code == 0 and file.is_file() else None
    answer = [e["name"] for e in report["effects"]] if report else []
    return {
        "truth": list(rig.truth),
        "answer": answer,
        "class": judged(rig, code, used >= 0.98 * cpu_s, report),
        "verdict": report["verdict"] if report else None,
        "cpu_s": used,
        "gap": report["gap"] if report else {},
        "said": _error(said) if report is None else "",
    }


def _error(said: str) -> str:
    """What the command line said was wrong, without its progress."""
    lines = [line for line in said.splitlines() if line.startswith("slewright:")]
    return (lines or said.strip().splitlines() or [""])[-1]


def _child(command: Sequence[str], cpu_s: float, folder: Path) -> tuple[int, float, str]:
    """Exit code, processor time of the process and its children, and its error output.

    The limit holds for each process; what it computes in several is bounded by their sum afterwards.
    """
    most = int(cpu_s) + 1

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (most, most + 5))

    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with (folder / "stderr").open("w+", encoding="utf-8") as errors:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        child = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, stderr=errors, preexec_fn=limit
        )
        code = child.wait()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        errors.seek(0)
        said = errors.read()
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return code, used, said


def judged(rig: Rig, code: int, late: bool, report: Mapping[str, Any] | None) -> str:
    """right, kind_right, abstained, wrong, refused, crashed or no_answer."""
    if code == 2:
        return "refused"
    if late or (code < 0 and report is None):
        return "no_answer" if late else "crashed"
    if report is None:
        return "crashed"
    named = {e["name"] for e in report["effects"] if e["verdict"] == "named"} - set(rig.also)
    if not rig.truth:
        return "wrong" if named or report["verdict"] == "ambiguous" else "right"
    if report["verdict"] == "ambiguous":
        held = all(set(a) & set(rig.truth) for a in report["alternatives"])
        some = any(set(a) & set(rig.truth) for a in report["alternatives"])
        return "right" if held else "kind_right" if some or _kind_sure(rig, report) else "wrong"
    if named & set(rig.truth):
        return "right" if named <= {*rig.truth} else "wrong"
    if _kind_sure(rig, report):
        return "kind_right"
    return "wrong" if named else "abstained"


def _kind_sure(rig: Rig, report: Mapping[str, Any]) -> bool:
    """Whether the report is sure of the true kind, where it says kinds."""
    return float(report.get("kinds", {}).get(rig.kind, 0.0)) >= SURE


def missed(figures: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The rigs that were answered wrongly or not at all."""
    return [
        f"{name}: {f['class']} ({', '.join(f['answer']) or f['verdict'] or f['said'] or 'no answer'})"
        for name, f in figures.items()
        if f["class"] not in GOOD
    ]
