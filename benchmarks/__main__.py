"""`python -m benchmarks`: measures how fast and how right Slewright is; for developers, not in the wheel."""

import typer

from slewright.__main__ import main
from slewright.app import CommandGroup, options

NAMES = (
    *("orchestrator", "model-exchange", "lsbus", "campaign", "slew_nn", "nmpc", "training", "showcases"),
    *("testpack", "reconcile-suite", "rigs", "dossier", "large-recordings"),
)
MODULES = {name: f"benchmarks.commands.{name.replace('-', '_')}" for name in NAMES}


class Benchmarks(CommandGroup):
    """The commands of developers."""

    modules = MODULES


app = typer.Typer(
    name="benchmarks",
    cls=Benchmarks,
    help="Measure how fast and how right Slewright is, against others. `slewright bench` is for any machine.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.callback()(options)

if __name__ == "__main__":
    main(commands=app, name="python -m benchmarks")
