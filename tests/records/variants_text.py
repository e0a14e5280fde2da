"""Tables in text with every combination of marks, encodings, delimiters, quotes, preambles,
units, clocks, words.
"""

import random
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from pathlib import Path

from records.formats.text import TextOptions
from tests.records.variants_written import Written

MISSING = ("", "n/a", "NA", "-", "null", "#N/A", "?", "Bad", "None", "#DIV/0!")
UNITS = (("bar", "bar"), ("deg", "deg"), ("°C", "degC"), ("V", "V"), ("", ""), ("psi", "psi"))
PREAMBLES = (
    "Logger XY",
    "Serial{d}123",
    "Date{d}2026-01-02",
    "",
    "Rate{d}50{d}Hz",
    "# a comment",
    "% matlab",
    "// note",
)
NOTES = ("ok", '2" hose', "a, b", "x;y", "start", "5 bar", "stop\ttab", "7", "1,5")
CLOCKS = (
    "s", "ms", "us", "bare", "epoch_s", "epoch_ms", "epoch_ns", "iso", "iso_z", "iso_comma", "german",
    "slash", "of_day", "excel", "day_and_time", "half", "half_of_day", "day_and_half", "matlab", "julian",
    "labview", "hhmmss", "fourteen", "basic", "month", "zone", "lasting", "day_slash_and_time",
)  # fmt: skip
FORMS = {
    "iso": "%Y-%m-%d %H:%M:%S",
    "iso_z": "%Y-%m-%dT%H:%M:%S",
    "iso_comma": "%Y-%m-%dT%H:%M:%S",
    "german": "%d.%m.%Y %H:%M:%S",
    "slash": "%d/%m/%Y %H:%M:%S",
    "of_day": "%H:%M:%S",
    "hhmmss": "%H%M%S",
    "fourteen": "%Y%m%d%H%M%S",
    "basic": "%Y%m%dT%H%M%S",
    "month": "%d-%b-%Y %H:%M:%S",
    "zone": "%Y-%m-%d %H:%M:%S",
}
DAYS = {"excel": 25_569, "matlab": 719_529, "julian": Decimal("2440587.5")}  # at 1970
EPOCH = {"epoch_s": 1, "epoch_ms": 1000, "epoch_ns": 1_000_000_000}
SINCE = 1_774_000_000  # s since 1970
WITHOUT_DATE = ("s", "ms", "us", "bare", "of_day", "half_of_day", "hhmmss", "lasting")
STATED = {"slash": "time [dd/mm/yyyy]", "day_slash_and_time": "Date [dd/mm/yyyy]", "hhmmss": "time [hhmmss]",
          **{k: f"time [{k}]" for k in DAYS}}  # fmt: skip
HALVES = ("AM", "PM"), ("am", "pm"), ("a.m.", "p.m."), ("A", "P"), ("\u202fAM", "\u202fPM")
WIDE = 2**62
ZERO = datetime(2026, 3, 29, 1, 59, 59, 900_000)


def number(r: random.Random, value: Decimal, decimal: str, group: str, places: int, form: str) -> str:
    """A number in one of the forms in which tools write it."""
    if form == "sci":
        return f"{value:.6E}".replace(".", decimal)
    text = f"{value:.{places}f}"
    sign, text = ("-", text[1:]) if text.startswith("-") else ("", text)
    whole, _, rest = text.partition(".")
    if group:
        whole = f"{int(whole):,}".replace(",", group)
    if form == "minus" and sign:
        sign = "\u2212"
    if form == "plus" and not sign:
        sign = "+"
    if form == "short" and whole == "0" and rest:
        whole = ""
    return sign + whole + (decimal + rest if rest else "")


def number_cells(
    kind: str, times: list[Decimal], decimal: str, group: str
) -> tuple[str, str, list[list[str]]] | None:
    """Name, unit and cells of a clock in numbers; None for one of dates."""
    per = {"s": 1, "ms": 1000, "us": 1_000_000}
    if kind in per:
        places = {"s": 3, "ms": 0, "us": 0}[kind]
        cells = [[number(random.Random(0), t * per[kind], decimal, group, places, "")] for t in times]
        return "time", kind, cells
    if kind in EPOCH:
        places = 3 if kind == "epoch_s" else 0
        shown = [f"{(t + SINCE) * EPOCH[kind]:.{places}f}" for t in times]
        return "timestamp", "", [[c.replace(".", decimal)] for c in shown]
    if kind == "labview":
        return "time", "", [[f"{t + SINCE + 2_082_844_800:.3f}".replace(".", decimal)] for t in times]
    if kind in DAYS:
        return "time", "", [[f"{(t + SINCE) / 86400 + DAYS[kind]:.12f}".replace(".", decimal)] for t in times]
    if kind == "lasting":
        return "time", "", [[f"1 days {26 + t // 3600}:{t // 60 % 60:02.0f}:{t % 60:09.6f}"] for t in times]
    return ("t", "", [[f"{t:.3f}".replace(".", decimal)] for t in times]) if kind == "bare" else None


