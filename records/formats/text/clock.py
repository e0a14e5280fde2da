"""The clock of a table: numbers with a unit, or days and times of day (`dates.py`), exactly subtracted.

Numbers without a unit that may be days or seconds are refused with the option that says it.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from decimal import Decimal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from records.formats.metadata import at_ns
from records.formats.text.columns import array
from records.formats.text.dates import FOURTEEN, NONE, Dates, written_as_date
from records.formats.text.marks import Marks
from records.formats.text.words import MISSING, NOT_A_NUMBER, is_number
from records.formats.units import PER_SECOND, of_time, seconds, spelled
from specs.errors import InputError

FORMS = {"dd/mm/yyyy": "dmy", "mm/dd/yyyy": "mdy", "yyyymmdd": "ymd", "hhmmss": "hms"}
YEAR_2001 = 978_307_200  # s since 1970
YEAR_2065 = 3_000_000_000  # s since 1970: what LabVIEW writes now, counting from 1904, is beyond it
DAYS = {  # what counts days: its number of 1970, and what it is called
    "excel": (25_569.0, "days as spreadsheets count them"),
    "matlab": (719_529.0, "days as MATLAB counts them"),
    "julian": (2_440_587.5, "Julian days"),
    "wincc": (25_569.0, "millionths of days as WinCC counts them"),
}
PARTS = {"wincc": 1_000_000}  # of a day
MOST_DAYS = 700_000  # from 1970 to the ends of a calendar
CENTURY = 10_958, 47_482  # days since 1970 in which recordings begin: 2000 to 2100
BEHIND = r"([-+\d.,]+(?:[eE][-+]?\d+)?)\s*([^\W\d_]+)"  # a number and a unit behind it
PART_OF_DAY, SHORT = 0.01, 2.4e-5  # of a day: where a time of day may begin, and the longest step, 2 s
EIGHT = r"(19|20)\d\d[01]\d[0-3]\d"  # a day as one number
SLOWEST = 3600.0  # s between rows: more is no recording with times since 1970
UNTIMED = "the time states no unit: taken as s"  # said where nothing else tells


@dataclass
class Clock:
    """Reads the clock's cells block by block."""

    where: str
    unit: str  # stated in the file or by an option, "" if not
    marks: Marks
    says_date: bool = False  # the heading's name does
    kind: str = ""
    behind: str = ""  # unit that stands in each cell
    first: Decimal | None = None
    rows: int = 0  # room for so many, so that nothing has to be copied at the end
    filled: int = 0
    held: np.ndarray = field(default_factory=lambda: np.empty(0))
    dates: Dates = field(init=False)
    ahead_s: int | None = None  # of UTC: the zone of its dates that a heading states

    def __post_init__(self) -> None:
        self.dates = Dates(self.where, FORMS.get(self.unit, ""))

    def add(self, column: pa.ChunkedArray | pa.Array, numbers: Sequence[int]) -> None:
        """Add cells; raises InputError with the line of one that is no time."""
        cells = pc.utf8_trim_whitespace(column)  # type: ignore[attr-defined]
        lower = pc.utf8_lower(cells)  # type: ignore[attr-defined]
        nothing = pc.or_kleene(pc.equal(cells, ""), pc.is_in(lower, pa.array([*MISSING, *NOT_A_NUMBER])))  # type: ignore[attr-defined]
        cells = pc.if_else(pc.fill_null(nothing, True), pa.scalar(None, pa.string()), cells)  # type: ignore[attr-defined]
        if cells.null_count == len(cells):
            self._keep(np.full(len(cells), np.nan))
            return
        if not self.kind:
            some = next(c.as_py() for c in cells if c.is_valid)
            self._look_for_unit(some)
        if self.behind:
            cells = self._without_units(cells, numbers)
            some = "0"
        if not self.kind:
            self.kind = self._kind(some)
        self._keep(self._numbers(cells, numbers) if self.kind == "number" else self.dates.ns(cells, numbers))

    def _keep(self, part: np.ndarray) -> None:
        """Put times behind those before."""
        if not self.filled:
            self.held = np.empty(max(self.rows, len(part)), dtype=part.dtype)
        if part.dtype != self.held.dtype:  # only one of them has days: the other one is all NaN
            self.held, part = _days(self.held), _days(part)
        self.held[self.filled : self.filled + len(part)] = part
        self.filled += len(part)

    def _look_for_unit(self, cell: str) -> None:
        """Whether units stand in the cells, as MATLAB writes durations: `0.02 sec`."""
        match = re.fullmatch(BEHIND, cell)
        if match and not self.unit and of_time(match[2]) and self.marks.plain(match[1]) is not None:
            self.behind = self.unit = match[2]

    def _without_units(self, cells: pa.Array, numbers: Sequence[int]) -> pa.Array:
        """The numbers of such cells; raises InputError with the line of one without that unit."""
        there = pc.ends_with(cells, self.behind)  # type: ignore[attr-defined]
        if not pc.all(there).as_py():  # type: ignore[attr-defined]
            at = pc.index(there, False).as_py()  # type: ignore[attr-defined]
            raise InputError(
                f"{self.where}: line {numbers[at]}: '{cells[at]}' is not in '{self.behind}', as lines "
                "before are"
            )
        return pc.replace_substring_regex(cells, rf"\s*{self.behind}$", "")  # type: ignore[attr-defined]

    def _kind(self, cell: str) -> str:
        eight = self.says_date and not self.unit and re.fullmatch(EIGHT, cell)
        if (
            eight
            or FORMS.get(self.unit) in ("ymd", "hms")
            or (not self.unit and re.fullmatch(FOURTEEN, cell))
        ):
            return "date"
        if self.marks.plain(cell) is None and is_number(cell):
            raise InputError(
                f"{self.where}: '{cell}' is no number with '{self.marks.decimal}' before its decimals; "
                f"--decimal says another"
            )
        return "number" if self.marks.plain(cell) is not None else "date"

    def _numbers(self, cells: pa.Array, numbers: Sequence[int]) -> np.ndarray:
        """Times less the first one, in the file's unit."""
        exact = self._exact(cells, numbers)
        if self.first is None:
            self.first = next(Decimal(c.as_py()) for c in exact if c.is_valid)
        first = self.first
        try:
            whole = pc.cast(exact, pa.int64())  # type: ignore[attr-defined]
            if first == int(first):
                held = np.asarray(array(whole.fill_null(int(first))), dtype=np.int64) - np.int64(int(first))
                return np.where(np.asarray(array(whole.is_null())), np.nan, held.astype(np.float64))
        except (pa.ArrowException, OverflowError):
            pass
        floats = pc.cast(exact, pa.float64())  # type: ignore[attr-defined]
        held = np.asarray(array(floats.fill_null(float("nan"))), dtype=np.float64)
        if not first:
            return held
        try:
            less = pc.subtract(pc.cast(exact, pa.decimal128(30, 12)), pa.scalar(first, pa.decimal128(30, 12)))  # type: ignore[attr-defined]
            found = pc.cast(less, pa.float64())  # type: ignore[attr-defined]
            return np.asarray(array(found.fill_null(float("nan"))), dtype=np.float64)
        except pa.ArrowException:
            return held - float(first)

    def _exact(self, cells: pa.Array, numbers: Sequence[int]) -> pa.Array:
        """The numbers as Python writes them."""
        plain = cells
        if self.marks.decimal == ",":
            plain = pc.replace_substring(plain, ",", ".") if not self.marks.thousands else cells  # type: ignore[attr-defined]
        try:
            pc.cast(plain, pa.float64())  # type: ignore[attr-defined]
            if not self.marks.thousands or self.marks.thousands not in "".join(
                c for c in cells.to_pylist() if c
            ):  # type: ignore[attr-defined]
                return plain
        except pa.ArrowException:
            pass
        found = []
        for i, cell in enumerate(cells.to_pylist()):
            text = None if cell is None else self.marks.plain(cell)
            if cell is not None and text is None:
                raise InputError(f"{self.where}: line {numbers[i]}: '{cell}' is no time")
            found.append(text)
        return pa.array(found, pa.string())

    def of_floats(self, held: np.ndarray, notes: list[str]) -> tuple[np.ndarray, datetime | None, float]:
        """The result of a column that holds floats already."""
        there = held[np.isfinite(held)]
        self.kind, self.first = "number", Decimal(float(there[0])) if len(there) else Decimal(0)
        self._keep(held - float(self.first))
        return self.result(notes)

    def result(self, notes: list[str]) -> tuple[np.ndarray, datetime | None, float]:
        """Times in s from the first row's, the time of day there if it is known, and the file's
        own first time in s.
        """
        found = self.held[: self.filled]
        if self.kind in ("", "number"):
            return self._of_numbers(found, notes)
        notes += [self.dates.told] if self.dates.told else []
        found = _days(found)
        there = found != NONE
        first = int(found[there][0]) if there.any() else 0
        time = np.where(there, (found - first) / 1e9, np.nan)
        if self.dates.of_day:
            notes.append("the times are times of day without a date: the start is not known")
            return time, None, first / 1e9
        if not self.dates.zone and self.ahead_s is None:
            notes.append("the times state no time zone: taken as UTC")
        ahead = 0 if self.dates.zone else self.ahead_s or 0
        return time, at_ns(first - ahead * 10**9), 0.0

    def _of_numbers(self, found: np.ndarray, notes: list[str]) -> tuple[np.ndarray, datetime | None, float]:
        first = float(self.first or 0)
        steps = np.diff(found[:10_000][np.isfinite(found[:10_000])])
        step = float(np.median(np.abs(steps))) if len(steps) else 0.0
        if self.unit in DAYS:
            (zero, called), parts = DAYS[self.unit], PARTS.get(self.unit, 1)
            if not abs(first / parts - zero) < MOST_DAYS:
                raise InputError(f"{self.where}: {self.first} is no number of {called}")
            start = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(days=first / parts - zero)
            notes.append("the times state no time zone: taken as UTC")
            return found * (86_400.0 / parts), start, 0.0
        if self.unit in FORMS:
            raise InputError(f"{self.where}: its cells are numbers, no dates as {self.unit}")
        unit = spelled(self.unit) if self.unit else ""
        per = PER_SECOND.get(unit, 0)
        if unit in PER_SECOND:
            if _of_epoch(first, per):
                notes.append(f"the times count {unit} since 1970: the recording starts at that time of day")
                return found if per == 1 else found / per, _since_1970(self.first or Decimal(0), per), 0.0
            self._check_size(first, unit, per)
        elif not unit:
            return self._without_unit(found, first, step, notes)
        base = float(np.asarray(seconds(np.array([first]), unit, self.where))[0])
        return np.asarray(seconds(found, unit, self.where)), None, base

    def _check_size(self, first: float, unit: str, per: int) -> None:
        """Refuse times whose unit cannot be the one that the file states."""
        finer = next((u for u, p in PER_SECOND.items() if p > per and _of_epoch(first, p)), "")
        if finer:
            raise InputError(
                f"{self.where}: times such as {self.first} are no {unit}: they have the size of {finer} "
                f"since 1970; --clock 'NAME [{finer}]' says it"
            )

    def _without_unit(
        self, found: np.ndarray, first: float, step: float, notes: list[str]
    ) -> tuple[np.ndarray, datetime | None, float]:
        for unit, per in PER_SECOND.items():
            if _of_epoch(first, per):
                if step / per > SLOWEST:
                    break
                notes.append(f"the time states no unit: taken as {unit} since 1970, which its size says")
                return found if per == 1 else found / per, _since_1970(self.first or Decimal(0), per), 0.0
        if first > YEAR_2001:
            raise InputError(
                f"{self.where}: times such as {self.first} state no unit; --clock 'NAME [us]' says it "
                f"({', '.join(PER_SECOND)})"
            )
        kind = next((k for k, (zero, _) in DAYS.items() if CENTURY[0] < first - zero < CENTURY[1]), "")
        if kind and 0 < step < 2e-3:
            raise InputError(
                f"{self.where}: times such as {self.first} may be s, or {DAYS[kind][1]}; "
                f"--clock 'NAME [{kind}]' or 'NAME [s]' says which"
            )
        if PART_OF_DAY < first < 1 and 0 < step < SHORT:
            raise InputError(
                f"{self.where}: times such as {self.first} may be s, or parts of a day as spreadsheets count "
                "them; --clock 'NAME [d]' or 'NAME [s]' says which"
            )
        if form := written_as_date(found, first):
            raise InputError(
                f"{self.where}: times such as {self.first} may be s, or all be {form}; --clock 'NAME "
                f"[{form}]' or 'NAME [s]' says which"
            )
        notes.append(UNTIMED)
        return found, None, first


def _of_epoch(first: float, per: int) -> bool:
    """Whether a time counts from 1970 in parts of a second, `per` of them in one."""
    return YEAR_2001 * per < first < YEAR_2065 * per


def _days(held: np.ndarray) -> np.ndarray:
    """Times as whole ns; what was NaN is none."""
    return held if held.dtype == np.int64 else np.full(len(held), NONE, dtype=np.int64)


def _since_1970(first: Decimal, per: int) -> datetime:
    return at_ns(int(first * (1_000_000_000 // per)))
