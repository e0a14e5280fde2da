"""`slewright hmi`: the operator's page over a recording, and the tokens of the live one."""

import signal
import threading
from pathlib import Path
from typing import Annotated

import typer

from specs.errors import InputError


def hmi(
    recording: Annotated[
        Path | None,
        typer.Argument(
            metavar="RECORDING", help="Folder of segments, a segment (.mcap), or a run record (.parquet)."
        ),
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Where the page is served (0: any).")] = 8080,
    bundle: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="The bundle that ran: it knows what kept the machine from moving (default: where it was).",
            show_default=False,
        ),
    ] = None,
    new_tokens: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Make a token file for a live page, print its tokens once, and stop."
        ),
    ] = None,
) -> None:
    """Play a recording back in the operator's page (on this computer, until Ctrl-C): docs/how-to/hmi.md."""

    if (recording is None) == (new_tokens is None):
        raise InputError("either RECORDING to play back, or --new-tokens FILE")
    from runtime.hmi import playback, process, retold, timeline, tokens

    if new_tokens:
        show_tokens(tokens.make(new_tokens), new_tokens)
        return
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    path = recording or Path()
    teller, why = retold.retold(path, bundle) if path.exists() else (None, "")
    moments = playback.checked(timeline.open_timeline(path, teller))
    player = playback.Playback(moments, why)
    site = process.open_site({"host": "127.0.0.1", "port": port}, player.routes(), None)
    for note in [
        *moments.notes,
        *([f"what kept the machine from moving is not shown: {why}"] if why else []),
    ]:
        typer.echo(f"slewright: {note}", err=True)
    typer.echo(f"{moments.duration:.1f} s of {recording}: http://127.0.0.1:{site.port}/ (Ctrl-C ends)")
    threading.Thread(target=player.read, daemon=True).start()
    try:
        site.serve_forever()
    except KeyboardInterrupt:
        typer.echo("ended")
    finally:
        player.stop()
        site.server_close()


def show_tokens(made: dict[str, str], path: Path) -> None:
    """Say them, once."""
    for role, token in made.items():
        typer.echo(f"token of {role}: {token}")
    typer.echo(f"shown this once; {path} holds only their SHA-256")
