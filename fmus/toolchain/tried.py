"""Tries a model file's equations once: what is wrong is said with file, line and the valid names."""

import traceback
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from fmus.definition import Model
from specs.errors import InputError

LONGEST = 300  # characters of what a foreign exception says
EQUATIONS = (("rhs", "f"), ("out", "h"), ("initial", "x0"), ("a mode's guard", "guards"))
KINDS = {"x": "states", "u": "inputs", "m": "modes", "p": "parameters"}


def try_equations(model: Model, file: Path) -> None:
    """Evaluate all equations of a model of `file`; InputError for one that raises or returns nonsense."""
    for what, symbol in EQUATIONS:
        own = getattr(model, what, None)
        tried(lambda symbol=symbol: getattr(model, symbol), own, what, model, file)


def tried(call: Callable[[], Any], own: Any, what: str, model: Model, file: Path) -> None:
    """Make a call of a user's function `own`; raises InputError that says where in `file` it went wrong."""
    try:
        call()
    except InputError as error:
        raise InputError(f"{file}{_defined(own)}: {error}") from error
    except Exception as error:  # the file is the user's: whatever its equations do is wrong input
        at = line(error, file) or _defined(own)
        raise InputError(shortened(f"{file}{at}: {what}: {_said(error, model)}")) from error


def line(error: BaseException, file: Path) -> str:
    """Where in `file` an exception came from, as ", line 3"; "" if not from there."""
    if isinstance(error, SyntaxError):
        return ""  # which says it itself
    frames = traceback.extract_tb(error.__traceback__)
    inside = [f.lineno for f in frames if Path(f.filename).resolve() == file.resolve()]
    return f", line {inside[-1]}" if inside else ""


def shortened(message: str) -> str:
    """The beginning of a message, on one line."""
    kept = " ".join(message.split())
    return kept if len(kept) <= LONGEST else kept[: LONGEST - 2] + " …"


def _defined(own: Any) -> str:
    """Where a function begins, as ", line 3"; "" where that is not known."""
    code = getattr(own, "__code__", None)
    return f", line {code.co_firstlineno}" if code else ""


def _said(error: Exception, model: Model) -> str:
    """What an exception says; of a name that is not there which ones are."""
    groups = {letter: [v.name for v in getattr(model, kind)] for letter, kind in KINDS.items()}
    if isinstance(error, NameError):
        return f"{error}{_elsewhere(error.name, groups)}"
    if isinstance(error, AttributeError) and isinstance(error.obj, SimpleNamespace):
        letter = next((k for k, names in groups.items() if set(names) == {*vars(error.obj)}), "")
        if letter:
            valid = ", ".join(groups[letter]) or "none"
            return f"no '{error.name}' in {KINDS[letter]} ({valid}){_elsewhere(error.name, groups)}"
    return f"{type(error).__name__}: {error}"


def _elsewhere(name: str | None, groups: dict[str, list[str]]) -> str:
    """A hint at the group that has a name."""
    return next((f"; write {k}.{name}" for k, names in groups.items() if name in names), "")
