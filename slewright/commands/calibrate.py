"""`slewright calibrate`: tables measured on the reference machine."""

import typer

from slewright.figures import JsonOption, write
from slewright.progress import progress

app = typer.Typer(help="Measure a controller's tables on the reference machine.", no_args_is_help=True)


@app.callback()
def calibrate() -> None:
    """Measure a controller's tables on the reference machine."""


@app.command()
def lut(json: JsonOption = None) -> None:
    """Sweep the arm valves and write the 25-point feed-forward tables."""
    from baselines.arm_velocity.calibrate import run

    with progress("calibrate lut") as report:
        figures = run(report)
    write(json, figures, figures.get("seed"))


@app.command()
def arm(json: JsonOption = None) -> None:
    """Step the arm's velocity references and write the nominal arm's response and delay."""
    from baselines.arm_velocity.identify import run

    with progress("calibrate arm") as report:
        figures = run(report)
    write(json, figures, figures.get("seed"))
