"""LabVIEW measurements made at random: one table or several, one clock, several or none."""

import random
from datetime import datetime, timedelta
from pathlib import Path

from tests.records.variants_written import Written

BEGIN = datetime(2026, 3, 29, 23, 59, 58)
END = "***End_of_Header***"


def lvm(r: random.Random, folder: Path) -> Written:
    """A file and what it holds."""
    tab, columns = r.choice(["\t", "\t", ","]), r.choice(["One", "One", "Multi", "No"])
    decimal = "." if tab == "," else r.choice([".", ","])
    names = r.sample(["p", "Druck", "x(t)", "arr[3]", "Untitled 1", "q"], r.randint(1, 3))
    tables = r.choice([1, 1, 2, 4])
    period = r.choice([0.02, 0.5, 1e-4])
    lines = [
        f"LabVIEW Measurement{tab}", f"Separator{tab}{'Comma' if tab == ',' else 'Tab'}",
        f"Decimal_Separator{tab}{decimal}", f"Multi_Headings{tab}{'Yes' if tables > 1 else 'No'}",
        f"X_Columns{tab}{columns}", f"Time_Pref{tab}Relative", *_when(BEGIN, 1, tab, decimal), END + tab, "",
    ]  # fmt: skip
    kept: dict[str, tuple[list[float], list[float]]] = {n: ([], []) for n in names}
    start = 0.0
    for _ in range(tables):
        begin, offset = BEGIN + timedelta(seconds=start), r.choice([0.0, 0.0, 3.5])
        lines += [f"Channels{tab}{len(names)}", *_when(begin, len(names), tab, decimal)]
        lines += [
            tab.join([key, *[_cell(x, decimal)] * len(names)])
            for key, x in (("X0", offset), ("Delta_X", period))
        ]
        lines += [END + tab, tab.join([*_heads(names, columns), "Comment"])]
        count = r.randint(2, 30)
        for k in range(count):
            at, cells = offset + k * period, []
            for i, name in enumerate(names):
                value = r.choice([None] + [round(r.uniform(-1e4, 1e4), r.randint(0, 6))] * 9)
                if columns == "Multi" or (columns == "One" and i == 0):
                    cells.append(_cell(at, decimal))
                elif columns == "No" and i == 0:
                    cells.append("")
                cells.append("" if value is None else _cell(value, decimal))
                if value is not None:
                    kept[name][0].append(start + at)
                    kept[name][1].append(value)
            lines.append(tab.join([*cells, r.choice(["", "", "note"])]))
        start += offset + count * period + r.choice([0.25, 3.0])
    path = folder / "r.lvm"
    path.write_text(r.choice(["\n", "\r\n"]).join([*lines, ""]), newline="")
    first = min((t[0] for t, _ in kept.values() if t), default=0.0)
    return Written(path, kept, {}, (), first, 2e-6, f"{columns} {tables} {decimal!r} {tab!r}")


def _when(begin: datetime, times: int, tab: str, decimal: str) -> list[str]:
    clock = begin.strftime("%H:%M:%S.%f").replace(".", decimal)
    return [tab.join(["Date", *[begin.strftime("%Y/%m/%d")] * times]), tab.join(["Time", *[clock] * times])]


def _heads(names: list[str], columns: str) -> list[str]:
    if columns == "Multi":
        return [x for name in names for x in ("X_Value", name)]
    return ["X_Value", *names]


def _cell(value: float, decimal: str) -> str:
    return f"{value:.6f}".replace(".", decimal)
