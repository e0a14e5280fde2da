"""Reads a text file: decide, then fill the columns block by block, then check the count of rows."""

import json
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv

from records.formats.csv_write import META
from records.formats.long_form import check_long_form
from records.formats.metadata import start_of
from records.formats.raw import Group, Raw, RawColumn
from records.formats.tables import Heading, check_twice, is_clock
from records.formats.text.clock import Clock
from records.formats.text.clock_column import Timed, clock_columns
from records.formats.text.clocks import called, cells_of_clock, clock_of, on_one_scale, without_empty_rows
from records.formats.text.columns import Column
from records.formats.text.head import head_of
from records.formats.text.layout import BLANKS, Line, cells_of, layout_of
from records.formats.text.lvm import has_one_table, is_lvm, lvm_layout
from records.formats.text.lvm_segments import read_segments
from records.formats.text.marks import decide
from records.formats.text.options import TextOptions
from records.formats.text.rows import Block, Rows
from records.formats.text.source import Source, opened
from records.formats.text.whole import keep_whole_numbers
from records.formats.text.words import is_number, is_value
from records.formats.units import of_time, spelled
from records.recording import first_line
from specs.errors import InputError


class TextTable:
    """A text file under the decisions made about it."""

    def __init__(
        self,
        source: Source,
        head: list[Line],
        names: Mapping[str, str],
        options: TextOptions,
        notes: list[str],
    ) -> None:
        """Make the decisions; raises InputError where one cannot be made."""
        path = source.path
        self.path, self.options, self.notes = path, options, notes
        self.source, self.head = source, head
        clocks = [c for c in (options.clock, *(t for t, o in names.items() if is_clock(o))) if c]
        clocks += [c.rsplit(" [", 1)[0] for c in clocks]
        self.layout = (
            lvm_layout(self.head, self.source)
            if is_lvm(self.head)
            else layout_of(self.head, clocks, str(path))
        )
        self._trailing()
        self.notes += self.layout.notes
        self.rows = Rows(self.source, self.layout)
        self.names = [str(i) for i in range(self.layout.width)]
        self.timed = self._clocks(names)
        self.clocks = [i for t in self.timed for i in t.at]
        one = len(self.timed) == 1  # several may be called alike
        heads = enumerate(self.layout.headings)
        check_twice(
            [h for i, h in heads if (one and i in self.clocks) or (h.name and i not in self.clocks)],
            str(path),
        )
        stated = self.layout.meta.pop("lvm decimal", None)  # where LabVIEW groups no digits
        decimal, thousands = options.decimal or stated, options.thousands or (stated and "none")
        self.marks = decide(
            self.rows.blocks, self.strings, [h.name for h in self.layout.headings], self.rows.delimiter,
            decimal, thousands, str(path), options.missing,
        )  # fmt: skip

    def _trailing(self) -> None:
        """Rows that end with a delimiter the header lacks, or the other way round."""
        layout = self.layout
        rows = [
            cells_of(x.text, layout.delimiter)
            for x in self.head
            if x.number >= layout.first and x.text.strip()
        ][:20]
        if not rows:
            return
        if layout.remark:
            if 2 * sum(len(r) > layout.width for r in rows) > len(rows):
                layout.headings.append(Heading(layout.remark))
            layout.width = len(layout.headings)
            return
        widths = {len(r) for r in rows}
        if widths == {layout.width + 1} and all(not r[-1] for r in rows):
            layout.headings.append(Heading(""))
        elif widths == {layout.width - 1} and not layout.headings[-1].name:
            layout.headings.pop()
        layout.width = len(layout.headings)

    def _clocks(self, names: Mapping[str, str]) -> list[Timed]:
        """The columns that are clocks, and what each of them times."""
        first, delimiter = self.layout.first, self.layout.delimiter
        sample = [cells_of(x.text, delimiter) for x in self.head if x.number >= first and x.text.strip()]
        heads, source = self.layout.headings, str(self.path)
        return clock_columns(heads, sample, names, self.options.clock, self._changing, self.notes, source)

    def _changing(self, columns: Sequence[int]) -> set[int]:
        """Those of the columns that hold values which change somewhere in the file, or in its only row."""
        values: dict[int, set[str]] = {i: set() for i in columns}
        rows = 0
        for block in self.rows.blocks():
            rows += len(block.numbers)
            open_ones = [i for i, held in values.items() if len(held) < 2]
            table = self.strings(block.data, open_ones)
            for i in open_ones:
                cells = (c.strip() for c in table.column(str(i)).unique().to_pylist() if c)
                values[i] |= set(islice(filter(is_value, cells), 2))
            if rows > 1 and all(len(held) > 1 for held in values.values()):
                break
        return {i for i, held in values.items() if len(held) > 1 or (held and rows == 1)}

    def strings(self, data: bytes, columns: Sequence[int] = ()) -> pa.Table:
        """The cells as text, of all columns or of some; raises InputError for a row of another width."""
        try:
            return self._strings(data, columns)
        except pa.ArrowException as error:
            self.rows.refuse()
            raise InputError(f"{self.path}: {first_line(error)}") from None

    def _strings(self, data: bytes, columns: Sequence[int] = ()) -> pa.Table:
        names = [str(i) for i in columns]
        return self._parsed(data, csv.ConvertOptions(
            column_types=dict.fromkeys(names or self.names, pa.string()), include_columns=names,
            null_values=[""], strings_can_be_null=True,
        ))  # fmt: skip

    def _parsed(self, data: bytes, options: csv.ConvertOptions) -> pa.Table:
        return csv.read_csv(
            pa.BufferReader(data),
            csv.ReadOptions(column_names=self.names, use_threads=False, block_size=max(len(data), 1) + 1),
            csv.ParseOptions(delimiter=self.rows.delimiter, newlines_in_values=False),
            options,
        )

    def read(self) -> Raw:
        """The table; raises InputError with the place of what cannot be read."""
        heads = self.layout.headings
        rows = max(self.source.lines - self.layout.first + 1, 0)
        clocks = [clock_of(t, heads, self.marks, str(self.path), rows) for t in self.timed]
        columns = {i: Column(h, np.empty(rows)) for i, h in enumerate(heads) if i not in self.clocks}
        at, numbers = 0, []
        for block in self.rows.blocks():
            table = self._typed(block, columns)
            if table.num_rows != len(block.numbers):
                raise InputError(
                    f"{self.path}: {len(block.numbers)} lines from line {block.numbers[0]} on hold "
                    f"{table.num_rows} rows; "
                    "a quote is open, or a cell holds the end of a line"
                )
            for timed, clock in zip(self.timed, clocks, strict=True):
                clock.add(cells_of_clock(table, timed), block.numbers)
            for i, column in columns.items():
                column.put(at, table.column(i), block.numbers, self.marks, frozenset(self.options.missing))
            at += table.num_rows
            numbers.append(block.numbers)
        self._count(at)
        keep_whole_numbers(self.rows.blocks, self.strings, columns, self.marks, at)
        pa.default_memory_pool().release_unused()  # what the blocks needed
        return self._raw(clocks, columns, at, numbers)

    def _typed(self, block: Block, columns: Mapping[int, Column]) -> pa.Table:
        """Numbers where a column had only such, else text."""
        plain = not self.marks.thousands and not any(map(is_number, self.options.missing))
        kinds = {
            n: pa.float64() if plain and i in columns and not columns[i].text else pa.string()
            for i, n in enumerate(self.names)
        }
        options = csv.ConvertOptions(
            column_types=kinds, null_values=[""], strings_can_be_null=True, decimal_point=self.marks.decimal
        )
        try:
            return self._parsed(block.data, options)
        except pa.ArrowException:
            pass
        try:
            return self._strings(block.data)
        except pa.ArrowException as error:
            last = block.numbers[-1]
            raise InputError(
                f"{self.path}: lines {block.numbers[0]} to {last}: {first_line(error)}"
            ) from None

    def _count(self, rows: int) -> None:
        """Compare the lines of the file, counted by themselves, with the rows that came of them."""
        left = self.rows.left
        expected = self.source.lines - self.layout.first + 1 - left.lines
        if rows != expected:
            raise InputError(
                f"{self.path}: {expected} lines of rows came out as {rows} rows; it is damaged, or quotes "
                f"are open"
            )
        if not rows:
            raise InputError(f"{self.path}: no rows after the header")
        if left.cut:
            self.notes.append(f"dropped line {left.cut}: it was not written to its end")
        if left.remarks:
            self.notes.append(f"left out {left.remarks} remarks at the ends of rows")
        if left.comments:
            self.notes.append(
                f"left out {left.comments} comment lines among the rows; the first: line {left.first_comment}"
            )

    def _raw(
        self,
        clocks: Sequence[Clock],
        columns: Mapping[int, Column],
        rows: int,
        numbers: Sequence[Sequence[int]],
    ) -> Raw:
        times = on_one_scale(clocks, self.notes, str(self.path))
        made = {i: c for i, column in columns.items() if (c := self._column(i, column, rows)) is not None}
        texts = [(c.head.name, list(c.words)) for c in columns.values() if c.words]
        check_long_form(texts, [c.name for c in made.values()], str(self.path))
        meta = _meta(self.layout.meta)
        place = numbers[0] if len(numbers) == 1 else _joined(numbers)
        groups = [
            Group("", time, [made[i] for i in timed.columns if i in made], "line", place, ahead)  # type: ignore[arg-type]
            for timed, (time, _, ahead) in zip(self.timed, times, strict=True)
        ]
        if len(groups) > 1:
            groups = [without_empty_rows(g) for g in groups]
        _, start, offset = times[0]  # alike for all
        unit = spelled(clocks[0].unit) if of_time(clocks[0].unit) else "s"
        return Raw(groups, start or start_of(meta), meta, self.notes, offset, self._said(), unit)

    def _column(self, i: int, column: Column, rows: int) -> RawColumn | None:
        """A column's samples; None where it has none, or only counts the rows."""
        if column.head.name:
            return column.result(rows, str(self.path), self.notes)
        if not self._may_lack_a_name(column, rows):
            raise InputError(f"{self.path}: column {i + 1} has no name")
        return None

    def _may_lack_a_name(self, column: Column, rows: int) -> bool:
        """Whether a column without a name is empty, or counts the rows."""
        if column.is_empty:
            return True
        counts = (
            rows > 1 and not column.words and np.array_equal(np.diff(column.values[:rows]), np.ones(rows - 1))
        )
        if counts:
            self.notes.append("a column without a name counts the rows: left out")
        return bool(counts)

    def _said(self) -> tuple[str, ...]:
        """What was decided about the file."""
        mark = {"\t": "tabs", BLANKS: "blanks"}.get(self.layout.delimiter, f"'{self.layout.delimiter}'")
        clock = ", ".join(called(t, self.layout.headings) for t in self.timed)
        groups = f", '{self.marks.thousands}' groups digits" if self.marks.thousands else ""
        return (
            f"{self.source.encoding}, cells between {mark}, decimal mark '{self.marks.decimal}'{groups}, "
            f"header in line "
            f"{self.layout.header}, rows from line {self.layout.first} on, time in column {clock}",
        )


def read_text(path: Path, names: Mapping[str, str], options: TextOptions) -> Raw:
    """Read a text file; raises InputError naming the line that cannot be read."""
    notes: list[str] = []
    source = opened(path, options.encoding, notes)
    head = head_of(source, options.skip)
    if is_lvm(head) and not has_one_table(head):
        return read_segments(source, options, notes)
    return TextTable(source, head, names, options, notes).read()


def _joined(numbers: Sequence[Sequence[int]]) -> Any:
    """Line numbers of all rows; a range where they are one."""
    if all(isinstance(n, range) for n in numbers) and numbers:
        whole = range(numbers[0][0], numbers[-1][-1] + 1)
        if len(whole) == sum(len(n) for n in numbers):
            return whole
    return (
        np.concatenate([np.asarray(n, dtype=np.int64) for n in numbers])
        if numbers
        else np.empty(0, dtype=np.int64)
    )


def _meta(comments: Mapping[str, Any]) -> dict[str, Any]:
    """What comment lines say; our own is JSON."""
    found = dict(comments)
    if META in found:
        try:
            found |= json.loads(found.pop(META))
        except ValueError:
            found[META] = comments[META]
    return found
