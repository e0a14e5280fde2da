"""The columns of a table as numbers, filled block by block; each cell that is no number is
looked at by itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from records.formats.exact import EXACT, ROUNDED
from records.formats.raw import RawColumn
from records.formats.tables import Heading
from records.formats.text.marks import Marks
from records.formats.text.words import FLAGS, GROUPERS, MINUS, MISSING, NOT_A_NUMBER, is_date, is_number
from specs.errors import InputError


def array(column: pa.Array | pa.ChunkedArray) -> np.ndarray:
    """A column without nulls as numpy."""
    return np.asarray(
        column.to_numpy(zero_copy_only=False) if isinstance(column, pa.Array) else column.to_numpy()
    )


@dataclass
class Word:
    """A word in a column that is no number: how often, and the line of the first."""

    count: int
    line: int


@dataclass
class Column:
    """One column: values [rows] as they come, where they are absent, and the words that are no numbers."""

    head: Heading
    values: np.ndarray
    absent: np.ndarray | None = None
    words: dict[str, Word] = field(default_factory=dict)
    missing: dict[str, Word] = field(default_factory=dict)
    flags: dict[str, Word] = field(default_factory=dict)
    numbers: int = 0
    text: bool = False  # cells that are no numbers came: read as text from then on
    grouped: str = ""
    wide: bool = False
    whole: np.ndarray | None = None  # the values as exact whole numbers, 0 where there is none

    def put(
        self, at: int, cells: pa.ChunkedArray, numbers: Sequence[int], marks: Marks, missing: frozenset[str]
    ) -> None:
        """Fill rows from `at` on."""
        if cells.type == pa.float64():
            held = array(cells.fill_null(float("nan")))
            self._set(at, held, array(cells.is_null()) if cells.null_count else None)
            self.numbers += len(cells) - cells.null_count
            return
        self._put_text(at, cells, numbers, marks, missing)

    def _set(self, at: int, held: np.ndarray, absent: np.ndarray | None) -> None:
        self.values[at : at + len(held)] = held
        if absent is not None:
            if self.absent is None:
                self.absent = np.zeros(len(self.values), dtype=bool)
            self.absent[at : at + len(held)] = absent
        self.wide = self.wide or bool((np.isfinite(held) & (np.abs(held) >= EXACT)).any())

    def _put_text(
        self, at: int, cells: pa.ChunkedArray, numbers: Sequence[int], marks: Marks, missing: frozenset[str]
    ) -> None:
        """Each different cell once: a number, a flag, nothing, or a word."""
        coded = pc.dictionary_encode(cells.combine_chunks())  # type: ignore[attr-defined]
        index = np.asarray(array(coded.indices.fill_null(-1)), dtype=np.int64)
        distinct = coded.dictionary.to_pylist()
        held, absent = np.full(len(distinct) + 1, np.nan), np.zeros(len(distinct) + 1, dtype=bool)
        absent[-1] = True  # an empty cell: index -1
        first = np.full(len(distinct), -1)
        first[index[::-1][index[::-1] >= 0]] = np.arange(len(index) - 1, -1, -1)[index[::-1] >= 0]
        counts = np.bincount(index[index >= 0], minlength=len(distinct))
        for i, cell in enumerate(distinct):
            word = Word(int(counts[i]), int(numbers[int(first[i])]))
            held[i], absent[i] = self._value(cell.strip(), word, marks, missing)
        self._set(at, held[index], absent[index])
        self.numbers += int(np.isfinite(held[index]).sum())
        self.text = True

    def _value(self, cell: str, word: Word, marks: Marks, missing: frozenset[str]) -> tuple[float, bool]:
        """The value of a cell and whether it is absent; what it is is noted."""
        low = cell.lower()
        if not cell:
            return np.nan, True
        if cell in missing or low in MISSING:
            _count(self.missing, cell, word)
            return np.nan, True
        if low in FLAGS:
            _count(self.flags, cell, word)
            return FLAGS[low], False
        if low in NOT_A_NUMBER:
            return np.nan, False
        text = self.plain(cell, marks)
        if text is None:
            _count(self.words, cell, word)
            return np.nan, True
        value = float(text)
        if any(is_number(w) and (t := marks.plain(w)) is not None and float(t) == value for w in missing):
            _count(self.missing, cell, word)
            return np.nan, True
        return value, False

    def plain(self, cell: str, marks: Marks) -> str | None:
        """A number's text as Python writes it; None for what is none."""
        return marks.plain(cell) or self._grouped(cell, marks)

    def _grouped(self, cell: str, marks: Marks) -> str | None:
        """A number whose digits a mark groups that does nothing else."""
        mark = next((g for g in GROUPERS if g in cell and g != " "), "")
        if not mark or marks.thousands:
            return None
        text = Marks(marks.decimal, mark)
        if not text.grouped.match(cell.replace(MINUS, "-")):
            return None
        self.grouped = mark
        return text.plain(cell)

    def result(self, rows: int, source: str, notes: list[str]) -> RawColumn | None:
        """The column; None for text.  Raises InputError for a word among numbers."""
        name = self.head.name
        total = sum(w.count for w in self.words.values())
        if self.words and self._is_text(total):
            word, first = min(self.words.items(), key=lambda w: w[1].line)
            some = f"; {self.numbers} cells of it are numbers" if self.numbers else ""
            notes.append(
                f"{name}: left out, it holds text ('{word[:40]}' in line {first.line}{_why(word)}){some}"
            )
            return None
        if self.words:
            word, first = min(self.words.items(), key=lambda w: w[1].line)
            raise InputError(
                f"{source}: line {first.line}: {name} is '{word[:40]}', not a number{_why(word)}; "
                f"--missing '{word[:40]}' if it stands for a missing value"
            )
        if self.flags and not np.isin(self.values[:rows][np.isfinite(self.values[:rows])], (0.0, 1.0)).all():
            word, first = min(self.flags.items(), key=lambda w: w[1].line)
            raise InputError(
                f"{source}: line {first.line}: {name} is '{word}' among numbers; --missing '{word}' if it "
                f"stands for a missing value"
            )
        for word, seen in self.missing.items():
            notes.append(f"{name}: '{word}' is no sample, {seen.count} times; the first: line {seen.line}")
        strange = [w for w in self.flags if w.lower() not in ("true", "false", "on", "off")]
        if strange:
            notes.append(f"{name}: words are 1 and 0: {', '.join(sorted(strange))}")
        if self.grouped:
            notes.append(f"{name}: '{self.grouped}' groups the digits")
        absent = None if self.absent is None else self.absent[:rows]
        if self.whole is not None:
            broken = np.isnan(self.values[:rows])
            return RawColumn(name, self.head.unit, self.whole, "", absent, broken, self.head.text)
        if self.wide:
            notes.append(f"{name}: {ROUNDED}")
        return RawColumn(name, self.head.unit, self.values[:rows], "", absent, None, self.head.text)

    def _is_text(self, words: int) -> bool:
        """Whether it holds text: fewer than half of its cells are numbers."""
        return self.numbers < words or (self.numbers == 0)

    @property
    def is_empty(self) -> bool:
        """Whether no cell holds anything."""
        return not (self.numbers or self.words or self.missing or self.flags)


def _count(into: dict[str, Word], cell: str, word: Word) -> None:
    before = into.get(cell)
    if before is None:
        if len(into) < 1000:
            into[cell] = word
    else:
        before.count += word.count


def _why(word: str) -> str:
    """What a cell is that looks like a number and is none."""
    if word[:2].lower() == "0x":
        return ": hexadecimal numbers are not read"
    if "_" in word and word.replace("_", "").isdigit():
        return ": --thousands _ if _ groups the digits"
    if any(c.isdigit() for c in word) and not is_date(word) and word[0] in "+-.0123456789":
        return ": no plain number (--decimal and --thousands say which marks it has, units go to the heading)"
    return ""
