"""The virtual controller with what it must compute (FMI-LS-REF): plain signals of a run with the machine."""

import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from deployment.bundling import fmu as core
from deployment.network import nodes, system, tables
from fmus.definition import Variable
from fmus.toolchain import reference
from fmus.toolchain.build import mark_built, pack, write_whole
from orchestrator.fmi.variable import Value
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
        packed = system.by_plain_signals(fmu, Path(scratch) / "plain.ssp")
        names = [f"{system.CONTROLLER}.{v.name}" for v in tables.inputs()]
        inputs = _recorded(packed, names, {f"{system.CONTROLLER}.{PLAIN}": True})
        plain = {f"{nodes.CONTROLLER}.{PLAIN}": True}
        parameters = reference.parameter(PLAIN, "Boolean", "true")
        files = _experiment(fmu, tables.inputs(), tables.outputs(), inputs, plain, parameters)
        return _written(fmu, files, path)


def build_plain(bundle: Bundle, path: Path) -> Path:
    """Build the control core `path` with plain signals only, and a reference experiment with the machine.

    Steps of each input by itself, as other FMUs of the project carry, would only show that the core stops.
    """
    with tempfile.TemporaryDirectory() as scratch:
        packed, model = core.system_of(bundle, Path(scratch), 3), core.facade()
        inputs = _recorded(packed, [f"core.{v.name}" for v in model.inputs], {})
        fmu = Path(scratch) / f"{core.NAME}.fmu"
        return _written(fmu, _experiment(fmu, model.inputs, model.outputs, inputs), path)


def _written(fmu: Path, files: dict[str, bytes], path: Path) -> Path:
    """The FMU with these files instead of the experiment that it may have."""
    with zipfile.ZipFile(fmu) as archive:
        names = [name for name in archive.namelist() if not name.startswith(reference.FOLDER)]
        content = pack({name: archive.read(name) for name in names} | files)
    write_whole(path, content)
    mark_built(content)
    return path


def _recorded(packed: Path, names: Sequence[str], parameters: Mapping[str, Value]) -> np.ndarray:
    """What the controller of a system gets in each tick [TICKS + 1, signals], in nine digits."""
    loaded = load_system(packed)
    each = round(TICK_S / loaded.step_s)
    stimuli = Stimuli.constant(**TARGET)
    record = simulate(loaded, TICKS * each, stimuli, parameters, record=names, seed=SEED)
    rows = np.column_stack([record.column(name)[::each] for name in names])
    return np.vectorize(lambda x: float(f"{x:.9g}"))(rows)


def _experiment(
    fmu: Path,
    given: Sequence[Variable],
    shown: Sequence[Variable],
    inputs: np.ndarray,
    parameters: Mapping[str, Value] = MappingProxyType({}),
    carried: str = "",
) -> dict[str, bytes]:
    """FMI-LS-REF's files: these inputs and parameters, and the outputs of the FMU alone."""
    names = [v.name for v in given]
    changes = {k: dict(zip(names, row, strict=True)) for k, row in enumerate(inputs.tolist())}
    alone, wanted = load_system(fmu, TICK_S), [v.name for v in shown]
    record = simulate(alone, TICKS, Stimuli(changes), parameters, record=wanted)
    outputs = np.column_stack([record.column(name) for name in wanted])
    stimuli, results = _table(given, inputs), _table(shown, outputs)
    return reference.carried(carried, stimuli, results, TICKS * TICK_S, TICK_S)


def _table(columns: Sequence[Variable], rows: np.ndarray) -> str:
    return reference.table(columns, [(k * TICK_S, row) for k, row in enumerate(rows.tolist())])
