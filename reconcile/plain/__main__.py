"""`python -m reconcile.plain METHOD MODEL OUT RUN...`: the plain answer to recordings, as OUT/report.json."""

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from reconcile.equations.model import Folder, read_folder
from reconcile.plain import greedy, sindy
from reconcile.recordings.data import Run, read_run, split
from reconcile.system.examine import Recording, own_runs
from reconcile.system.parts import parts_of, with_signals
from records.formats import read_measurement
from specs.errors import InputError, nearest

METHODS = {"sindy": sindy.name, "greedy_bic": greedy.name}


def main(arguments: Sequence[str]) -> None:
    """Read, answer, write."""
    if len(arguments) < 4:
        raise InputError("usage: python -m reconcile.plain METHOD MODEL OUT RUN...")
    method, model, out, *runs = arguments
    if method not in METHODS:
        raise InputError(f"no method '{method}'; {nearest(method, METHODS)}")
    names: list[str] = []
    for folder, recorded in _models(model, [Path(r) for r in runs]):
        names += METHODS[method](folder, split(recorded, (), ()))
    effects = [{"name": name, "verdict": "named", "parameters": {}} for name in dict.fromkeys(names)]
    report = {"verdict": "named" if names else "agrees", "effects": effects, "alternatives": [], "gap": {}}
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / "report.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


def _models(model: str, paths: Sequence[Path]) -> Iterator[tuple[Folder, list[Run]]]:
    """The model with its runs; of a system, each part with the runs as it feels them."""
    parts = parts_of(model)
    if parts is None:
        folder = read_folder(model)
        yield folder, [run for path in paths for run in read_run(path, folder)]
        return
    recordings = [Recording(p.stem, with_signals(read_measurement(p))) for p in paths]
    for part in parts:
        folder = read_folder(part.model)
        yield folder, [run for r in recordings for run in own_runs(part, folder, r)]


if __name__ == "__main__":
    main(sys.argv[1:])
