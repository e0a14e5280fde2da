"""`slewright tune`: controller gains."""

import typer

from slewright.figures import JsonOption, write
from slewright.progress import progress

app = typer.Typer(help="Find a controller's gains.", no_args_is_help=True)


@app.callback()
def tune() -> None:
    """Find a controller's gains."""


@app.command()
def pi(json: JsonOption = None) -> None:
    """Tune the PI controller on the tuning draws and write gains, margins and how they were found."""
    from baselines.pi.tune import run

    with progress("tune pi") as report:
        figures = run(report)
    write(json, figures, figures.get("seed"))
