"""The effect of halving the machine's internal step on the four metrics of the verification scenarios."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from fmus.models.machine.model import MODEL
from fmus.toolchain.build import BUILD, build_fmu
from orchestrator.system.pack import pack
from records.metrics import compute
from records.record import Record, read
from specs import scenario as scenario_spec, ssd, systems
from specs.progress import Report
from verification.dossier.machine import JOINTS
from verification.dossier.markdown import number, table
from verification.dossier.section import MET, MISSED, Check
from verification.runs import SLOT, Job, run

SYSTEM, SEED = "reference", 1
WORK = BUILD / "dossier"
HALF = """\
import dataclasses

from fmus.models.machine.model import MODEL as FULL

MODEL = dataclasses.replace(FULL, step=FULL.step / 2)
"""


@dataclass(frozen=True)
class Metric:
    """One of the four metrics: unit, and how much it may move, besides one percent."""

    name: str
    unit: str
    absolute: float
    digits: int


METRICS = (
    Metric("speed", "°/s", 0.05, 3),
    Metric("overshoot", "°", 0.05, 3),
    Metric("error", "m", 0.01, 4),
    Metric("tool", "°/s", 0.05, 3),
)
RELATIVE = 0.01


def figures(report: Report, scenarios: Sequence[str]) -> dict[str, Any]:
    """Metrics of each scenario on the reference machine, as shipped and with half its step."""
    found: dict[str, Any] = {}
    apart: dict[str, float] = {}
    report("building the machine with half its step")
    with TemporaryDirectory(prefix="slewright-") as folder:
        systems_packed = {
            "whole": _packed(Path(folder) / "whole.ssp"),
            "half": _packed(Path(folder) / "half.ssp", True),
        }
        for i, scenario in enumerate(scenarios):
            report("halving the internal step", i, len(scenarios))
            pair = {
                k: _record(scenario, ssp, Path(folder) / f"{k}.parquet") for k, ssp in systems_packed.items()
            }
            found[scenario] = {m.name: _compare(m, pair) for m in METRICS}
            apart[scenario] = _apart(pair)
    return {"step_s": MODEL.step, "seed": SEED, "scenarios": found, "apart_deg": apart}


def _packed(path: Path, half: bool = False) -> Path:
    spec = systems.load(SYSTEM)
    fmus = {f"{c.fmu}.fmu": build_fmu(c.fmu, 2) for c in spec.components}
    if half:
        fmus["machine.fmu"] = build_fmu(_half_folder(), 2, out=WORK / "fmi2")
    return pack(ssd.render(spec, 2), fmus, path)


def _half_folder() -> Path:
    """A model folder like the machine's, with half the step."""
    folder = WORK / "half" / "machine"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.py").write_text(HALF, encoding="utf-8")
    return folder


def _record(scenario: str, ssp: Path, path: Path) -> Record:
    run(Job(scenario_spec.load(scenario), SYSTEM, SEED, ssp, SLOT, path))
    return read(path)


def _compare(metric: Metric, pair: Mapping[str, Record]) -> dict[str, Any]:
    whole, half = (getattr(compute(pair[k]), metric.name) for k in ("whole", "half"))
    allowed = max(RELATIVE * abs(whole), metric.absolute)
    return {"whole": whole, "half": half, "allowed": allowed, "passed": abs(half - whole) < allowed}


def _apart(pair: Mapping[str, Record]) -> float:
    """Largest difference of a joint angle between the two runs, degrees."""
    both = ([pair[k].column(f"true_q_{j}") for j in JOINTS] for k in ("whole", "half"))
    return float(np.degrees(max(np.abs(a - b).max() for a, b in zip(*both, strict=True))))


def rows(found: Mapping[str, Any]) -> str:
    """Table of the metrics, moved and allowed."""
    lines = []
    for scenario, metrics in found["scenarios"].items():
        for metric in METRICS:
            row = metrics[metric.name]
            values = [number(row[k], metric.digits) for k in ("whole", "half")]
            moved = number(abs(row["half"] - row["whole"]), metric.digits + 1)
            verdict = MET if row["passed"] else MISSED
            lines.append(
                [
                    scenario,
                    f"{metric.name} [{metric.unit}]",
                    *values,
                    moved,
                    number(row["allowed"], 3),
                    verdict,
                ]
            )
    whole, half = (f"{1e3 * found['step_s'] / k:g} ms" for k in (1, 2))
    columns = ("scenario", "metric", whole, half, "moved by", "allowed", "")
    return table(columns, lines, right=range(2, 6))


def check(found: Mapping[str, Any]) -> Check:
    """That no metric moves further than allowed."""
    missed = sum(not row["passed"] for rows in found["scenarios"].values() for row in rows.values())
    return Check("metrics that half the internal step moves too far", float(missed), 0.0, "", digits=0)
