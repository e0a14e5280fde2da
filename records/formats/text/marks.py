"""Which mark stands before the decimals and which groups digits: one meaning a mark in the whole file.

A mark is sure to be decimal where what follows is no group of three digits, or what stands before it is 0 or
nothing.  Both marks in numbers of one file are refused, since a number may then be a thousand times another;
so are numbers of which nothing shows what their mark means.  `--decimal` and `--thousands` say it.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import pyarrow as pa
import pyarrow.compute as pc

from records.formats.text.rows import Block
from records.formats.text.words import FLAGS, GROUPERS, MINUS, MISSING, NOT_A_NUMBER, NUMERIC, is_number
from specs.errors import InputError

EXP = r"([eEdD][+-]?\d+)?\s*$"
SIGN = rf"^\s*[+\-{MINUS}]?"
KNOWN = {*MISSING, *NOT_A_NUMBER, *FLAGS}
NUMERIC_RE2 = NUMERIC.pattern
GROUP_CELL = rf"{SIGN}[1-9]\d{{0,2}}[.,]\d{{3}}\s*$"
SMALL_CELL = rf"{SIGN}\d{{1,3}}\s*$"
OTHER = {".": ",", ",": "."}
# Every number in which a mark stands: alone, between groups, before or behind the other one.
ANY = {
    m: rf"{SIGN}(\d+[{m}]\d*|[{m}]\d+|\d{{1,3}}([{m}]\d{{3}})+([{o}]\d*)?"
    rf"|\d{{1,3}}([{o}{GROUPERS}]\d{{3}})+[{m}]\d*){EXP}"
    for m, o in OTHER.items()
}
# Those in which it must be decimal.
SURE = {
    m: rf"{SIGN}(\d*[{m}](\d{{0,2}}|\d{{4,}})|(0\d*)?[{m}]\d+|\d{{4,}}[{m}]\d+"
    rf"|\d{{1,3}}([{o}{GROUPERS}]\d{{3}})+[{m}]\d*){EXP}|{SIGN}\d+[{m}]\d*[eEdD][+-]?\d+\s*$"
    for m, o in OTHER.items()
}


@dataclass(frozen=True)
class Marks:
    """The decimal mark and the marks that group digits ("" for none)."""

    decimal: str
    thousands: str = ""

    def plain(self, cell: str) -> str | None:
        """A number's text as Python writes it; None for what is no number under these marks."""
        text = cell.strip().replace(MINUS, "-").replace("D", "e").replace("d", "e")
        if self.thousands:
            match = self.grouped.match(text)
            if match:
                text = text.replace(self.thousands, "")
        return text.replace(",", ".") if self.pattern.match(text) else None

    @property
    def grouped(self) -> re.Pattern[str]:
        t, d = re.escape(self.thousands), re.escape(self.decimal)
        return re.compile(rf"^[+-]?[1-9]\d{{0,2}}({t}\d{{3}})+({d}\d*)?([eE][+-]?\d+)?$")

    @property
    def pattern(self) -> re.Pattern[str]:
        d = re.escape(self.decimal)
        return re.compile(rf"^[+-]?(\d+({d}\d*)?|{d}\d+)([eE][+-]?\d+)?$")


@dataclass
class Seen:
    """A cell that shows something: where it stands and what is written there."""

    line: int
    column: str
    cell: str

    def __str__(self) -> str:
        return f"line {self.line}, column {self.column}: '{self.cell}'"


@dataclass
class Evidence:
    """The first number with each mark, and the first in which it must be decimal."""

    any: dict[str, Seen]
    sure: dict[str, Seen]
    mixed: Seen | None = None  # groups of three in a column whose other numbers have no mark


def decide(
    blocks: Callable[[], Iterator[Block]],
    strings: Callable[..., pa.Table],
    names: Sequence[str],
    delimiter: str,
    decimal: str | None,
    thousands: str | None,
    source: str,
    missing: Sequence[str] = (),
) -> Marks:
    """The marks of a file; `blocks` gives the rows, `strings` their cells as text."""
    if decimal is not None:
        other = "," if decimal == "." else "."
        return Marks(decimal, other if thousands is None else "" if thousands == "none" else thousands)
    if thousands in (".", ","):
        return Marks("," if thousands == "." else ".", thousands)
    seen = _look(blocks(), strings, names, delimiter, KNOWN | {w.lower() for w in missing})
    group = thousands if thousands not in (None, "none") else ""
    if len(seen.any) == 2:
        first, second = sorted(seen.any.values(), key=lambda s: s.line)
        raise InputError(
            f"{source}: numbers with a point and numbers with a comma, {first} and {second}; --decimal . or "
            "--decimal , says which one stands before the decimals (the other then groups digits)"
        )
    mark = next(iter(seen.any), ".")
    if seen.mixed is not None and thousands != "none":
        raise InputError(
            f"{source}: {seen.mixed} may be decimals or a group of thousands, since others of its column "
            f"have no mark; --decimal {mark} or --thousands {mark} says which"
        )
    if seen.any and not seen.sure and thousands != "none":
        raise InputError(
            f"{source}: {seen.any[mark]} may be decimals or a group of thousands; --decimal {mark} or "
            f"--thousands {mark} says which"
        )
    return Marks(mark, group)


