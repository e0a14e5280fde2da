"""`slewright verify`: the main job."""

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.plants import OurInertiaOption, PlantOption, check_excluded, check_inertia, one_plant
from slewright.progress import progress
from specs.errors import InputError
from specs.progress import Report


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
    plants: PlantOption = None,
    our_inertia: OurInertiaOption = False,
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
    from verification import choice, readme as results, verify as verification

    systems = ["nominal", "reference"] if system is Systems.both else [system.value]
    plant = one_plant(plants)
    check_inertia(our_inertia, plant)
    found = _plant(plant, our_inertia, {"--bundle": bundle, "--readme": readme}, system)
    systems = [found.system] if found else systems
    with progress("verify") as report:
        if bundle is not None:
            chosen, systems = _bundled(bundle, controller or model, system, out, report), ["reference"]
        else:
            chosen = choice.choose(controller, model, systems)
        if found:
            chosen = [replace(c, plant=found) for c in chosen]
        outcome = verification.verify(
            scenario or None, systems, seed, out, chosen[0], chosen[1:], jobs, report
        )
    verification.show(outcome)
    for text in outcome.warnings:
        typer.echo(f"slewright: warning: {text}", err=True)
    write(json, outcome.figures | ({"plant": plant} if found else {}), seed)
    if readme is not None:
        results.fill(readme, outcome, f"slewright verify --seed {seed}")
    if not outcome.own.accepted:
        raise typer.Exit(1)


def _plant(text: str | None, our_inertia: bool, given: Mapping[str, Any], system: Systems) -> Any:
    """The plant of --plant; None without it."""
    from verification.plants.plant import find

    if text is None:
        return None
    check_excluded({**given, "--system": system is not Systems.both}, {})
    return find(text, our_inertia)


def _bundled(bundle: Path, other: object, system: Systems, out: Path, report: Report) -> list[Any]:
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
