"""Closes the loop: the experiment that reconcile proposes, driven on the reference machine, answered again.

The machine is driven by `slewright collect`'s own way, through its supervisor and its sensors alone; what it
records lies beside the report, in DIR-experiment.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from specs.errors import InputError, RunError

MACHINE = "machine"
Report = Callable[..., None]


def which(text: str) -> str:
    """The machine draw of `machine[:draw]`: "nominal", "tuning:K" or "validation:K"."""
    name, _, draw = text.partition(":")
    if name != MACHINE:
        raise InputError(f"--drive {text}: valid: machine, machine:tuning:K, machine:validation:K")
    return draw or "nominal"


def drive(
    runs: Sequence[Path],
    model: str,
    out: Path,
    confirm: Sequence[Path] = (),
    holdout: Sequence[Path] = (),
    names: Path | None = None,
    machine: str = "nominal",
    report: Report | None = None,
) -> dict[str, Any]:
    """Reconcile; where an experiment is proposed, drive it and reconcile again with its recording.

    The figures are the last answer's; "experiment" holds the first verdict, the proposal, and predicted
    against achieved margins (None where nothing was driven).  Raises InputError for a model that the machine
    has no inputs for, or a folder of recordings that is not ours; RunError when the machine fails.
    """
    from reconcile.checks import open_folder
    from reconcile.experiment import achieved, plan
    from reconcile.workflow import reconcile

    if not plan.drivable(open_folder(model)):
        raise InputError(
            f"--drive: model {model} has inputs that the reference machine does not take "
            f"({', '.join(plan.PLAN_COMMANDS)}); drive DIR/{plan.PLAN} on your own machine"
        )
    declared: list[achieved.Candidate] = []

    def remember(study, answer) -> dict[str, Any]:
        declared.extend(achieved.candidates(study, answer))
        return {"experiment": None}

    given = (confirm, holdout, names, report)
    first = reconcile(runs, model, out, *given, then=remember)
    proposal = first["next_experiment"]
    if not proposal or not proposal["plan"]:
        return first
    new = record(out / proposal["plan"], out, machine, report)

    def compare(study, answer) -> dict[str, Any]:
        return {"experiment": _compared(first, new, achieved.margins(study, answer, declared))}

    second = reconcile([new, *runs], model, out, *given, then=compare)
    second["experiment"]["after"] = second["verdict"]
    return second


def record(plan: Path, out: Path, machine: str, report: Report | None = None) -> Path:
    """Drive a plan on the reference machine; the recording."""
    from learning.collection.collect import collect
    from learning.collection.plan import load_plan

    folder = out.with_name(out.name + "-experiment")
    manifest = collect(load_plan(plan), folder, machine, (), report)
    entry = manifest["recordings"][0]
    if entry["aborted"]:
        raise RunError(f"the experiment ended early ({entry['aborted']}); what was recorded lies in {folder}")
    return folder / entry["file"]


def _compared(first: dict[str, Any], new: Path, reached: list[dict[str, Any]]) -> dict[str, Any]:
    """Predicted and achieved margin of every pair."""
    predicted = {_pair(p): p["predicted_margin"] for p in first["next_experiment"]["pairs"]}
    pairs = [p | {"predicted_margin": predicted.get(_pair(p))} for p in reached]
    least = [p["achieved_margin"] for p in pairs if p["achieved_margin"] is not None]
    return {
        "before": first["verdict"],
        "sentence": first["sentence"],
        "proposal": first["next_experiment"],
        "recording": str(new),
        "pairs": pairs,
        "predicted_margin": first["next_experiment"]["predicted_margin"],
        "achieved_margin": min(least) if least else None,
    }


def _pair(p: dict[str, Any]) -> frozenset:
    return frozenset((tuple(p["one"]), tuple(p["other"])))


def lines(figures: dict[str, Any]) -> list[str]:
    """What to tell of experiments: the next one, and what came of the one that was driven."""
    found = []
    proposal, experiment = figures.get("next_experiment"), figures.get("experiment")
    if experiment:
        reached = experiment["achieved_margin"]
        found += [
            f"before: {experiment['before']}: {experiment['sentence']}",
            f"driven: {experiment['proposal']['sentence']}",
            f"margin: {experiment['predicted_margin']:.3g} predicted, "
            + ("one candidate is out" if reached is None else f"{reached:.3g} achieved"),
            f"after: {experiment['after']}: {figures['sentence']}",
        ]
    if proposal:
        found.append(f"next experiment: {proposal['sentence']}")
    return found
