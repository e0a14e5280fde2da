"""LabVIEW measurement files (.lvm): two heads, units in a line of the second one, the decimal mark stated."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime, timedelta

from records.formats.metadata import START
from records.formats.tables import Heading
from records.formats.text.layout import Layout, Line
from records.formats.text.source import Source
from specs.errors import InputError

END, X = "***End_of_Header***", "X_Value"
REMARK = "Comment"
NO_ZONE = "the start states no time zone: taken as UTC"


def is_lvm(lines: Sequence[Line]) -> bool:
    """Whether a file begins as LabVIEW writes it."""
    return lines[0].text.startswith("LabVIEW Measurement")


def separator(lines: Sequence[str]) -> str:
    """What stands between the cells, as the first head says."""
    return "," if any(x.lower().startswith("separator") and "comma" in x.lower() for x in lines) else "\t"


def stated(lines: Sequence[str], tab: str) -> dict[str, list[str]]:
    """What a head says: {key: its cells}."""
    split = ([c.strip() for c in line.split(tab)] for line in lines)
    return {key: cells for key, *cells in split}


def begins(head: Mapping[str, Sequence[str]]) -> datetime | None:
    """When a table begins, by Date and Time of its head; None where it does not say that in this form."""
    date, time = (next(iter(head.get(key, ())), "") for key in ("Date", "Time"))
    try:
        day = datetime.strptime(date, "%Y/%m/%d").replace(tzinfo=UTC)
        hours, minutes, seconds = time.replace(",", ".").split(":")
        return day + timedelta(hours=int(hours), minutes=int(minutes), seconds=float(seconds))
    except ValueError:
        return None


def has_one_table(lines: Sequence[Line]) -> bool:
    """Whether there is one table with one column of times, which count from the file's start."""
    texts = [line.text for line in lines]
    ends = [i for i, text in enumerate(texts) if text.startswith(END)]
    if len(ends) != 2 or ends[-1] + 1 >= len(lines):
        return False
    tab = separator(texts)
    head = stated(texts[: ends[0]], tab)
    plain = {"Multi_Headings": ("No",), "X_Columns": ("One",), "Time_Pref": ("Relative",)}
    names = [c.strip() for c in texts[ends[-1] + 1].split(tab)]
    return names.count(X) == 1 and all(head.get(key, [valid[0]])[0] in valid for key, valid in plain.items())


def lvm_layout(lines: Sequence[Line], source: Source) -> Layout:
    """The table behind the second head (`has_one_table`)."""
    texts = [line.text for line in lines]
    tab = separator(texts)
    end = max(i for i, text in enumerate(texts) if text.startswith(END))
    said = stated(texts[:end], tab)
    header = lines[end + 1]
    names = [c.strip() for c in header.text.split(tab)]
    remark = names.pop() if names[-1] == REMARK else ""
    units = iter(said.get("Y_Unit_Label", []))
    headings = [Heading(n, "s") if n == X else Heading(n, next(units, "")) for n in names]
    if end + 2 >= len(lines):
        raise InputError(f"{source.path}: no rows behind the heads of a LabVIEW measurement")
    found = Layout(headings, tab, header.number + 1, header.number, width=len(headings), remark=remark)
    found.meta["lvm decimal"] = said.get("Decimal_Separator", ["."])[0]
    if start := begins(said):
        found.meta[START] = start.isoformat()
        found.notes.append(NO_ZONE)
    return found
