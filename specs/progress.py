"""What long functions report while they run; whoever called shows it."""

from collections.abc import Callable

# report(what) or report(what, done, total): what is being done and, if known, `done` of `total` steps of it.
Report = Callable[..., None]
