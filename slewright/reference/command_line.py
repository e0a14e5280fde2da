"""docs/reference/command-line.md and json-outputs.md, from the commands themselves."""

import enum
import inspect
from collections.abc import Iterator
from typing import Any

from typer.core import TyperArgument, TyperGroup, TyperOption

from records import figures_file
from slewright import __main__ as entry
from slewright.app import COMMANDS, PANELS, load_command
from specs import markdown

SOURCE = "the commands in slewright/commands"
INTRODUCTION = """Every command prints what `--help` says here. `slewright --version` prints the version;
`--traceback` before a command shows where it failed. Exit codes: {codes}

The benchmarks, which need a checkout of the project, are listed by `python -m benchmarks --help`."""
JSON = """Every command that measures something takes `--json FILE` and writes the figures that it prints,
and more of them, as one JSON object. The file is written whole or not at all; NaN and infinities become
`null`. The page about a command says what its keys mean. Two keys are in every file:

- `seed`: the seed of what was drawn, `null` where nothing was
- `versions`: {versions}

These commands write figures:"""


def commands() -> str:
    """Every command, panel by panel: what it does, how it is called, its arguments and options."""
    codes = (inspect.getdoc(entry) or "").splitlines()[2]
    text = [markdown.head("Command line", SOURCE, INTRODUCTION.format(codes=codes))]
    for panel, (_, names) in PANELS.items():
        text += [f"## {panel}\n", *(part for name in names for part in _command(name, load_command(name)))]
    return "\n".join(text)


def json_outputs() -> str:
    """The commands with `--json`, and what all their files have in common."""
    versions = ", ".join(f"`{name}`" for name in figures_file.versions())
    found = [
        (f"[`slewright {path}`](command-line.md#{_anchor(path)})", _first_sentence(command))
        for name in COMMANDS
        for path, command in _walk(name, load_command(name))
        if any("--json" in p.opts for p in command.params)
    ]
    head = markdown.head("JSON outputs", SOURCE, JSON.format(versions=versions))
    return head + "\n" + markdown.table(["command", "does"], found)


def _walk(path: str, command: Any) -> Iterator[tuple[str, Any]]:
    """A command, or those of a group: `deploy keys add` and the like."""
    if isinstance(command, TyperGroup):
        for name, inner in command.commands.items():
            yield from _walk(f"{path} {name}", inner)
    else:
        yield path, command


def _command(name: str, command: Any) -> Iterator[str]:
    for path, inner in _walk(name, command):
        yield f"### slewright {path}\n"
        yield inspect.cleandoc(inner.help or "") + "\n"
        pieces = [_name(p) for p in inner.params if isinstance(p, TyperArgument)]
        yield f"```sh\nslewright {' '.join([path, *pieces, '[OPTIONS]'])}\n```\n"
        rows = [(f"`{_name(p)}`", _meaning(p)) for p in inner.params if not p.hidden]
        if rows:
            yield markdown.table(["argument or option", "meaning"], rows)


def _name(parameter: Any) -> str:
    """As it is typed: `--seed INTEGER`, `--quick`, `FILE...`."""
    if isinstance(parameter, TyperArgument):
        name = (parameter.metavar or parameter.name or "").upper()
        return name + ("..." if parameter.nargs == -1 and not name.endswith(("…", "...")) else "")
    options = "/".join([*parameter.opts, *parameter.secondary_opts])
    return options if parameter.is_flag else f"{options} {parameter.metavar or _kind(parameter)}"


def _kind(parameter: Any) -> str:
    annotation = parameter.type_descriptor.annotation
    if isinstance(annotation, type) and issubclass(annotation, enum.Enum):
        return "|".join(str(choice.value) for choice in annotation)
    inner = getattr(annotation, "__args__", (annotation,))[0]
    return {int: "INTEGER", float: "NUMBER", str: "TEXT"}.get(inner, "FILE")


def _meaning(parameter: Any) -> str:
    """Its help, bounds and default."""
    bounds = [
        f"at least {markdown.number(parameter.min)}" if parameter.min is not None else "",
        f"at most {markdown.number(parameter.max)}" if parameter.max is not None else "",
        "required" if isinstance(parameter, TyperOption) and parameter.required else "",
        f"default: {_default(parameter.default)}" if _shows_default(parameter) else "",
    ]
    extra = "; ".join(text for text in bounds if text)
    return f"{parameter.help or ''}{f' ({extra})' if extra else ''}"


def _shows_default(parameter: Any) -> bool:
    return not (
        getattr(parameter, "is_flag", False)
        or parameter.default in (None, "", ())
        or callable(parameter.default)
    )


def _default(value: Any) -> str:
    return f"`{value.value if isinstance(value, enum.Enum) else value}`"


def _first_sentence(command: Any) -> str:
    return " ".join((command.help or "").split("\n\n")[0].split())


def _anchor(path: str) -> str:
    return "slewright-" + path.replace(" ", "-")
