"""Plants driven by given commands, without a controller: recordings of the data routine, and their replay."""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from learning.collection import manifest
from learning.collection.collect import collect
from learning.collection.plan import load_plan
from learning.slew.data import Data, load
from learning.slew.trajectory import NEEDED
from orchestrator.run.simulate import simulate
from orchestrator.system.assembly import assemble
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.figures_file import write_text
from records.record import Record, read
from specs import systems
from specs.progress import Report
from verification.paper.asked import WHERE, Asked, code, plant
from verification.plants.plant import Plant
from verification.runs import SLOT, plant_parameters

COMMANDS = ("u_slew", "qd_boom_ref", "qd_stick_ref")
EMPTY = 0.0  # kg in the grab at a replay: the authors' networks know no larger inertia


def assembled(chosen: Plant) -> System:
    """The plant without a controller: the commands are its inputs."""
    return assemble(systems.load(chosen.system).without(SLOT), chosen.models)


def driven(
    chosen: Plant,
    system: System,
    commands: Mapping[str, np.ndarray],
    start: Mapping[str, float],
    columns: Sequence[str],
    **more: Any,
) -> Record:
    """The record of a run on commands, one value each 0.02 s; `start`: parameters (SI), pose and load."""
    ticks = len(next(iter(commands.values())))
    changes = {k: {name: float(values[k]) for name, values in commands.items()} for k in range(ticks)}
    return simulate(
        system, ticks, Stimuli(changes), plant_parameters(system, chosen.system, start),
        record=[name for name in (*columns, *commands) if name in (*system.outputs, *system.inputs)], **more,
    )  # fmt: skip


def recordings(asked: Asked, column: str) -> Path:
    """The folder with the recordings of a plant: by the data routine, or their commands replayed."""
    folder = _collected(asked.effort.plan, asked.out / "recordings", asked.report)
    return folder if column == "reference" else _replayed(asked, folder, column)


@cache
def _collected(name: str, out: Path, report: Report) -> Path:
    plan = load_plan(Path(name))
    collect(plan, out / plan.name, "nominal", (), report)
    return out / plan.name


def data(asked: Asked, column: str) -> Data:
    """The same, as slew models are trained and judged on."""
    return load([recordings(asked, column)])


def _replayed(asked: Asked, folder: Path, column: str) -> Path:
    content, entries = manifest.read(folder)
    out = folder.with_name(f"{folder.name}-{column}-{code(whole=False)}")
    out.mkdir(parents=True, exist_ok=True)
    system = assembled(plant(column))
    for number, (path, entry) in enumerate(entries):
        asked.report(f"replaying on {column}", number, len(entries))
        _replay(column, system, path, entry, out / path.name)
    told = {
        **content,
        "origin": f"{WHERE[column]}, replayed, grab empty",
        "recordings": [e for _, e in entries],
    }
    write_text(out / manifest.NAME, json.dumps(told, indent=1) + "\n")
    return out


def _replay(column: str, system: System, path: Path, entry: Mapping[str, Any], to: Path) -> None:
    if to.is_file():
        return
    source = read(path)
    part = to.with_suffix(".part")
    driven(
        plant(column), system, {name: source.column(name) for name in COMMANDS},
        {"load_mass": EMPTY, "start_q_boom": entry["q_boom"], "start_q_stick": entry["q_stick"]},
        NEEDED, record_path=part, meta={"origin": WHERE[column]},
    )  # fmt: skip
    part.replace(to)
