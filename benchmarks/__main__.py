"""`python -m benchmarks`: measures how fast and how right Slewright is; for developers, not in the wheel."""

import typer

from benchmarks.commands import dossier, measure, reconcile_suite, testpack
from slewright.__main__ import main
from slewright.app import options

app = typer.Typer(
    name="benchmarks",
    help="Measure how fast and how right Slewright is, against others. `slewright bench` is for any machine.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.callback()(options)
app.command()(measure.orchestrator)
app.command()(measure.campaign)
app.command("slew_nn")(measure.slew_nn)
app.command()(measure.nmpc)
app.command()(measure.training)
app.command()(measure.pendulum)
app.command()(measure.showcases)
app.command("testpack")(testpack.write_pack)
app.command("reconcile-suite")(reconcile_suite.reconcile_suite)
app.command()(dossier.dossier)

if __name__ == "__main__":
    main(commands=app, name="python -m benchmarks")
