"""`slewright deploy keys`: the keys that sign bundles, and those that a machine trusts."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from records.figures_file import write, write_text
from slewright.figures import JsonOption
from slewright.tables import show
from specs.errors import InputError

if TYPE_CHECKING:
    from runtime.archive.keys import PrivateKey

app = typer.Typer(help="Keys that sign bundles, and those that a machine trusts.", no_args_is_help=True)

VARIABLE = "SLEWRIGHT_PASSPHRASE"
StoreOption = Annotated[
    Path | None, typer.Option("--store", metavar="DIR", help="The store whose keys they are (DIR/keys).")
]
KeysOption = Annotated[
    Path | None,
    typer.Option("--keys", metavar="DIR", help="Folder of the trusted keys, if not in the store."),
]


def passphrase() -> str:
    """The passphrase of a private key: from the environment, else asked."""
    return _asked("passphrase of the key")


@app.command()
def new(
    file: Annotated[Path, typer.Argument(metavar="KEY.pem", help="The private key; it must not be there.")],
    encrypt: Annotated[bool, typer.Option("--encrypt", help="Encrypt it; the passphrase is asked.")] = False,
    by: Annotated[
        Path | None,
        typer.Option("--endorsed-by", metavar="OLD.pem", help="Private key that machines trust already."),
    ] = None,
) -> None:
    """Make a key: KEY.pem, to be kept where bundles are signed, and KEY.pub.pem for the machines."""
    from runtime.archive import keys

    if file.suffix != ".pem":
        raise InputError(f"{file}: a key's file ends in .pem")
    old = keys.read_private(by, passphrase) if by else None
    secret = _asked("passphrase of the new key", twice=True) if encrypt else ""
    made = keys.new(file, secret)
    typer.echo(f"{file}: private; whoever has it can sign bundles for the machines that trust it")
    typer.echo(f"{keys.public_path(file)}: public, key {made.public.id}")
    if old:
        _endorse(keys.public_path(file), old)


@app.command()
def endorse(
    public: Annotated[Path, typer.Argument(metavar="KEY.pub.pem", help="The new public key.")],
    by: Annotated[Path, typer.Option(metavar="OLD.pem", help="Private key that machines trust already.")],
) -> None:
    """Sign a new public key with an old private one, so that machines take it."""
    from runtime.archive import keys

    _endorse(public, keys.read_private(by, passphrase))


@app.command()
def add(
    public: Annotated[Path, typer.Argument(metavar="KEY.pub.pem", help="The public key.")],
    store: StoreOption = None,
    keys: KeysOption = None,
    name: Annotated[str, typer.Option(metavar="NAME", help="What to call it (default: the file's).")] = "",
) -> None:
    """Trust a key: the first one as it is, later ones with their endorsement beside them (.endorsed)."""
    from runtime.archive import keys as files, trust

    key = files.read_public(public)
    folder, called = _folder(store, keys), name or public.name.split(".")[0]
    beside = endorsement(public)
    by = trust.add(folder, called, key, files.read(beside) if beside.is_file() else None)
    said = f"endorsed by {by}" if by else "the first: compare its id with the one where it was made"
    typer.echo(f"{folder}: {called}, key {key.id}, {said}")


@app.command()
def retire(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name or id of the key.")],
    store: StoreOption = None,
    keys: KeysOption = None,
    now: Annotated[
        bool, typer.Option("--now", help="Even if the active bundle then no longer runs (a key that leaked).")
    ] = False,
) -> None:
    """Trust a key no more; bundles that it signed are refused from the next start on."""
    from runtime.archive import overview, start, trust

    folder = _folder(store, keys)
    if not now:
        if store is None:
            raise InputError("which store's active bundle may need the key? --store DIR, or --now")
        overview.check_retirement(start.Place(store, keys), name)
    found = trust.retire(folder, name)
    typer.echo(f"{folder}: {found.name} ({found.key.id}) is retired")


@app.command("list")
def list_(store: StoreOption = None, keys: KeysOption = None, json: JsonOption = None) -> None:
    """The keys of a machine."""
    from runtime.archive import trust

    folder = _folder(store, keys)
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder; slewright deploy keys add makes it")
    known = trust.read(folder).known
    rows = [(k.name, k.key.id, "retired" if k.retired else "trusted") for k in known]
    show(f"keys in {folder}", ["name", "key", ""], rows)
    write(json, {"keys": [{"name": n, "key": i, "state": s} for n, i, s in rows]})


def endorsement(public: Path) -> Path:
    """Where the endorsement of a public key's file is looked for."""
    return public.with_name(public.name + ".endorsed")


def _endorse(public: Path, by: "PrivateKey") -> None:
    from runtime.archive import keys, trust

    key = keys.read_public(public)
    write_text(endorsement(public), trust.endorse(key, by).decode())
    typer.echo(f"{endorsement(public)}: {key.id} endorsed by {by.public.id}")


def _folder(store: Path | None, keys: Path | None) -> Path:
    from runtime.archive.start import Place

    if store is None and keys is None:
        raise InputError("which machine's keys? --store DIR, or --keys DIR")
    return Place(store or Path(), keys).keys


def _asked(what: str, twice: bool = False) -> str:

    if given := os.environ.get(VARIABLE):
        return given
    if not sys.stdin.isatty():
        raise InputError(f"{what}: there is no terminal to ask on; set {VARIABLE}")
    return typer.prompt(what, hide_input=True, confirmation_prompt=twice, err=True)
