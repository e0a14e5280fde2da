"""`slewright analyse CONTROLLER`: margins of its slew loop."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.tables import show
from specs.errors import InputError

COLUMNS = (
    *("pose", "inertia t m²", "gain dB", "phase °", "delay s", "crossover rad/s", "sensitivity", "stable"),
)


def analyse(
    controller: Annotated[
        str, typer.Argument(metavar="CONTROLLER", help="The controller (docs/explanation/controllers.md).")
    ],
    gain: Annotated[
        list[str] | None, typer.Option("--gain", metavar="NAME=VALUE", help="Another gain (repeatable).")
    ] = None,
    gains: Annotated[
        Path | None, typer.Option("--gains", metavar="FILE", help="Gains that slewright tune --json wrote.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Linearise a controller's slew loop: gain, phase and delay margin, sensitivity, whether it is stable."""
    from baselines import gains as from_file, loop as slew_loop, registry

    chosen = registry.find(controller)
    chosen = chosen if gains is None else from_file.apply(chosen, gains)
    loops = slew_loop.analyse(chosen, dict(_gain(text) for text in gain or ()))
    rows = []
    for name, loop in loops.items():
        m = loop.margins
        margins = (m.gain_db, m.phase_deg, m.delay_s, m.crossover_rad_s, loop.sensitivity)
        rows.append([name, loop.inertia / 1e3, *margins, loop.stable])
    show(f"{controller}: slew loop, cut at the joystick", COLUMNS, rows)
    stable = all(loop.stable for loop in loops.values())
    for name, loop in loops.items():
        if not loop.stable:
            typer.echo(f"unstable: {name}: grows by {100 * (loop.growth - 1):.2f} % a step; {loop.margins}")
    figures = {"controller": controller, "stable": stable}
    write(json, {**figures, "points": {name: loop.as_dict() for name, loop in loops.items()}})
    if not stable:
        raise typer.Exit(1)


def _gain(text: str) -> tuple[str, float]:

    name, equals, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise InputError(f"--gain {text}: needs NAME=VALUE" + ("" if equals else ", with =")) from None
