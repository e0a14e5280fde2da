"""The pages of docs/reference that are generated: each from the definitions that the code itself uses."""

from collections.abc import Callable
from pathlib import Path

from reconcile.page import catalogue_table as effects
from records.formats import page as formats
from slewright.reference import command_line
from specs import pages, places, tables

FOLDER = Path(__file__).parents[2] / "docs" / "reference"

# Name of the page -> function that renders it; deterministic to the byte.
PAGES: dict[str, Callable[[], str]] = {
    "command-line.md": command_line.commands,
    "json-outputs.md": command_line.json_outputs,
    "signals.md": tables.signals_markdown,
    "places.md": places.page,
    "parameters.md": pages.parameters,
    "effects.md": effects.page,
    "file-formats.md": formats.page,
}


def write(check: bool = False, folder: Path = FOLDER) -> list[Path]:
    """Write every page that differs (`check`: only say so); the paths that did.

    An installed package has no docs: nothing is written there.
    """
    if not folder.is_dir():
        return []
    wanted = {folder / name: render() for name, render in PAGES.items()}
    stale = [path for path, text in wanted.items() if not path.is_file() or path.read_text("utf-8") != text]
    for path in () if check else stale:
        path.write_text(wanted[path], encoding="utf-8")
    return stale
