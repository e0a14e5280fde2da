"""LabVIEW measurement files of several tables or clocks: each table has a head of its own.

`X_Columns` says whether a table has one column of times, one before each channel, or none: then `X0` and
`Delta_X` give them.  Times count from `Date` and `Time` of the table's own head, or from 1904 where
`Time_Pref` is Absolute (National Instruments, LabVIEW Measurement File specification).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np

from records.formats.raw import Group, Raw, RawColumn
from records.formats.text.lvm import END, NO_ZONE, REMARK, X, begins, separator, stated
from records.formats.text.options import TextOptions
from records.formats.text.source import Source
from specs.errors import InputError

EPOCH = datetime(1904, 1, 1, tzinfo=UTC)  # LabVIEW's
NOT_HERE = ("--clock", "--skip", "--thousands")  # such a file states them itself


@dataclass(frozen=True)
class Segment:
    """A table: what its head states, the names of its columns, its rows of cells and their lines."""

    head: Mapping[str, list[str]]
    names: Sequence[str]
    rows: Sequence[list[str]]
    lines: Sequence[int]


@dataclass(frozen=True)
class Piece:
    """A channel in one segment: times [n] in s from the segment's start, values [n] and their lines."""

    name: str
    unit: str
    time: np.ndarray
    values: np.ndarray
    lines: Sequence[int]


def read_segments(source: Source, options: TextOptions, notes: Sequence[str]) -> Raw:
    """All tables of a file, each channel once; raises InputError naming the line that cannot be read."""
    if wrong := [o for o in options.stated if o in NOT_HERE]:
        raise InputError(f"{source.path}: {', '.join(wrong)}: this LabVIEW file states its tables itself")
    lines = [
        (n, x) for n, x in enumerate(_lines(source), 1) if x
    ]  # separators alone are a row without values
    tab = separator([x for _, x in lines[:40]])
    cut = next((i for i, (_, x) in enumerate(lines) if x.startswith(END)), len(lines)) + 1
    whole = stated([x for _, x in lines[:cut]], tab)
    found = list(_segments(lines[cut:], tab, source))
    absolute = whole.get("Time_Pref", [""])[0] == "Absolute"
    starts = [EPOCH if absolute else _start({**whole, **s.head}, source, s) for s in found]
    decimal = options.decimal or whole.get("Decimal_Separator", ["."])[0]
    reader = _Reader(source, decimal, whole.get("X_Columns", ["One"])[0], frozenset(options.missing))
    pieces = [(start, p) for start, s in zip(starts, found, strict=True) for p in reader.pieces(s)]
    first = min((p.time.min() for _, p in pieces if len(p.time)), default=0.0) if absolute else 0.0
    begin = EPOCH + timedelta(seconds=float(first)) if absolute else starts[0]
    groups = [_joined(name, own, begin) for name, own in _by_name(pieces).items()]
    said = (
        f"{source.encoding}, LabVIEW's tables: {len(found)}, decimal mark '{decimal}', times from "
        + ("1904" if absolute else "each table's Date and Time"),
    )
    zone = () if absolute else (NO_ZONE,)
    return Raw(groups, begin, notes=[*notes, *zone], reading=said)


def _lines(source: Source) -> Iterator[str]:
    for block in source.blocks():
        yield from block.decode().split("\n")[:-1]


def _segments(lines: Sequence[tuple[int, str]], tab: str, source: Source) -> Iterator[Segment]:
    """Each head with the rows below it."""
    ends = [i for i, (_, text) in enumerate(lines) if text.startswith(END)]
    if not ends:
        raise InputError(f"{source.path}: no table behind the head of a LabVIEW measurement")
    begins = [next(i for i in range(e, -1, -1) if i == 0 or lines[i][1].startswith("Channels")) for e in ends]
    for begin, end, after in zip(begins, ends, [*begins[1:], len(lines)], strict=True):
        if end + 1 >= after:
            raise InputError(f"{source.path}: line {lines[end][0]}: a head without a table")
        names = [c.strip() for c in lines[end + 1][1].split(tab)]
        for name in {n for n in names if n not in (X, "") and names.count(n) > 1}:
            raise InputError(f"{source.path}: line {lines[end + 1][0]}: two columns are called {name}")
        rows = lines[end + 2 : after]
        yield Segment(
            stated([x for _, x in lines[begin:end]], tab), names, [x.split(tab) for _, x in rows],
            [n for n, _ in rows],
        )  # fmt: skip


