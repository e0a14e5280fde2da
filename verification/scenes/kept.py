"""What is kept of a run: its record (Parquet), which has the scene and the plan, and a film for Foxglove."""

import re
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import numpy as np

from baselines.planning.planner import Planner, hanging
from records.foxglove import film
from records.hashing import RUN_HASH
from records.record import Record, read
from records.recording import RecordWriter
from records.schema import TIME, Column, columns_of, resolve_columns
from specs import scene_text
from specs.signals import signal
from verification.scenes.run import TRUE, Case, Ran

SCENE, WAYS = scene_text.SCENE, scene_text.WAYS  # in a record's metadata
CLOSING = ("complete", "reason", "format", RUN_HASH)  # metadata that the writer knows
GUARD_PART, NOBODY = "guard_part", "none"
WAY_TICKS = 10  # between the points of a planned way
PACKAGE = "foxglove.messages"


def check() -> None:
    """Raise ModuleNotFoundError where the package for films is missing."""
    import_module(PACKAGE)


def paths(folder: Path, case: Case) -> tuple[Path, Path]:
    """Record and film of a case."""
    name = f"{case.scene.name}-{case.controller}-{case.machine}-{case.seed}"
    name = re.sub(r"[^\w+@.-]+", "_", name)
    return folder / f"{name}.parquet", folder / f"{name}.mcap"


def there(folder: Path, case: Case) -> bool:
    """Whether both are there."""
    return all(path.is_file() for path in paths(folder, case))


def keep(folder: Path, ran: Ran) -> None:
    """Write both; nothing where nothing was driven."""
    if ran.record is None:
        return
    scene, (path, picture) = ran.case.scene, paths(folder, ran.case)
    ways = [hanging(leg.path)[::WAY_TICKS].round(2).tolist() for leg in ran.legs if leg.path]
    columns, rows = _table(ran.record, ran.parts)
    meta = {**ran.record.meta, SCENE: scene_text.plain(scene), WAYS: ways}
    with RecordWriter(path, columns, {k: v for k, v in meta.items() if k not in CLOSING}) as writer:
        writer.append(rows)
    angles = np.stack([ran.record.column(name) for name in TRUE], axis=1)
    film.write(picture, read(path), angles, scene, ways, Planner(scene).body.swept_m)


def _table(record: Record, parts: Sequence[str]) -> tuple[list[Column], np.ndarray]:
    """Columns and rows of cells, with what the guard did at each tick where there was one."""
    columns = columns_of(record.table.schema)
    cells = [_cells(record.column(c.name), c.type) for c in columns]
    if parts:
        codes = {name: code for code, name in signal(GUARD_PART).values.items()}
        told = [float(codes[part or NOBODY]) for part in parts[: len(record)]]
        columns += resolve_columns([TIME, GUARD_PART])[1:]
        cells.append(np.array(told + [0.0] * (len(record) - len(told))))
    return columns, np.stack(cells, axis=1)


def _cells(values: np.ndarray, kind: str) -> np.ndarray:
    """As rows of a record hold them: whole numbers by their bits (records/schema.py)."""
    if kind == "float64":
        return values
    return values.astype(np.uint64 if kind == "uint64" else np.int64).view(np.float64)
