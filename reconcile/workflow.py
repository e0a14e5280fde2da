"""`slewright reconcile` from recordings and a model folder to a report and an extended model."""

import json
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from reconcile import report as reports, verdict as verdicts
from reconcile.data import Run, read_run, split
from reconcile.model import Folder, read_folder
from reconcile.search import Search
from reconcile.study import Study
from specs.errors import InputError
from specs.schema import read_toml
from specs.version import VERSION

Report = Callable[..., None]
SEED = 0  # nothing is drawn: the same recordings give the same report


def reconcile(
    runs: Sequence[Path],
    model: str,
    out: Path,
    confirm: Sequence[Path] = (),
    holdout: Sequence[Path] = (),
    names: Path | None = None,
    report: Report | None = None,
    report_only: bool = False,
) -> dict[str, Any]:
    """Run the whole workflow, write DIR/report.json and DIR/model, and return the report.

    `report_only` leaves out what is made from the figures: the extended model and the page.
    Raises InputError for recordings or a model that cannot be used; nothing is written then.
    """
    said = report or (lambda *_: None)
    began = time.monotonic()
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder for the report")
    folder = read_folder(model)
    said("reading")
    renamed = _names(names)
    sets = [_read(paths, folder, renamed) for paths in (runs, confirm, holdout)]
    figures, study, answer = examine(folder, *sets, report=said)
    figures |= {"seed": SEED, "versions": {"slewright": VERSION}, "elapsed_s": time.monotonic() - began}
    out.mkdir(parents=True, exist_ok=True)
    said("writing")
    if not report_only and (answer.present or figures["reestimated"]):
        built = _build(reports.write_model(study, answer, out), out)
        figures["model"] = {"folder": "model", "fmu": built}
    _write(out / "report.json", figures)
    return figures


def examine(
    folder: Folder,
    runs: Sequence[Run],
    confirm: Sequence[Run] = (),
    holdout: Sequence[Run] = (),
    report: Report | None = None,
):
    """Find and name, without writing: the report's figures, the study and the answer."""
    said = report or (lambda *_: None)
    said("compiling")
    study = Study(folder, split(runs, confirm, holdout))
    before = verdicts.nominal(study)
    answer = Search(study, said).run()
    missing = verdicts.unseen(study, answer.base)
    verdict = verdicts.judge(study, answer, before, missing)
    said("measuring the gap")
    return reports.build(study, answer, verdict, before), study, answer


def _read(paths: Sequence[Path], folder: Folder, names: dict[str, str] | None) -> list[Run]:
    return [run for path in paths for run in read_run(path, folder, names)]


def _names(path: Path | None) -> dict[str, str] | None:
    if path is None:
        return None
    data = read_toml(path)
    found = data.get("names")
    if set(data) != {"names"} or not isinstance(found, dict):
        raise InputError(f"{path}: write it as [names] and lines 'their name' = 'our name [unit]'")
    return {str(k): str(v) for k, v in found.items()}


def _build(folder: Path, out: Path) -> str:
    from fmus.build import build_fmu

    built = build_fmu(folder, 2, out=folder)
    return str(built.relative_to(out))


def _write(path: Path, figures: dict[str, Any]) -> None:
    unfinished = path.with_name(path.name + ".part")
    unfinished.write_text(json.dumps(_plain(figures), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    unfinished.replace(path)


def _plain(value: Any) -> Any:
    """The same in JSON's own types; what is no number becomes null."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
