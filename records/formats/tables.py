"""Tables with one time column, as CSV and Parquet files are: their headers, and which column is the time."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from records.formats.units import PER_SECOND, spelled
from specs.errors import InputError, nearest
from specs.units import UNITS

CLOCKS = ("time", "timestamp", "timestamps", "t", "zeit", "datetime", "date_time", "date")  # in order
BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*$")
ROUND = re.compile(r"^(?P<name>.*?)\s*\((?P<unit>[^()]*)\)\s*$")


@dataclass(frozen=True)
class Heading:
    """The name of a column and the unit beside it ("" where there is none)."""

    name: str
    unit: str = ""


def heading(text: str) -> Heading:
    """Read `name [unit]`, or `name (unit)` where what stands there is a unit."""
    text = text.strip()
    if match := BRACKETS.match(text):
        return Heading(match["name"], match["unit"].strip())
    if (match := ROUND.match(text)) and spelled(match["unit"]) in UNITS:
        return Heading(match["name"], match["unit"].strip())
    return Heading(text)


def is_clock(ours: str) -> bool:
    """Whether a name of ours means the time: `time` or `time [ms]`."""
    return heading(ours).name == "time"


def clock_of(headings: Sequence[Heading], names: Mapping[str, str], source: str) -> tuple[int, str]:
    """Index of the time column and the unit its heading states; raises InputError where there is none."""
    found = [h.name for h in headings]
    for theirs, ours in names.items():
        if is_clock(ours):
            if theirs not in found:
                raise InputError(f"{source} has no column '{theirs}'; {nearest(theirs, found)}")
            index = found.index(theirs)
            return index, heading(ours).unit or headings[index].unit
    lower = [name.lower() for name in found]
    for clock in CLOCKS:
        if clock in lower:
            return lower.index(clock), headings[lower.index(clock)].unit
        for unit in PER_SECOND:
            if f"{clock}_{unit}" in lower:
                index = lower.index(f"{clock}_{unit}")
                return index, headings[index].unit or unit
    shown = ", ".join(found[:8]) + (", …" if len(found) > 8 else "")
    raise InputError(f"{source}: no time column (time, timestamp, t, time_ms …) among {shown}")


def check_twice(headings: Sequence[Heading], source: str) -> None:
    """Raise InputError for a name that two columns have, or a column without one."""
    names = [h.name for h in headings]
    if "" in names:
        raise InputError(f"{source}: column {names.index('') + 1} has no name")
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise InputError(f"{source}: two columns are called {', '.join(twice)}")
