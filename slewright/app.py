"""The command line's table of contents: each command is a small file in `slewright/commands`.

Command files import only typer at the top and what they run inside the function, so that `--help` is
instant and a command works without the packages that only another one needs.
"""

import os
from typing import Annotated

import typer

from slewright.commands import (
    analyse,
    bench,
    build,
    bundle,
    calibrate,
    campaign,
    check,
    collect,
    commission,
    compare,
    convert,
    deploy,
    dossier,
    effects,
    estimate,
    evaluate,
    faults,
    fit,
    generate,
    hil,
    hmi,
    import_,
    machine,
    optimum,
    reconcile,
    reconcile_suite,
    replay,
    run,
    shadow,
    simulate,
    testpack,
    train,
    tune,
    verify,
)
from specs.version import VERSION

ROOMS = (
    "specs",
    "records",
    "fmus",
    "orchestrator",
    "runtime",
    "baselines",
    "learning",
    "reconcile",
    "blindtest",
    "slewright",
)
TRACEBACK = "SLEWRIGHT_TRACEBACK"

app = typer.Typer(
    name="slewright",
    help="Co-simulate, control and verify a hydraulic material handler with a free-swinging tool.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"slewright {VERSION}")
        raise typer.Exit


def _keep_traceback(wanted: bool) -> None:
    if wanted:
        os.environ[TRACEBACK] = "1"


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and stop."),
    ] = False,
    traceback: Annotated[
        bool,
        typer.Option("--traceback", callback=_keep_traceback, help="For developers: show where it failed."),
    ] = False,
) -> None:
    """Options of every command."""


app.command()(verify.verify)
app.command()(simulate.simulate)
app.command()(check.check)
app.command()(campaign.campaign)
app.command()(collect.collect)
app.command()(compare.compare)
app.command()(evaluate.evaluate)
app.command()(tune.tune)
app.command()(analyse.analyse)
app.command()(convert.convert)
app.command()(build.build)
app.command()(bundle.bundle)
app.command()(generate.generate)
app.command()(dossier.dossier)
app.command()(commission.commission)
app.command()(run.run)
app.command()(hil.hil)
app.command()(machine.machine)
app.command()(hmi.hmi)
app.command()(faults.faults)
app.command()(replay.replay)
app.command()(shadow.shadow)
app.command()(reconcile.reconcile)
app.command()(effects.effects)
app.command()(optimum.optimum)
app.command("reconcile-suite")(reconcile_suite.reconcile_suite)
app.command("testpack")(testpack.write_pack)
app.add_typer(bench.app, name="bench")
app.add_typer(fit.app, name="fit")
app.add_typer(calibrate.app, name="calibrate")
app.add_typer(train.app, name="train")
app.add_typer(estimate.app, name="estimate")
app.add_typer(import_.app, name="import")
app.add_typer(deploy.app, name="deploy")
