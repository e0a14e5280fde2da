"""The files of a proposed experiment, kept beside the report of a case."""

import shutil
from pathlib import Path

PLAN, TABLE = "experiment.toml", "experiment.csv"


def keep(out: Path, folder: Path) -> None:
    """Keep the proposal of an answer (its folder `out`) in the case's folder; none if there is none."""
    for name in (PLAN, TABLE):
        (folder / name).unlink(missing_ok=True)
        if (out / name).is_file():
            shutil.copy(out / name, folder / name)
