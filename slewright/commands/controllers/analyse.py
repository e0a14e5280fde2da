"""`slewright analyse CONTROLLER`: margins of its slew loop, linearised or measured on plants."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.plants import HELP, OurInertiaOption
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError

COLUMNS = (
    *("pose", "inertia t m²", "gain dB", "phase °", "delay s", "crossover rad/s", "sensitivity", "stable"),
)

AMPLITUDE = 0.3  # of the joystick


def analyse(
    controller: Annotated[
        list[str],
        typer.Argument(
            metavar="CONTROLLER...",
            help="The controller (docs/explanation/controllers.md); with --plant several, and ONNX policies.",
        ),
    ],
    gain: Annotated[
        list[str] | None, typer.Option("--gain", metavar="NAME=VALUE", help="Another gain (repeatable).")
    ] = None,
    gains: Annotated[
        Path | None, typer.Option("--gains", metavar="FILE", help="Gains that slewright tune --json wrote.")
    ] = None,
    plant: Annotated[
        list[str] | None,
        typer.Option(
            "--plant", metavar="PLANT", help=f"Measure on plants instead (repeatable): all, {HELP}."
        ),
    ] = None,
    amplitude: Annotated[
        float | None,
        typer.Option(
            metavar="A", min=0.05, max=1.0, help="Of the joystick's sine, with --plant (default: 0.3)."
        ),
    ] = None,
    our_inertia: OurInertiaOption = False,
    page: Annotated[
        Path | None,
        typer.Option(
            "--page",
            metavar="FILE",
            exists=True,
            help="With --plant: write the table there, between its markers `loops`.",
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Analyse a controller's slew loop: gain, phase and delay margin, sensitivity, whether it is stable.

    Linearised; with --plant measured from 0.3 to 3 Hz by a sine on the joystick of each plant.
    """
    if plant:
        if gain or gains:
            raise InputError("--plant excludes --gain and --gains")
        _measured(controller, plant, AMPLITUDE if amplitude is None else amplitude, our_inertia, page, json)
        return
    if len(controller) > 1 or page is not None or amplitude is not None or our_inertia:
        raise InputError("several controllers, --page, --amplitude and --our-inertia need --plant")
    _linear(controller[0], gain, gains, json)


def _measured(
    texts: list[str],
    plant: list[str],
    amplitude: float,
    our_inertia: bool,
    page: Path | None,
    json: Path | None,
) -> None:
    """The loops of controllers on plants; exit code 1 where one swings by itself."""
    from verification.plants import loop_gain, page as pages, study

    if page is not None:
        pages.check(page, [pages.LOOPS])
    on, controllers = study.find_plants(plant, our_inertia), study.find_controllers(texts)
    with progress("analyse") as report:
        found = loop_gain.measure(controllers, on, amplitude, report)
    show(
        f"loop at a joystick of ±{amplitude:g}",
        ("controller", "plant", *loop_gain.COLUMNS),
        loop_gain.rows(found),
    )
    figures = {c: {p: loop.as_dict() for p, loop in by.items()} for c, by in found.items()}
    write(json, {"loops": figures, "amplitude": amplitude}, seed=1)
    if page is not None:
        words = [*texts, *(f"--plant {p}" for p in plant), f"--amplitude {amplitude:g}"]
        pages.fill_loops(page, found, " ".join(["slewright analyse", *words]))
    swinging = [f"{c} on {p}" for c, by in found.items() for p, loop in by.items() if loop.swings]
    for text in swinging:
        typer.echo(f"swings by itself: {text}")
    if swinging:
        raise typer.Exit(1)


def _linear(controller: str, gain: list[str] | None, gains: Path | None, json: Path | None) -> None:
    """The loop linearised at four poses and loads; exit code 1 where it is not stable."""
    from baselines import gains as from_file, loop as slew_loop, registry

    if controller.endswith(".onnx"):
        raise InputError(f"{controller}: the loop of a policy is not linearised; --plant PLANT measures it")
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
