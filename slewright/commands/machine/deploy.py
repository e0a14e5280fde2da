"""`slewright deploy`: signed bundles on a machine: install, list, go back."""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from records.figures_file import write
from slewright.commands.machine import deploy_keys
from slewright.commands.machine.deploy_keys import KeysOption
from slewright.figures import JsonOption
from slewright.tables import show
from specs.errors import InputError

if TYPE_CHECKING:
    from runtime.archive.install import Offer

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
    _show(offered)
    accepted = _accepted(offered.signed.digest, accept)
    if accepted:
        installing.install(place, offered)
        typer.echo(f"{offered.signed.name} runs from the next start on")
    write(json, {**_figures(offered), "installed": accepted})
    if not accepted:
        typer.echo(f"not installed; accept it with --accept {offered.signed.digest[:SHORTEST]}", err=True)
        raise typer.Exit(1)


@app.command()
def rollback(store: StoreOption, keys: KeysOption = None, json: JsonOption = None) -> None:
    """Let the last good bundle, one that has run, be the active one again, from the next start on."""
    from runtime.archive import install as installing, start

    done = installing.roll_back(start.Place(store, keys))
    _show(done)
    typer.echo(f"back to {done.signed.name}, from the next start on")
    write(json, _figures(done))


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


def _show(offered: "Offer") -> None:
    signed = offered.signed
    typer.echo(f"{signed.name}, signed by {signed.signer}, digest {signed.digest}")
    if offered.first:
        typer.echo("the first bundle of this store: nothing to compare with")
    elif offered.unknown:
        typer.echo(f"what it changes cannot be told: {offered.unknown}")
    elif not offered.changes:
        typer.echo("nothing is different from the active bundle")
    _sections(offered.changes)


def _sections(changes: Iterable[Any]) -> None:
    section = ""
    for change in changes:
        if change.section != section:
            section = change.section
            typer.echo(f"{section}:")
        typer.echo(f"  {change}")


def _figures(offered: "Offer") -> dict[str, Any]:
    changes = [vars(change) for change in offered.changes]
    signed = offered.signed
    return {"digest": signed.digest, "name": signed.name, "signed_by": signed.signer, "changes": changes}
