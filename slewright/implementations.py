"""Options that say how FMUs are run."""

from typing import Annotated

import typer

from specs.errors import InputError

VALID = ("any", "CoSimulation", "ModelExchange", "ScheduledExecution")


def _check(value: str) -> str:
    if value not in VALID:
        raise InputError(f"--implementation {value}: valid: {', '.join(VALID)}")
    return value


ImplementationOption = Annotated[
    str,
    typer.Option(
        "--implementation",
        metavar="KIND",
        callback=_check,
        help="How an FMU is run: CoSimulation, ModelExchange, ScheduledExecution, or any (the first that it "
        "offers).",
    ),
]

LogOption = Annotated[
    list[str] | None,
    typer.Option("--log", metavar="CATEGORY", help="A log category that FMUs are told to write, or all."),
]
