"""The project's two kinds of failure that a user sees; the command line turns them into exit codes."""

import difflib
from collections.abc import Iterable, Sequence


class InputError(Exception):
    """Wrong input: said in one or two lines that name the offender and the valid choices (exit code 2)."""


class RunError(Exception):
    """A failure during a run; what was recorded so far is kept and marked incomplete (exit code 3)."""


class HungError(RunError):
    """An FMU that did not answer in time; the message names the call."""


def nearest(name: str, choices: Iterable[str], count: int = 3) -> str:
    """Return a phrase with the valid choices nearest to `name`, for error messages."""
    options = sorted(choices)
    close = difflib.get_close_matches(name, options, n=count, cutoff=0.5)
    if close:
        return "did you mean " + " or ".join(close) + "?"
    return f"valid: {listed(options, 12)}" if options else "there is none"


def listed(names: Sequence[str], count: int = 5) -> str:
    """The first `count` names, and how many there are where there are more."""
    return ", ".join(names[:count]) + (f" … ({len(names)} in all)" if len(names) > count else "")