class _Reader:
    """Cells as numbers, and which column has whose times."""

    def __init__(self, source: Source, decimal: str, x_columns: str, missing: frozenset[str]) -> None:
        self.source, self.decimal, self.x_columns, self.missing = source, decimal, x_columns, missing

    def pieces(self, of: Segment) -> Iterator[Piece]:
        """The channels of a segment."""
        units = iter(of.head.get("Y_Unit_Label", ()))
        step, first = (iter(of.head.get(key, ())) for key in ("Delta_X", "X0"))
        clock = None
        for at, name in enumerate(of.names):
            if name == X:
                clock = at
            elif name and name != REMARK:
                delta, zero = (self._stated(next(found, ""), of) for found in (step, first))
                if clock is None and self.x_columns != "No":
                    raise InputError(
                        f"{self.source.path}: the table from line {of.lines[0] if of.lines else 0} on has no "
                        f"column {X} before {name}, X_Columns is {self.x_columns or 'not stated'}"
                    )
                time = None if clock is None or self.x_columns == "No" else self._column(of, clock)
                yield self._piece(of, at, next(units, ""), time, (zero, delta))

    def _piece(
        self, of: Segment, at: int, unit: str, time: np.ndarray | None, even: tuple[float, float]
    ) -> Piece:
        values = self._column(of, at)
        if time is None:
            time = even[0] + even[1] * np.arange(len(values))
        there = ~np.isnan(values)
        if np.isnan(time[there]).any():
            line = of.lines[int(np.flatnonzero(there & np.isnan(time))[0])]
            raise InputError(f"{self.source.path}: line {line}: {of.names[at]} has a value without a time")
        return Piece(of.names[at], unit, time[there], values[there], np.asarray(of.lines)[there].tolist())

    def _column(self, of: Segment, at: int) -> np.ndarray:
        """A column as numbers, NaN where it has none."""
        return np.array(
            [self._number(r[at] if at < len(r) else "", of, k, at) for k, r in enumerate(of.rows)]
        )

    def _number(self, cell: str, of: Segment, row: int, at: int) -> float:
        bare = cell.strip()
        if not bare or bare in self.missing:
            return np.nan
        other = "," if self.decimal == "." else "."
        try:
            if other in bare or "_" in bare:
                raise ValueError
            return float(bare.replace(self.decimal, "."))
        except ValueError:
            column = of.names[at] or at + 1
            raise InputError(
                f"{self.source.path}: line {of.lines[row]}, column {column}: '{bare}' is no number with "
                f"'{self.decimal}' before its decimals; --decimal or --missing '{bare}' says what it is"
            ) from None

    def _stated(self, cell: str, of: Segment) -> float:
        try:
            return float(cell.replace(self.decimal, ".")) if cell else 0.0
        except ValueError:
            line = of.lines[0] if of.lines else 0
            raise InputError(
                f"{self.source.path}: the head before line {line} states '{cell}', no number with "
                f"'{self.decimal}' before its decimals"
            ) from None


def _start(head: Mapping[str, list[str]], source: Source, of: Segment) -> datetime:
    """When a table begins, by its head."""
    found = begins(head)
    if found is None:
        line = of.lines[0] if of.lines else 0
        raise InputError(
            f"{source.path}: the head before line {line} states no Date and Time that can be read"
        )
    return found


def _by_name(pieces: Sequence[tuple[datetime, Piece]]) -> dict[str, list[tuple[datetime, Piece]]]:
    found: dict[str, list[tuple[datetime, Piece]]] = {}
    for start, piece in pieces:
        found.setdefault(piece.name, []).append((start, piece))
    return found


def _joined(name: str, own: Sequence[tuple[datetime, Piece]], begin: datetime) -> Group:
    """A channel's pieces, one after the other, on one clock."""
    time = [p.time + (start - begin).total_seconds() for start, p in own]
    units = {p.unit for _, p in own}
    if len(units) > 1:
        raise InputError(f"{name} is in {' and in '.join(sorted(units))} in tables of one LabVIEW file")
    column = RawColumn(name, units.pop(), np.concatenate([p.values for _, p in own]))
    lines = np.concatenate([np.asarray(p.lines, dtype=np.int64) for _, p in own])
    return Group("", np.concatenate(time), [column], "line", lines)
