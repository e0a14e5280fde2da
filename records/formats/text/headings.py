"""Names and units in the heading of a column, and which columns may be the clock.

A unit stands in square brackets behind the name, in round ones, or behind a slash or "in" where the clock's
heading is written so.  A single letter in round brackets is one if it has blanks about it, or the clock's
unit stands in such brackets after a blank too.  All of that holds of known units only; else, where two
columns would get one name, and for numbers in brackets of several columns, what stands there is part of the
name.
"""

import re
from collections import Counter
from collections.abc import Sequence

from records.formats.tables import Heading, clock_name
from records.formats.units import is_unit, of_time, zone_s
from specs.signals import signals

LONGEST = 1000  # characters of a heading in which a unit is looked for
SQUARE = re.compile(r"^(?P<name>.*?\S)(?P<blank>\s*)\[(?P<unit>[^\[\]]*)\]$")
ROUND = re.compile(r"^(?P<name>.*?\S)(?P<blank>\s*)\((?P<unit>[^()]*)\)$")
SLASH = re.compile(r"^(?P<name>[^/]+?)\s*/\s*(?P<unit>.+)$")
IN = re.compile(r"^(?P<name>.+?)\s+in\s+(?P<unit>\S+)$")
RUN = re.compile(r"^Run\s*#?\s*(\d+)\s*:\s*(.+)$|^(.*\S)\s+Run\s*#?\s*(\d+)$", re.IGNORECASE)


def headings_of(cells: Sequence[str], ours: bool = False) -> list[Heading]:
    """Name and unit of each column; `ours`: this project wrote the file, `name [unit]` throughout."""
    if ours:
        return [_square(cell, True) or Heading(cell) for cell in cells]
    style = next((s for s in (SLASH, IN) if any(_clock_in(cell, s) for cell in cells)), None)
    letters = _with_letters(cells)
    found = _of_runs([_run(cell) for cell in cells], style)
    found = found or [_heading(cell, style, cell in letters) for cell in cells]
    indexed = Counter(m["name"] for c in cells if (m := _match(SQUARE, c)) and m["unit"].isdigit())
    found = [Heading(c) if indexed[h.name] > 1 else h for h, c in zip(found, cells, strict=True)]
    names = Counter(h.name for h in found)
    return [
        Heading(c) if names[h.name] > 1 and not _is_clock(h) else h for h, c in zip(found, cells, strict=True)
    ]


def _with_letters(cells: Sequence[str]) -> set[str]:
    """Headings that end with a letter in round brackets as the clock's does: `time (s)`, `voltage (V)`.

    Not of several columns that differ in the letter alone: `current (A)`, `current (B)`.
    """
    found = {c: m for c in cells if (m := _match(ROUND, c)) and m["blank"]}
    names = Counter(m["name"] for m in found.values())
    if not any(clock_name(m["name"]) and of_time(m["unit"].strip()) for m in found.values()):
        return set()
    return {
        c for c, m in found.items() if names[m["name"]] == 1 and len(m["unit"]) == 1 and m["unit"].isalpha()
    }


def _run(cell: str) -> tuple[str, str]:
    """A heading without its run, as in `Run 2: Time (s)` or `Time (s) Run #2`, and the run's number."""
    match = RUN.match(cell) if len(cell) <= LONGEST else None
    if match is None:
        return cell, ""
    return (match[2], match[1]) if match[1] else (match[3], match[4])


def _of_runs(cells: Sequence[tuple[str, str]], style: re.Pattern[str] | None) -> list[Heading] | None:
    """Headings of a file of runs: those of the first one without its number, of others with it behind.

    None where not every column is of a run.
    """
    if not cells or not all(run for _, run in cells):
        return None
    first, heads = cells[0][1], [_heading(cell, style, letter=True) for cell, _ in cells]
    return [
        h if run == first else Heading(f"{h.name}.{run}", h.unit, h.text)
        for h, (_, run) in zip(heads, cells, strict=True)
    ]


def _is_clock(head: Heading) -> bool:
    """Whether it is a clock's with its unit; several of them are told apart later."""
    return clock_name(head.name) and of_time(head.unit)


def _match(style: re.Pattern[str], cell: str) -> re.Match[str] | None:
    """A heading written in a style; none of a cell so long that the search would take minutes."""
    return style.match(cell) if len(cell) <= LONGEST else None


def _clock_in(cell: str, style: re.Pattern[str]) -> bool:
    match = _match(style, cell)
    return bool(match and clock_name(match["name"]) and of_time(match["unit"]))


def _heading(cell: str, style: re.Pattern[str] | None, letter: bool = False) -> Heading:
    """`letter`: a unit in round brackets may be a letter."""
    if found := _square(cell, False):
        return found
    if match := _match(ROUND, cell):
        name, unit = match["name"], match["unit"].strip()
        more = len(unit) > 1 or not unit.isalnum()
        long = letter or (more and unit != "min")  # p(A), x(t) and p(min) are names
        apart = match["unit"] == f" {unit} "
        clock = clock_name(name) and _of_clock(unit)
        if ((long or apart) and is_unit(unit)) or clock or name in signals():
            return Heading(name, unit, cell)
    if style and (match := _match(style, cell)) and is_unit(match["unit"].strip("()[]")):
        return Heading(match["name"], match["unit"].strip("()[]"), cell)
    return Heading(cell)


def _of_clock(unit: str) -> bool:
    """Whether it may stand behind a clock's name: a unit of time, or the zone of its dates."""
    return of_time(unit) or zone_s(unit) is not None


def _square(cell: str, ours: bool) -> Heading | None:
    match = _match(SQUARE, cell)
    if not match:
        return None
    name, unit = match["name"], match["unit"].strip()
    if not ours and unit.isdigit() and not match["blank"]:
        return None  # an index
    # A known signal with a strange unit is refused by name later, and a clock with one, too.
    clock = clock_name(name) and (
        match["blank"] or ":" in unit or zone_s(unit) is not None
    )  # t[i] is an array
    if ours or not unit or is_unit(unit) or name in signals() or clock:
        return Heading(name, unit, cell)
    return None
