"""LabVIEW measurement files (.lvm): two heads, units in a line of the second one, the decimal mark stated."""

from collections.abc import Sequence

from records.formats.tables import Heading
from records.formats.text.layout import Layout, Line
from records.formats.text.source import Source
from specs.errors import InputError

END = "***End_of_Header***"


def is_lvm(lines: Sequence[Line]) -> bool:
    """Whether a file begins as LabVIEW writes it."""
    return lines[0].text.startswith("LabVIEW Measurement")


def lvm_layout(lines: Sequence[Line], source: Source) -> Layout:
    """The table behind the last head; raises InputError where there is more than one."""
    tab = (
        ","
        if any(x.text.lower().startswith("separator") and "comma" in x.text.lower() for x in lines)
        else "\t"
    )
    ends = [i for i, line in enumerate(lines) if line.text.startswith(END)]
    if len(ends) < 2 or ends[-1] + 2 >= len(lines):
        raise InputError(f"{source.path}: no table behind the heads of a LabVIEW measurement")
    stated = {}
    for line in lines[: ends[-1]]:
        key, *cells = [c.strip() for c in line.text.split(tab)]
        stated[key] = cells
    header = lines[ends[-1] + 1]
    names = [c.strip() for c in header.text.split(tab)]
    if names[-1] == "Comment":
        names.pop()
    if stated.get("Multi_Headings", ["No"])[0] == "Yes" or names.count("X_Value") != 1:
        raise InputError(
            f"{source.path}: line {header.number}: several clocks in one LabVIEW file are not read"
        )
    units = iter(stated.get("Y_Unit_Label", []))
    headings = [Heading(n, "s") if n == "X_Value" else Heading(n, next(units, "")) for n in names]
    meta = {"lvm decimal": stated.get("Decimal_Separator", ["."])[0]}
    return Layout(headings, tab, header.number + 1, header.number, meta=meta, width=len(headings))
