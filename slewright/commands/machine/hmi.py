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
    if new_tokens:
        from runtime.hmi.tokens import make

        show_tokens(make(new_tokens), new_tokens)
        return
    _play(recording or Path(), port)


def show_tokens(made: dict[str, str], path: Path) -> None:
    """Say them, once."""
    for role, token in made.items():
        typer.echo(f"token of {role}: {token}")
    typer.echo(f"shown this once; {path} holds only their SHA-256")


def _play(recording: Path, port: int) -> None:

    from runtime.hmi.playback import Playback, checked
    from runtime.hmi.process import open_site
    from runtime.hmi.timeline import open_timeline

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    timeline = checked(open_timeline(recording))
    playback = Playback(timeline)
    site = open_site({"host": "127.0.0.1", "port": port}, playback.routes(), None)
    for note in timeline.notes:
        typer.echo(f"slewright: {note}", err=True)
    typer.echo(f"{timeline.duration:.1f} s of {recording}: http://127.0.0.1:{site.port}/ (Ctrl-C ends)")
    reading = threading.Thread(target=playback.read, daemon=True)
    reading.start()
    try:
        site.serve_forever()
    except KeyboardInterrupt:
        typer.echo("ended")
    finally:
        playback.stop()
        site.server_close()
