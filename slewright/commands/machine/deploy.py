"""`slewright deploy`: signed bundles on a machine: install, list, go back."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.commands.machine import deploy_keys
from slewright.commands.machine.deploy_keys import KeysOption
from slewright.figures import JsonOption
from slewright.tables import show
from specs.errors import InputError

app = typer.Typer(help="Signed bundles on a machine (docs/how-to/bundles.md).", no_args_is_help=True)
app.add_typer(deploy_keys.app, name="keys")

StoreOption = Annotated[Path, typer.Option("--store", metavar="DIR", help="The machine's store.")]
SHORTEST = 8  # digits of a digest that are enough to accept it


@app.callback()
def deploy() -> None:
    """Signed bundles on a machine (docs/how-to/bundles.md)."""


@app.command()
def install(
    archive: Annotated[Path, typer.Argument(metavar="FILE.slwb", help="Of slewright bundle --sign.")],
    store: StoreOption,
    keys: KeysOption = None,
    accept: Annotated[
        str | None,
        typer.Option(metavar="DIGEST", help="Accept what it changes: its digest, 8 digits or more."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Check an archive, show what it changes, and, if that is accepted, let it run from the next start on."""
    from runtime.archive import install as installing, start

    place = start.Place(store, keys)
    offered = installing.offer(place, archive)
    for line in offered.lines():
        typer.echo(line)
    accepted = _accepted(offered.signed.digest, accept)
    if accepted:
        installing.install(place, offered)
        typer.echo(f"{offered.signed.name} runs from the next start on")
    write(json, {**offered.figures(), "installed": accepted})
    if not accepted:
        typer.echo(f"not installed; accept it with --accept {offered.signed.digest[:SHORTEST]}", err=True)
        raise typer.Exit(1)


@app.command()
def rollback(store: StoreOption, keys: KeysOption = None, json: JsonOption = None) -> None:
    """Let the last good bundle, one that has run, be the active one again, from the next start on."""
    from runtime.archive import install as installing, start

    done = installing.roll_back(start.Place(store, keys))
    for line in done.lines():
        typer.echo(line)
    typer.echo(f"back to {done.signed.name}, from the next start on")
    write(json, done.figures())


@app.command("list")
def list_(store: StoreOption, keys: KeysOption = None, json: JsonOption = None) -> None:
    """The bundles of a store, each checked as at a start; exit code 1 if the active one would not run."""
    from runtime.archive import overview, start

    found = overview.overview(start.Place(store, keys))
    columns = ["", "controller", "release", "digest", "signed by", "has run", "state"]
    show(f"store {store}", columns, [e.row() for e in found.entries])
    for name in found.damaged:
        typer.echo(f"slewright: {name} is damaged", err=True)
    write(json, {"damaged": found.damaged, "bundles": [e.figures() for e in found.entries]})
    if not found.runs:
        raise typer.Exit(1)


def _accepted(digest: str, given: str | None) -> bool:

    if given is None:
        return sys.stdin.isatty() and typer.confirm("Is this what you want to run?")
    if len(given) < SHORTEST or not digest.startswith(given.lower()):
        raise InputError(
            f"--accept {given}: the archive's digest is {digest} (give {SHORTEST} digits or more); "
            "nothing was installed"
        )
    return True
