"""`python -m reconcile.plain METHOD MODEL OUT RUN...`: the plain answer to recordings, as OUT/report.json."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from reconcile.data import read_run, split
from reconcile.model import read_folder
from reconcile.plain import greedy, sindy
from specs.errors import InputError, nearest

METHODS = {"sindy": sindy.name, "greedy_bic": greedy.name}


def main(arguments: Sequence[str]) -> None:
    """Read, answer, write."""
    if len(arguments) < 4:
        raise InputError("usage: python -m reconcile.plain METHOD MODEL OUT RUN...")
    method, model, out, *runs = arguments
    if method not in METHODS:
        raise InputError(f"no method '{method}'; {nearest(method, METHODS)}")
    folder = read_folder(model)
    parts = split([run for path in runs for run in read_run(path, folder)], (), ())
    names = METHODS[method](folder, parts)
    effects = [{"name": name, "verdict": "named", "parameters": {}} for name in names]
    report = {"verdict": "named" if names else "agrees", "effects": effects, "alternatives": [], "gap": {}}
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / "report.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
