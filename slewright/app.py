"""The command line's table of contents: each command is a small file in `slewright/commands`.

A command's file is imported when the command is asked for, and what it runs inside its function: `--version`
and a wrong word answer at once, and a command works without the packages that only another one needs.
"""

import os
from collections.abc import Mapping
from importlib import import_module
from typing import Annotated, Any, ClassVar

import typer
from typer.core import TyperGroup

from specs.errors import InputError
from specs.version import VERSION

ROOMS = (  # the packages of an installation
    *("specs", "records", "fmus", "orchestrator", "runtime", "baselines", "learning"),
    *("verification", "deployment", "reconcile", "slewright"),
)
TRACEBACK = "SLEWRIGHT_TRACEBACK"

# Panel of `--help` -> (folder of slewright/commands, its commands).
PANELS = {
    "Simulate and verify": (
        "simulation",
        ("verify", "simulate", "check", "plot", "campaign", "convert", "build", "fmu"),
    ),
    "Controllers": (
        "controllers",
        (
            *("compare", "evaluate", "reproduce", "scenes", "throw", "tune", "analyse"),
            *("calibrate", "estimate", "optimum"),
        ),
    ),
    "Learn from recordings and in simulation": ("learning", ("collect", "train", "fit", "import")),
    "Reconcile model and measurement": ("reconciling", ("reconcile", "effects")),
    "On the machine": (
        "machine",
        (
            *("bundle", "deploy", "commission", "run", "hmi", "replay", "shadow"),
            *("machine", "hil", "faults", "bench", "canopen"),
        ),
    ),
    "Develop": ("developing", ("generate",)),
}
COMMANDS = {  # name -> its module; `import` is Python's
    name: f"slewright.commands.{folder}.{'import_' if name == 'import' else name}"
    for folder, names in PANELS.values()
    for name in names
}
PANEL_OF = {name: panel for panel, (_, names) in PANELS.items() for name in names}
# Commands of developers that have moved: what was typed -> what to type.
MOVED = {name: f"python -m benchmarks {name}" for name in ("dossier", "testpack", "reconcile-suite")}


class CommandGroup(TyperGroup):
    """Finds commands by name and imports only the module of the one that is asked for."""

    modules: ClassVar[Mapping[str, str]] = {}
    panels: ClassVar[Mapping[str, str]] = {}
    moved: ClassVar[Mapping[str, str]] = {}

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = dict.fromkeys(self.modules)  # type: ignore[assignment]  # names, for suggestions

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command `cmd_name`, None if there is none; InputError for one that has moved."""
        if cmd_name in self.moved:
            raise InputError(f"'{cmd_name}' is a command for developers: {self.moved[cmd_name]}")
        if cmd_name not in self.modules:
            return None
        return load(self.modules[cmd_name], cmd_name, self.panels.get(cmd_name))


class Commands(CommandGroup):
    """The commands of `slewright`."""

    modules = COMMANDS
    panels = PANEL_OF
    moved = MOVED


def load_command(name: str) -> Any:
    """The command `name` of the table above."""
    return load(COMMANDS[name], name, PANEL_OF[name])


def load(module: str, name: str, panel: str | None = None) -> Any:
    """The command of a module: its `app` of several commands, or else its function `name`."""
    found = import_module(module)
    several = getattr(found, "app", None)
    if several is None:
        several = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        several.command(name)(getattr(found, name.replace("-", "_")))
    command = typer.main.get_command(several)
    command.name, command.rich_help_panel = name, panel  # type: ignore[attr-defined]
    return command


app = typer.Typer(
    name="slewright",
    cls=Commands,
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
