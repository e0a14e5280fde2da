"""The page of `slewright plot`: columns of one record over time, or of several over each other."""

import math
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from html import escape
from itertools import cycle, pairwise
from typing import Any

import numpy as np

from records.record import Record
from records.report import shell
from records.report.figures import Figure
from records.report.units import drawable, in_unit, unit_of
from specs.errors import InputError, nearest

COLORS = ("#134a7c", "#d9822b", "#2a8c82", "#7a5195", "#b5403a", "#6b6b6b", "#8a6d1f", "#3d7fb8")
DASHES = ("solid", "dash", "dot", "dashdot")  # one for each record
MOST_POINTS = 4000  # of a line
PANEL_PX = 280

Records = Mapping[str, Record]  # label → record, the first one is what the others are compared with


def chosen(records: Records, wanted: Sequence[str]) -> list[str]:
    """The columns that `wanted` names (patterns with * are allowed), all without any.

    Raises InputError for a name that no record has, and where there is nothing to draw.
    """
    names = list(dict.fromkeys(n for label, record in records.items() for n in drawable(label, record)))
    if not names:
        raise InputError(f"{', '.join(records)}: there is no column of numbers beside the time")
    if not wanted:
        return names
    found: dict[str, None] = {}
    for pattern in wanted:
        fitting = [n for n in names if n == pattern] or [n for n in names if fnmatchcase(n, pattern)]
        if not fitting:
            raise InputError(f"no record has a column '{pattern}'; {nearest(pattern, names)}")
        found |= dict.fromkeys(fitting)
    return list(found)


def differences(records: Records, names: Iterable[str]) -> list[dict[str, Any]]:
    """For each further record and column in both: the largest and the root mean square difference.

    At the first record's times within both; the other record is interpolated between its rows.
    """
    (first, base), *others = records.items()
    return [
        {
            "signal": name,
            "unit": base.units[name],
            "record": label,
            "against": first,
            **_size(*_difference(base, other, name)),
        }
        for label, other in others
        for name in names
        if name in base and name in other
    ]


def _size(at: np.ndarray, difference: np.ndarray) -> dict[str, float]:
    """How large a difference is; without a row that tells it that is not known, and not 0."""
    known = np.isfinite(difference)
    at, size = at[known], np.abs(difference[known])
    if not len(size):
        return {"max": math.nan, "rms": math.nan, "at_s": math.nan, "rows": 0}
    worst = int(np.argmax(size))
    rms = float(np.sqrt(np.mean(size**2)))
    return {"max": float(size[worst]), "rms": rms, "at_s": float(at[worst]), "rows": len(size)}


def render(records: Records, names: Sequence[str], difference: bool) -> str:
    """The page: a panel for each unit; with `difference` another of what the others lie above the first."""
    units: dict[str, list[str]] = {}
    for name in names:
        units.setdefault(unit_of(records, name), []).append(name)
    drawn = [_panel(f"values{i}", u, _values(records, n)) for i, (u, n) in enumerate(units.items())]
    if difference:
        drawn += [
            _panel(f"differences{i}", f"difference in {u}" if u else "difference", _differences(records, n))
            for i, (u, n) in enumerate(units.items())
        ]
    title = ", ".join(records)
    body = [f"<header><h1>{escape(title)}</h1>{shell.facts(_facts(records))}</header>"]
    if difference:
        body.append(_table(differences(records, names)))
    return shell.document(title, [*body, *(shell.place(figure) for figure in drawn)], drawn)


def _facts(records: Records) -> Iterable[tuple[str, str]]:
    for label, record in records.items():
        time = record.time
        span = f"{time[0]:g} … {time[-1]:g} s, {len(time)} rows" if len(time) else "no rows"
        yield label, span if record.complete else f"{span}; incomplete: {record.reason}"


def _table(found: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        [f["signal"], f["record"], f"{f['max']:.4g}", f"{f['rms']:.4g}", f["unit"], f"{f['at_s']:.6g}"]
        for f in found
    ]
    return shell.table(("signal", "record", "largest", "root mean square", "unit", "largest at [s]"), rows)


def _values(records: Records, names: Sequence[str]) -> Iterable[tuple[str, str, str, np.ndarray, np.ndarray]]:
    """(label, colour, dash, times, values) of each line."""
    for (label, record), dash in zip(records.items(), cycle(DASHES), strict=False):
        for name, color in zip(names, cycle(COLORS), strict=False):
            if name in record:
                shown = name if len(records) == 1 else f"{name}, {label}"
                yield shown, color, dash, record.time, in_unit(record, name, unit_of(records, name))


def _differences(
    records: Records, names: Sequence[str]
) -> Iterable[tuple[str, str, str, np.ndarray, np.ndarray]]:
    (_, base), *others = records.items()
    for (label, other), dash in zip(others, cycle(DASHES), strict=False):
        for name, color in zip(names, cycle(COLORS), strict=False):
            if name in base and name in other:
                yield (f"{name}, {label}", color, dash, *_difference(base, other, name))


def _difference(base: Record, other: Record, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Times of `base` that lie within both, and how far `other` lies above it there."""
    time, mine = base.time, base.column(name).astype(float)
    theirs = in_unit(other, name, base.units[name])
    if np.array_equal(time, other.time):
        return time, theirs - mine
    if not len(other.time):
        return time[:0], mine[:0]
    within = (time >= other.time[0]) & (time <= other.time[-1])
    return time[within], np.interp(time[within], other.time, theirs) - mine[within]


def _panel(name: str, unit: str, lines: Iterable[tuple[str, str, str, np.ndarray, np.ndarray]]) -> Figure:
    data = []
    for label, color, dash, time, values in lines:
        rows = _shown_rows(values)
        data.append(
            {
                "type": "scatter",
                "mode": "lines+markers" if _alone(values[rows]) else "lines",
                "name": label,
                "x": _numbers(time[rows]),
                "y": _numbers(values[rows]),
                "line": {"color": color, "width": 1.5, "dash": dash},
            }
        )
    layout = {
        "xaxis": {"title": {"text": "Time [s]"}},
        "yaxis": {"title": {"text": f"[{unit}]" if unit else ""}},
        "hovermode": "x unified",
        "showlegend": True,
    }
    shown = ", ".join(dict.fromkeys(line["name"].partition(", ")[0] for line in data))
    return Figure(
        name, unit or "without unit", shown, data, layout, PANEL_PX + 18 * (len(data) // 4), wide=True
    )


def _shown_rows(values: np.ndarray) -> np.ndarray:
    """All rows, or of a long record the lowest and the highest of each stretch: no peak is lost."""
    if len(values) <= MOST_POINTS:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), MOST_POINTS // 2 + 1).astype(int)
    known = np.isfinite(values)
    rows = []
    for first, end in pairwise(edges):
        part, good = values[first:end], known[first:end]
        low, high = np.argmin(np.where(good, part, np.inf)), np.argmax(np.where(good, part, -np.inf))
        gap = np.argmin(good)  # a row without a value, so that the line has its gap; else the first one
        rows += [first + int(k) for k in (low, high, *(() if good[gap] else (gap,)))]
    return np.unique([0, *rows, len(values) - 1])


def _alone(values: np.ndarray) -> bool:
    """Whether a value has none beside it: a line alone would not show it."""
    known = np.concatenate([[False], np.isfinite(values), [False]])
    return bool(np.any(known[1:-1] & ~known[:-2] & ~known[2:]))


def _numbers(values: np.ndarray) -> list[float | None]:
    return [float(f"{v:.8g}") if math.isfinite(v) else None for v in values.tolist()]