def clock_cells(
    kind: str, times: list[Decimal], decimal: str, group: str
) -> tuple[str, str, list[list[str]]]:
    """Name, unit and cells (one or two a row) of a clock."""
    noon = timedelta(hours=10) if "half" in kind else timedelta()
    stamps = [ZERO + noon + timedelta(microseconds=int(t * 1_000_000)) for t in times]
    dot = lambda d, form: d.strftime(form) + f".{d.microsecond:06d}"[: 4 if not d.microsecond % 1000 else 7]  # noqa: E731
    if numbers := number_cells(kind, times, decimal, group):
        return numbers
    if "half" in kind:
        forms = random.Random(str(times)).choice(HALVES)
        clocks = [dot(d, "%I:%M:%S").removeprefix("0") + " " + forms[d.hour >= 12] for d in stamps]
        if kind == "day_and_half":
            return "Date", "", [[d.strftime("%Y-%m-%d"), c] for d, c in zip(stamps, clocks, strict=True)]
        days = [d.strftime("%Y-%m-%d ") if kind == "half" else "" for d in stamps]
        return "time", "", [[d + c] for d, c in zip(days, clocks, strict=True)]
    if kind in ("day_and_time", "day_slash_and_time"):
        day = "%d/%m/%Y" if "slash" in kind else "%Y-%m-%d"
        return "Date", "", [[d.strftime(day), dot(d, "%H:%M:%S")] for d in stamps]
    cells = [dot(d, FORMS[kind]) + {"iso_z": "Z", "zone": "+00"}.get(kind, "") for d in stamps]
    if kind in ("hhmmss", "fourteen"):
        return "time", "", [[c.replace(".", decimal)] for c in cells]
    if kind == "german":
        return "time", "", [[c[:10] + c[10:].replace(".", decimal)] for c in cells]
    return "time", "", [[c.replace(".", ",") if kind == "iso_comma" else c] for c in cells]


def quoted(r: random.Random, cell: str, delimiter: str, style: str) -> str:
    """A cell with quotes where the style or its content wants them."""
    needs = delimiter in cell or '"' in cell or "\n" in cell
    if style == "blanks" and delimiter != "\t":  # that no reader may take for a part of the cell
        return ' "' + cell.replace('"', '""') + '"' if needs else " " + cell
    return '"' + cell.replace('"', '""') + '"' if style == "all" or needs else cell


