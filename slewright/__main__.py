"""Entry point: runs the command line and turns failures into exit codes and one or two plain lines.

0 done and accepted; 1 done, limits not met; 2 wrong input; 3 failed during a run; 130 interrupted.
"""

import os
import sys
from collections.abc import Sequence
from io import TextIOWrapper

import typer

from slewright.app import ROOMS, TRACEBACK, app
from specs.errors import InputError, RunError

WRONG_INPUT, FAILED, INTERRUPTED = 2, 3, 130
EXTRAS = {
    **dict.fromkeys(("asammdf", "can", "mcap"), "formats"),
    **dict.fromkeys(("onnx", "torch"), "learning"),
    **dict.fromkeys(("coal", "ompl", "toppra"), "scenes"),
    "foxglove": "interfaces",
}


def main(
    arguments: Sequence[str] | None = None, commands: typer.Typer = app, name: str = "slewright"
) -> None:
    """Run `slewright` with `arguments` (default: the process's) and exit with its code."""
    _show_anything()
    sys.exit(run(arguments, commands, name))


def _show_anything() -> None:
    """Show `?` for a sign that the terminal or log cannot hold: no run ends because of a degree sign."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")


def run(arguments: Sequence[str] | None = None, commands: typer.Typer = app, name: str = "slewright") -> int:
    """Run `slewright` and return its exit code; --traceback lets the exception through instead.

    `python -m benchmarks` runs its own `commands` the same way, under its own `name`.
    """
    try:
        code = commands(arguments, prog_name=name, standalone_mode=False)
    except KeyboardInterrupt:
        code = INTERRUPTED
    except typer.Abort:
        code = INTERRUPTED
    except Exception as error:  # the outermost frame: nothing above could report it
        if os.environ.get(TRACEBACK):
            raise
        code, message = _verdict(error, name)
        if message:
            print(f"{name}: {message}", file=sys.stderr)
    if code == INTERRUPTED:
        print(f"{name}: interrupted", file=sys.stderr)
    return code if isinstance(code, int) else 0


def _verdict(error: Exception, name: str) -> tuple[int, str]:
    """Exit code and message of a failure; no message where the help page is the answer."""
    if isinstance(error, InputError):
        return WRONG_INPUT, str(error)
    if isinstance(error, typer.TyperException):
        text = " ".join(error.format_message().split())
        return WRONG_INPUT, text and f"{text} (see {name} --help)"
    if isinstance(error, RunError):
        return FAILED, str(error)
    if isinstance(error, ModuleNotFoundError) and error.name:
        return WRONG_INPUT, _missing(error.name)
    if isinstance(error, OSError):
        return FAILED, str(error)
    return FAILED, f"internal error: {type(error).__name__}: {error}\n(slewright --traceback … shows where)"


def _missing(module: str) -> str:
    """What to say when `module` is not there: part of this project, or of an extra that is not installed."""
    if module.partition(".")[0] in ROOMS:
        return f"this command needs {module}, which this version does not have"
    extra = EXTRAS.get(module.partition(".")[0], "verify")
    return (
        f"this command needs the Python package {module}; install it with: pip install 'slewright[{extra}]'"
    )


if __name__ == "__main__":
    main()
