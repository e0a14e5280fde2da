"""`slewright verify`: the main job."""

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.progress import progress
from specs.errors import InputError
from specs.progress import Report

if TYPE_CHECKING:
    from verification.verify import Controller


class Systems(StrEnum):
    """Which of the two systems a scenario runs on."""

    nominal = "nominal"
    reference = "reference"
    both = "both"


def verify(
    scenario: Annotated[
        list[str] | None,
        typer.Option(
            "--scenario", metavar="NAME", help="Only this scenario, or this target file (repeatable)."
        ),
    ] = None,
    system: Annotated[Systems, typer.Option("--system", help="Run on this system.")] = Systems.both,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of sensor noise and drawn loads.")] = 1,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of records and report.")] = Path(
        "out/verify"
    ),
    model: Annotated[
        Path | None,
        typer.Option(
            "--model",
            metavar="DIR",
            help="Verify with this model: a controller's folder, or what `slewright reconcile` wrote.",
        ),
    ] = None,
    controller: Annotated[
        str,
        typer.Option(
            "--controller", metavar="NAME", help="Verify this controller (docs/explanation/controllers.md)."
        ),
    ] = "",
    bundle: Annotated[
        Path | None,
        typer.Option(
            "--bundle",
            metavar="DIR",
            help="Verify the control core of this bundle, on the reference machine.",
        ),
    ] = None,
    json: JsonOption = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Scenarios run at the same time.")] = 2,
    readme: Annotated[
        Path | None,
        typer.Option("--readme", metavar="FILE", exists=True, help="Write the table into this README."),
    ] = None,
) -> None:
    """Build the FMUs, run the verification scenarios, check their limits, write the report.

    Without --controller, --model or --bundle the policy that ships is verified, beside the paper's PI.
    """
    from verification.verify import show, verify as run

    systems = ["nominal", "reference"] if system is Systems.both else [system.value]
    with progress("verify") as report:
        if bundle is not None:
            chosen, systems = _bundled(bundle, controller or model, system, out, report), ["reference"]
        else:
            chosen = _chosen(controller, model, systems)
        outcome = run(scenario or None, systems, seed, out, chosen[0], chosen[1:], jobs, report)
    show(outcome)
    write(json, outcome.figures, seed)
    if readme is not None:
        from slewright.readme import fill

        fill(readme, outcome, f"slewright verify --seed {seed}")
    if not outcome.own.accepted:
        raise typer.Exit(1)


def _bundled(bundle: Path, other: object, system: Systems, out: Path, report: Report) -> "list[Controller]":
    """The reference system with the core of a bundle."""
    from deployment.bundling.fmu import system_of
    from runtime.bundle import load
    from verification.verify import Controller

    if other:
        raise InputError("--bundle excludes --controller and --model")
    if system is Systems.nominal:
        raise InputError(
            "--bundle: the nominal system has no sensors; only --system reference can be verified"
        )
    found = load(bundle)
    report(f"building the core of {found.controller}")
    packages = {"reference": system_of(found, out / "systems")}
    return [Controller(f"{found.controller} (bundle)", packages=packages)]


def _chosen(controller: str, model: Path | None, systems: Sequence[str]) -> "list[Controller]":
    """The controller to verify, then those beside it: what was named, or else what ships.

    A `model` of the machine is verified with the controller that ships.
    """
    from baselines import registry
    from verification.evaluation.policies import SHIPPED, model_folder
    from verification.runs import replacement
    from verification.verify import PI, Controller

    if controller and model is not None:
        raise InputError("--controller and --model exclude each other")
    if controller:
        found = registry.find(controller)
        return [Controller(controller, tuple(found.models.values()), found.parameters)]
    if model is None:
        return [Controller("policy", (model_folder(SHIPPED),)), PI]
    folder = model_folder(model)
    if registry.SLOT in replacement(folder, systems):
        return [Controller(folder.resolve().name, (folder,))]
    return [Controller("policy", (model_folder(SHIPPED), folder))]
