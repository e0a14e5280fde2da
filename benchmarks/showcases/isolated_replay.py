"""A model by itself: moved as the simulated reference machine moved in a scenario, and scored as a run is.

In a whole system a model's own errors mix with those of all others: a nominal slew that turns otherwise than
the machine's swings the best of tools otherwise.  Here the model's inputs are made of the machine's own run
(true joint angles and rates, command), its outputs take the place of the machine's in the record of that
run, and the metrics of records/metrics.py are computed from it.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from orchestrator.run.simulate import simulate
from orchestrator.system.single_fmu import system_of_fmu
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from reconcile.system.parts import JOINTS, RATES, part_named
from records.record import Record
from records.targets import targets
from specs.scenario import Scenario

MOTION = ("q_slew", "qd_slew", *JOINTS, *RATES)
COMMANDS = ("u_slew",)
# what takes the place of the machine's: column of the record -> output of the model
OUTPUTS = {
    "tool": {f"true_{n}": n for n in ("q_tool_x", "q_tool_y", "qd_tool_x", "qd_tool_y")}
    | {n: n for n in ("true_tool_x", "true_tool_y", "true_tool_z")},
    "slew": {"true_q_slew": "q_slew", "true_qd_slew": "qd_slew"},
}


def moved(fmu: Path, part: str, run: Record, scenario: Scenario, seed: int) -> Record:
    """`run` of the reference machine with the outputs of a model that was moved as the machine was.

    `fmu`: of the model; `part`: "tool" or "slew", what it is.  The slew's angle, which only adds up, begins
    anew at the machine's with every target.  Raises RunError when the FMU fails.
    """
    system = system_of_fmu(fmu)
    names = OUTPUTS[part]
    found = simulate(
        system,
        len(run) - 1,
        Stimuli(_stimuli(system, part, run)),
        _parameters(system, scenario.parameters(seed)),
        record=list(names.values()),
    )
    columns = {column: found.column(output) for column, output in names.items()}
    if part == "slew":
        columns["true_q_slew"] = _begun_anew(columns["true_q_slew"], run)
    return with_columns(run, columns)


def with_columns(run: Record, columns: Mapping[str, np.ndarray]) -> Record:
    """`run` with other values [n] in some of its columns."""
    table = run.table
    for name, values in columns.items():
        number = table.column_names.index(name)
        table = table.set_column(number, table.schema.field(number), pa.array(values))
    return replace(run, table=table)


def inputs(part: str, run: Record) -> dict[str, np.ndarray]:
    """Inputs [n] of the model by name: what the part feels of the machine's true motion, and its command."""
    derive = getattr(part_named(part), "derive", None)
    columns = {n: run.column(f"true_{n}") for n in MOTION} | {"time": run.time}
    columns["load"] = np.full(len(run), float(run.meta.get("load_kg") or 0.0))
    felt = {} if derive is None else {n: values for n, (_, values) in derive(columns).items()}
    return felt | {n: run.column(n) for n in COMMANDS}


def _stimuli(system: System, part: str, run: Record) -> dict[int, dict[str, float]]:
    known = {n: v for n, v in inputs(part, run).items() if n in system.inputs}
    return {k: {n: float(v[k]) for n, v in known.items()} for k in range(len(run))}


def _parameters(system: System, values: Mapping[str, float]) -> dict[str, float]:
    (name, component), *_ = system.components.items()
    return {f"{name}.{n}": v for n, v in values.items() if n in component.model.variables}


def _begun_anew(angle: np.ndarray, run: Record) -> np.ndarray:
    angle, true = angle.copy(), run.column("true_q_slew")
    for target in targets(run):
        angle[target.rows] += true[target.rows.start] - angle[target.rows.start]
    return angle