def _look(
    blocks: Iterable[Block],
    strings: Callable[..., pa.Table],
    names: Sequence[str],
    delimiter: str,
    known: set[str],
) -> Evidence:
    """The evidence of all blocks; a block that can say nothing new is not looked into."""
    found, open_ones = Evidence({}, {}), {i: Groups() for i in range(len(names))}
    for one in blocks:
        _look_for_groups(strings, one, names, open_ones, known)
        block = one.data
        comma = b"," in block and (delimiter != "," or b'"' in block)
        there = [m for m, is_there in ((".", b"." in block), (",", comma)) if is_there]
        new = [m for m in there if m not in found.any or (m not in found.sure and len(there) == 1)]
        if not new:
            continue
        table = strings(block)
        for i, name in enumerate(names):
            cells = _numbers_only(table.column(i), known)
            for mark in new if cells is not None else ():
                _note(cells, mark, one, name, found)
        if len(found.any) == 2:
            return found
    found.mixed = next((g.first for g in open_ones.values() if g.first is not None and g.small), None)
    return found


@dataclass
class Groups:
    """A column whose numbers are groups of three behind a mark, and whole ones below 1000, and nothing else.

    Fixed decimals would stand in all its cells.
    """

    first: Seen | None = None  # group of three
    small: bool = False


def _look_for_groups(
    strings: Callable[..., pa.Table],
    block: Block,
    names: Sequence[str],
    open_ones: dict[int, Groups],
    known: set[str],
) -> None:
    """Look into the columns that held nothing else so far; others are no longer looked at."""
    table = strings(block.data, list(open_ones)) if open_ones else None
    for i, seen in list(open_ones.items()) if table is not None else ():
        column = table.column(str(i)).unique()  # type: ignore[union-attr]
        groups = pc.match_substring_regex(column, GROUP_CELL)  # type: ignore[attr-defined]
        small = pc.match_substring_regex(column, SMALL_CELL)  # type: ignore[attr-defined]
        rest = column.filter(pc.invert(pc.or_(groups, small))).to_pylist()  # type: ignore[attr-defined]
        if any(c and c.strip().lower() not in known for c in rest):
            del open_ones[i]
            continue
        seen.small = seen.small or bool(pc.any(small).as_py())  # type: ignore[attr-defined]
        if seen.first is None and pc.any(groups).as_py():  # type: ignore[attr-defined]
            cell = column.filter(groups)[0].as_py()
            at = pc.index(table.column(str(i)), cell).as_py()  # type: ignore[attr-defined,union-attr]
            seen.first = Seen(int(block.numbers[at]), names[i], cell)


def _numbers_only(column: pa.ChunkedArray, known: set[str]) -> pa.ChunkedArray | None:
    """The column; None for text: what a word means says nothing about numbers beside it."""
    some = {c.strip() for c in column.slice(0, 50).to_pylist() if c}
    if some and not any(is_number(c) or c.lower() in known for c in some):
        return None  # without a look at all of it
    bare = pc.utf8_trim_whitespace(column)  # type: ignore[attr-defined]
    plain = pc.match_substring_regex(bare, NUMERIC_RE2)  # type: ignore[attr-defined]
    others = set(pc.unique(bare.filter(pc.invert(plain))).to_pylist())  # type: ignore[attr-defined]
    return None if any(c and c.lower() not in known for c in others) else column


def _note(column: pa.ChunkedArray, mark: str, block: Block, name: str, found: Evidence) -> None:
    for patterns, into in ((ANY, found.any), (SURE, found.sure)):
        if mark in into:
            continue
        at = pc.index(pc.match_substring_regex(column, patterns[mark]), True).as_py()  # type: ignore[attr-defined]
        if at < 0:
            return
        into[mark] = Seen(int(block.numbers[at]), name, column[at].as_py())
