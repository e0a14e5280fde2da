"""The virtual controller with what it must compute (FMI-LS-REF): plain signals of a run with the machine."""

import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from deployment.network import nodes, system, tables
from fmus.definition import Variable
from fmus.toolchain import reference
from fmus.toolchain.build import mark_built, pack, write_whole
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from runtime.bundle import Bundle
from runtime.image import TICK_S

PLAIN = "plain"  # the controller's parameter
TICKS = 150  # 3 s: automatic begins after 0.2 s, and the first target is on its way
TARGET = {"target_x": 7.0, "target_y": 7.0, "target_z": 4.0}
SEED = 1


def build_controller(bundle: Bundle, path: Path) -> Path:
    """Build the virtual controller `path` as `nodes.build_controller`, with a reference experiment in it."""
    with tempfile.TemporaryDirectory() as scratch:
        fmu = nodes.build_controller(bundle, Path(scratch) / f"{nodes.CONTROLLER}.fmu")
        files = _experiment(fmu, _inputs(fmu, Path(scratch) / "plain.ssp"))
        with zipfile.ZipFile(fmu) as archive:
            content = pack({name: archive.read(name) for name in archive.namelist()} | files)
    write_whole(path, content)
    mark_built(content)
    return path


def _inputs(fmu: Path, packed: Path) -> np.ndarray:
    """What the controller gets on its plain signals in each tick [TICKS + 1, signals], in nine digits."""
    loaded = load_system(system.by_plain_signals(fmu, packed))
    names = [f"{system.CONTROLLER}.{v.name}" for v in tables.inputs()]
    each = round(TICK_S / loaded.step_s)
    plain = {f"{system.CONTROLLER}.{PLAIN}": True}
    record = simulate(loaded, TICKS * each, Stimuli.constant(**TARGET), plain, record=names, seed=SEED)
    rows = np.column_stack([record.column(name)[::each] for name in names])
    return np.vectorize(lambda x: float(f"{x:.9g}"))(rows)


def _experiment(fmu: Path, inputs: np.ndarray) -> dict[str, bytes]:
    """FMI-LS-REF's files: these inputs, and the outputs of the FMU alone."""
    names = [v.name for v in tables.inputs()]
    changes = {k: dict(zip(names, row, strict=True)) for k, row in enumerate(inputs.tolist())}
    shown = [v.name for v in tables.outputs()]
    alone = load_system(fmu, TICK_S)
    record = simulate(alone, TICKS, Stimuli(changes), {f"{nodes.CONTROLLER}.{PLAIN}": True}, record=shown)
    outputs = np.column_stack([record.column(name) for name in shown])
    parameters = reference.parameter(PLAIN, "Boolean", "true")
    stimuli, results = _table(tables.inputs(), inputs), _table(tables.outputs(), outputs)
    return reference.carried(parameters, stimuli, results, TICKS * TICK_S, TICK_S)


def _table(columns: Sequence[Variable], rows: np.ndarray) -> str:
    return reference.table(columns, [(k * TICK_S, row) for k, row in enumerate(rows.tolist())])
