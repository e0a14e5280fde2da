"""Progress of anything that takes more than two seconds, on stderr: the tables on stdout stay clean."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from specs.progress import Report

if TYPE_CHECKING:
    from rich.console import Console

LINE_S = 15.0  # between lines on the same thing


@contextmanager
def progress(title: str) -> Iterator[Report]:
    """Show a bar on a terminal; elsewhere a line for each new thing, and now and then how far it is."""
    # Imported when something runs: a wrong argument is answered without it, in half the time.
    from rich import progress as bars
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield _lines(console, title)
        return
    columns = (
        bars.SpinnerColumn(),
        bars.TextColumn("{task.description}"),
        bars.BarColumn(),
        bars.TimeElapsedColumn(),
        bars.TimeRemainingColumn(),
    )
    with bars.Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(title, total=None)

        def report(what: str, done: float | None = None, total: float | None = None) -> None:
            bar.update(task, completed=done, total=total, description=f"{title}: {what}")

        yield report


def _lines(console: "Console", title: str) -> Report:
    last, shown = "", 0.0

    def report(what: str, done: float | None = None, total: float | None = None) -> None:
        nonlocal last, shown
        if what != last or time.monotonic() - shown > LINE_S:
            count = "" if done is None or total is None else f" ({done:g}/{total:g})"
            console.print(f"{title}: {what}{count}", highlight=False, soft_wrap=True, markup=False)
            last, shown = what, time.monotonic()

    return report
