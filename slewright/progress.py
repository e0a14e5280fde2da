"""Progress of anything that takes more than two seconds, on stderr: the tables on stdout stay clean."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn


class Report(Protocol):
    """What a long function calls now and then: `done` of `total` steps, and what it is doing."""

    def __call__(self, done: float, total: float, what: str = "") -> None: ...


@contextmanager
def progress(title: str) -> Iterator[Report]:
    """Show a bar on a terminal, a line for each new thing elsewhere (logs of continuous integration)."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _lines(console, title)
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(title, total=None)

        def report(done: float, total: float, what: str = "") -> None:
            bar.update(task, completed=done, total=total, description=f"{title}: {what}" if what else title)

        yield report


def _lines(console: Console, title: str) -> Report:
    last = ""

    def report(done: float, total: float, what: str = "") -> None:
        nonlocal last
        if what != last:
            console.print(f"{title}: {what} ({done:g}/{total:g})", highlight=False, soft_wrap=True)
            last = what

    return report
