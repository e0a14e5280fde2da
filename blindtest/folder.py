"""Writes a case: recordings and plain model for the workflow, the truth sealed elsewhere."""

import hashlib
import json
import re
import shutil
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from blindtest.case import Case
from blindtest.equivalents import equivalents
from blindtest.systems.system import STEP, WRONG
from records.record import Column, RecordWriter
from specs.errors import InputError, RunError

MODELS = Path(__file__).parent / "models"
TIME = Column("time", "s", "Time since the start of the run")


def write(case: Case, folder: Path, sealed: Path) -> Path:
    """Write `folder` (runs, model, case.json) for the workflow and `sealed`/truth.json; returns the latter.

    case.json holds the truth's SHA-256, the names of the runs and the plain model, and nothing of the seed.
    Raises InputError when the truth would lie where the workflow can see it.
    """
    if sealed.resolve() == folder.resolve() or folder.resolve() in sealed.resolve().parents:
        raise InputError(f"the truth must not lie in the workflow's folder {folder}")
    folder.mkdir(parents=True, exist_ok=True)
    sealed.mkdir(parents=True, exist_ok=True)
    text = json.dumps(truth(case), indent=1, sort_keys=True, allow_nan=False).encode()
    (sealed / "truth.json").write_bytes(text)
    names = [_record(case, i, folder) for i in range(len(case.runs))]
    told = {"model": _model(case, folder), "runs": names, "truth_sha256": hashlib.sha256(text).hexdigest()}
    (folder / "case.json").write_text(json.dumps(told, indent=1) + "\n")
    return sealed / "truth.json"


def truth(case: Case) -> dict[str, Any]:
    """Everything that is hidden, E(T) included, as JSON content.

    `best_fit`: what an effect's parameters come to if T alone is fitted to the noise-free recordings; they
    take up what distractors do.
    """
    fits = dict(zip((e.key for e in case.visible), case.truth_fit.effects, strict=True))
    return {
        "seed": case.seed,
        "noise": case.noise,
        "system": case.kit.name,
        "redrawn": case.redrawn,
        "outside": any(not e.catalogue for e in case.visible),
        "visible": sorted(e.name for e in case.visible),
        "equivalents": equivalents(case),
        "placed": [
            {
                "name": p.effect.name,
                "place": p.effect.place,
                "port": p.effect.port,
                "subsystem": p.effect.subsystem,
                "parameters": {k: float(v) for k, v in p.parameters(case.scale).items()},
                "units": {q.name: q.unit for q in p.effect.parameters},
                "best_fit": {k: float(v) for k, v in fits.get(p.effect.key, {}).items()},
                "lambda_without": float(seen),
            }
            for p, seen in zip(case.placed, case.seen, strict=True)
        ],
        "base": {b.name: b.value for b in case.system.base},
        "told": told_values(case),
        "runs": [r.kind for r in case.runs],
        "scale": asdict(case.scale),
    }


def told_values(case: Case) -> dict[str, float]:
    """Base parameters as the plain model has them: 10-30 % wrong unless they are known."""
    if all(b.told is not None for b in case.system.base):
        return {b.name: float(b.told) for b in case.system.base if b.told is not None}
    rng = np.random.default_rng([case.seed, case.redrawn, 1])
    off = {b.name: rng.choice([-1.0, 1.0]) * rng.uniform(*WRONG) for b in case.system.base}
    return {b.name: float(b.value if b.known else b.value * (1.0 + off[b.name])) for b in case.system.base}


def _record(case: Case, number: int, folder: Path) -> str:
    """One run as Parquet, columns by the plain model's names."""
    run, system = case.runs[number], case.system
    signals = (*system.inputs, *system.outputs)
    columns = [TIME, *(Column(s.name, s.unit, "recorded") for s in signals)]
    time = np.arange(len(run.outputs)) * STEP
    rows = np.column_stack([time, run.commands, run.outputs])
    name = f"run_{number + 1}.parquet"
    with RecordWriter(
        folder / name, columns, {"source": "simulated, hidden effects", "step": STEP}
    ) as writer:
        writer.append(rows)
    return name


def _model(case: Case, folder: Path) -> str:
    """The plain model: a copy with this case's (wrong) values, or the name of one of the project's."""
    if not case.system.model.startswith("blindtest/models/"):
        return case.system.model
    source = MODELS / case.system.model.rsplit("/", 1)[1]
    shutil.copytree(
        source, folder / "model", dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__")
    )
    path = folder / "model" / "model.py"
    path.write_text(with_values(path.read_text(), told_values(case)))
    return "model"


def with_values(text: str, values: Mapping[str, float]) -> str:
    """A plain model's text with other numbers in its table VALUES."""
    table = "".join(f'    "{name}": {value:.6g},\n' for name, value in values.items())
    changed, count = re.subn(r"^VALUES = \{\n.*?^\}", f"VALUES = {{\n{table}}}", text, flags=re.M | re.S)
    if count != 1:
        raise RunError("the plain model has no table VALUES")
    return changed
