"""Writes the tables of plants, of controllers on them, and of their loops into pages of the docs."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from records.figures_file import versions
from records.report import markers
from specs import markdown
from verification.plants import character, loop_gain, study
from verification.plants.plant import Plant

PLANTS, CONTROLLERS, LOOPS = "plants", "controllers", "loops"
FIRST = "published"  # what others are compared with in open loop, where it is one of them


def check(page: Path, names: Sequence[str] = (PLANTS, CONTROLLERS)) -> None:
    """InputError for a page without places for the tables."""
    for name in names:
        markers.around(page, name)


def fill_loops(page: Path, found: Mapping[str, Mapping[str, loop_gain.Loop]], command: str) -> None:
    """Write the table of loops, with the `command` that made it."""
    head = f"`{command}`, version {versions()['slewright']}; everything is simulated.\n\n"
    table = markdown.table(("controller", "plant", *loop_gain.COLUMNS), loop_gain.rows(found))
    markers.fill(page, LOOPS, f"{head}{table}\n")


def fill(page: Path, on: Sequence[Plant], found: Mapping[str, Any], command: str) -> None:
    """Write both tables, each with the `command` that made it."""
    head = f"`{command}`, version {versions()['slewright']}; everything is simulated.\n\n"
    ordered = sorted(on, key=lambda plant: plant.name != FIRST)
    characters = character.rows(character.characters(ordered, lambda *said: None))
    apart = markdown.table(("plant", *character.COLUMNS), characters)
    markers.fill(page, PLANTS, f"{head}{apart}\n")
    tried = markdown.table(("controller", "plant", *study.COLUMNS), study.rows(found))
    markers.fill(page, CONTROLLERS, f"{head}{tried}\n")