def text(r: random.Random, folder: Path) -> Written:  # noqa: C901 - one table in all its forms
    """A table."""
    decimal = r.choice(".,")
    delimiter = r.choice([",", ";", "\t", "|"])
    group = r.choice(["", "", "", "." if decimal == "," else ",", "\u202f", "'"])
    rows, step = r.randint(1, 30), Decimal(r.choice(["0.02", "0.1", "1", "0.001"]))
    begin = Decimal(r.choice([0, 0, 5]))
    times = [begin + step * k for k in range(rows)]
    if r.random() < 0.2:
        times = [t + Decimal("980") for t in times]
    kind, style = r.choice(CLOCKS), r.choice(["min", "min", "all", "blanks"])
    name, unit, clock = clock_cells(kind, times, decimal, group)
    names, heads, cells, wraps = [], [], [list(c) for c in clock], False
    units_in = r.choice(["head", "head", "row", "none"])
    head_units = [unit] + [""] * (len(clock[0]) - 1)
    heads += [name, "Time"][: len(clock[0])]
    channels: dict[str, tuple[list[float], list[float]]] = {}
    units: dict[str, str] = {}
    for k in range(r.randint(1, 4)):
        own = r.choice(["p", "Druck", "p(A)", "x(t)", "v/m", "arr[3]", "T", "q"]) + str(k) * r.randint(0, 1)
        own = r.choice([own] * 8 + [f"v [{k + 2}]"])
        if own in names:
            continue
        names.append(own)
        spelled, unit_here = r.choice(UNITS)
        units[own] = "" if units_in == "none" else unit_here
        places, size = r.choice([0, 0, 1, 2, 3, 6]), r.choice([1, 10, 1000, 2000, 1_000_000])
        form, missing = r.choice(["", "", "sci", "minus", "plus", "short"]), r.choice(MISSING)
        holes = r.choice([0, 0, 0, 0.2])
        wide = r.choice([0] * 12 + [2**54, WIDE, 2**63 + 5, 2**64 - 1])  # whole numbers that floats round
        kept_t, kept_v = [], []
        for i in range(rows):
            value = Decimal(r.randint(-size, size * 3) if r.random() < 0.7 else r.randint(0, 999)) / (
                10**places if r.random() < 0.6 else 1
            )
            value = round(value, places)
            if r.random() < holes:
                cells[i].append(missing)
                continue
            kept_t.append(float(times[i] - times[0]))
            if wide:
                value = r.randint(0 if wide > WIDE else -wide, wide)
                cells[i].append(number(r, Decimal(value), decimal, group, 0, ""))
                kept_v.append(value)
                continue
            cells[i].append(number(r, value, decimal, group, places, form))
            kept_v.append(float(f"{value:.6E}") if form == "sci" else float(value))
        heads.append(own)
        head_units.append(spelled)
        channels[own] = (kept_t, kept_v)
    if r.random() < 0.05 and kind in ("s", "ms", "us") and units_in != "none" and rows > 1:
        per = {"s": 1, "ms": 1000, "us": 1_000_000}[kind]  # a channel with a clock of its own: to be refused
        heads += [f"{name}.1", "late"]
        head_units += [unit, ""]
        for k, row in enumerate(cells):
            row += [number(r, (times[k] + step / 2 + step * k) * per, decimal, group, 4, ""), str(k)]
        channels["late"] = (
            [float(step / 2 + 2 * step * k) for k in range(rows)],
            [float(k) for k in range(rows)],
        )
    if r.random() < 0.3:
        heads.append("note")
        head_units.append("")
        for row in cells:
            row.append(r.choice(NOTES))
    trailing = r.random() < 0.1
    if r.random() < 0.2:  # the clock is not the first column
        for row in (heads, head_units, *cells):
            row[:] = [*row[len(clock[0]) :], *row[: len(clock[0])]]
    if r.random() < 0.05 and rows > 2:
        cells.reverse()  # newest first
    elif r.random() < 0.05 and rows > 2:  # a clock that wraps, whose rows fit: to be refused
        at = r.randrange(1, rows)
        cells[:] = cells[at:] + cells[:at]
        wraps = at < rows - 1
    if r.random() < 0.1:
        heads.insert(0, "")
        head_units.insert(0, "")
        for i, row in enumerate(cells):
            row.insert(0, str(i))
    lines = []
    for _ in range(r.choice([0, 0, 0, 1, 3])):
        lines.append(r.choice(PREAMBLES).replace("{d}", delimiter))
    if delimiter != "," and r.random() < 0.05:
        lines = [f"sep={delimiter}"]
    end = delimiter if trailing else ""
    shown = [f"{h} [{u}]" if units_in == "head" and u else h for h, u in zip(heads, head_units, strict=True)]
    lines.append(delimiter.join(quoted(r, c, delimiter, style) for c in shown) + end)
    if units_in == "row":
        lines.append(delimiter.join(quoted(r, c, delimiter, style) for c in head_units) + end)
    elif units_in == "none" and kind in ("ms", "us"):
        unit = "unstated"
    for row in cells:
        lines.append(delimiter.join(quoted(r, c, delimiter, style) for c in row) + end)
        if r.random() < 0.01:
            lines.append(r.choice(["", "# event"]))
    newline = r.choice(["\n", "\n", "\r\n", "\r"])
    body = newline.join([*lines, ""])
    encoding = r.choice(["utf-8", "utf-8", "utf-8-sig", "cp1252", "utf-16"])
    try:
        data = body.encode(encoding)
    except UnicodeEncodeError:
        encoding, data = "utf-8", body.encode()
    if r.random() < 0.02:  # one byte is damaged
        at = r.randrange(len(data))
        hit = data[at : at + 1]
        if hit.isalpha() and encoding == "utf-8" and not data.isascii():
            data = data[:at] + b"\xfc" + data[at + 1 :]
    path = folder / f"r{r.choice(['.csv', '.txt', '.tsv'])}"
    path.write_bytes(data)
    options, stated = {}, {}
    if r.random() < 0.5 or unit == "unstated":
        if group in (".", ","):
            stated |= {"decimal": decimal, "thousands": group}
        elif r.random() < 0.5:
            stated |= {"decimal": decimal, "thousands": group or "none"}
        if unit == "unstated":
            stated["clock"] = f"{name} [{kind}]"
        if kind in STATED:
            stated["clock"] = STATED[kind]
        if r.random() < 0.3:
            stated["encoding"] = encoding
    if stated:
        options["text"] = TextOptions(**stated)
    starts = [t[0] for t, v in channels.values() if v]
    resolution = {"excel": 2e-6, "matlab": 2e-5, "julian": 1e-4}.get(kind, 2e-9)
    first = min(starts) if starts else 0.0
    begins = None if kind in WITHOUT_DATE else float(times[0]) + first + (
        SINCE if kind in DAYS or kind in EPOCH or kind == "labview" else ZERO.replace(tzinfo=UTC).timestamp()
    )  # fmt: skip
    if begins and "half" in kind:
        begins += 36_000.0
    if wraps:  # no time is right
        channels = {name: ([t - 1e9 for t in held], values) for name, (held, values) in channels.items()}
    how = f"{kind} {decimal!r} {group!r} {delimiter!r} {style} {encoding} {stated}: {body[:300]!r}"
    return Written(path, channels, options, ("Time", "note"), first, resolution, how, units, begins)
