"""Closes the loop: the experiment that reconcile proposes, driven on the reference machine, answered again.

The machine is driven by `slewright collect`'s own way, through its supervisor and its sensors alone; what it
records lies beside the report, in DIR-experiment.
"""

import json
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from learning.collection.collect import collect
from learning.collection.plan import load_plan
from reconcile.experiment import plan
from reconcile.experiment.achieved import compared
from reconcile.recordings.checks import open_folder
from reconcile.reporting import target
from reconcile.system.parts import part_named, parts_of
from reconcile.workflow import reconcile
from specs.errors import InputError, RunError
from specs.progress import Report


def drive(
    runs: Sequence[Path],
    model: str,
    out: Path,
    confirm: Sequence[Path] = (),
    holdout: Sequence[Path] = (),
    names: Path | None = None,
    machine: str = "nominal",
    report: Report | None = None,
    as_stated: bool = False,
) -> dict[str, Any]:
    """Reconcile; where an experiment is proposed, drive it and reconcile again with its recording.

    The figures are the last answer's; "experiment" holds the first verdict, the proposal, and predicted
    against achieved margins (None where nothing was driven).  The first report and the plan are then kept in
    DIR/before.  Raises InputError for a model that the machine
    has no inputs for, or a folder of recordings that is not ours; RunError when the machine fails.
    """
    folder = None if parts_of(model) else open_folder(model)
    if folder and not plan.drivable(folder) and part_named(folder.model.name) is None:
        raise InputError(
            f"--drive: model {model} has inputs that the reference machine does not take "
            f"({', '.join(plan.PLAN_COMMANDS)}); drive DIR/{plan.PLAN} on your own machine"
        )
    given = (confirm, holdout, names, report)
    first = reconcile(runs, model, out, *given, as_stated=as_stated)
    proposal = first["next_experiment"]
    if not proposal or not proposal["plan"] or not proposal.get("collect", True):
        return first
    new = record(out / proposal["plan"], out, machine, report)
    with tempfile.TemporaryDirectory() as room:
        (kept := Path(room) / target.BEFORE).mkdir()  # the room itself is for nobody else to read
        for name in (target.REPORT, plan.PLAN, plan.TABLE):
            if (out / name).is_file():
                shutil.copy2(out / name, kept)
        then = compare(first, new)
        figures = reconcile([new, *runs], model, out, *given, then=then, as_stated=as_stated)
        shutil.copytree(kept, out / target.BEFORE, dirs_exist_ok=True)
    return figures


def compare(first: dict[str, Any], new: Path) -> Callable[..., dict[str, Any]]:
    """What a second answer adds to its report: predicted against achieved margins of the first's doubt."""

    def then(answer, figures: dict[str, Any]) -> dict[str, Any]:
        name = answer.core.folder.model.name
        if name != first["next_experiment"].get("subsystem", name):
            return {}
        found = compared(answer, first)
        return {"experiment": found | {"recording": str(new), "after": figures["verdict"]}}

    return then


def before(path: Path) -> dict[str, Any]:
    """The report of an answer that proposed an experiment; InputError for a file that is none."""
    try:
        content = json.loads(path.read_text())
        if not (content["next_experiment"] or {}).get("plan"):
            raise InputError(f"--before {path}: that report proposes no experiment")
        known = {"verdict", "sentence"} <= content.keys() and {"pairs", "sentence"} <= content[
            "next_experiment"
        ].keys()
        if not known:
            raise KeyError("it is not whole")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"--before {path}: no report of an answer that proposes one ({error})") from None
    return content


def record(plan: Path, out: Path, machine: str, report: Report | None = None) -> Path:
    """Drive a plan on the reference machine; the recording."""
    folder = out.with_name(out.name + "-experiment")
    manifest = collect(load_plan(plan), folder, machine, (), report)
    entry = manifest["recordings"][0]
    if entry["aborted"]:
        raise RunError(f"the experiment ended early ({entry['aborted']}); what was recorded lies in {folder}")
    return folder / entry["file"]


def lines(figures: dict[str, Any]) -> list[str]:
    """What to tell of experiments: the next one, and what came of the one that was driven."""
    found = []
    proposal, experiment = figures.get("next_experiment"), figures.get("experiment")
    if experiment:
        found += [
            f"before: {experiment['before']}: {experiment['sentence']}",
            f"driven: {experiment['proposal']['sentence']}",
            *(_margin(_against(p), p) for p in experiment["pairs"]),
            *(_margin(p["name"], p) for p in experiment["parameters"]),
            f"after: {experiment['after']}: {figures['sentence']}",
        ]
    if proposal:
        found.append(f"next experiment: {proposal['sentence']}")
    return found


def _against(p: dict[str, Any]) -> str:
    """The better set of a pair, and the other."""
    one, other = ("+".join(p[k]) or "its absence" for k in ("one", "other"))
    return f"{one} or {other}"


def _margin(what: str, p: dict[str, Any]) -> str:
    predicted, reached = p["predicted_margin"], p["achieved_margin"]
    foretold = "no margin" if predicted is None else f"a margin of {predicted:.3g}"
    return f"{what}: {foretold} was predicted, " + (
        "the other can no longer be simulated" if reached is None else f"{reached:.3g} is reached"
    )
