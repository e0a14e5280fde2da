"""Days and times of day in the usual forms, as whole ns since 1970 or since midnight.

One form in the whole file, which its first cell shows.  What a form leaves open is refused with the option
that says it: a month that may be the day, hours that may be minutes, a number that may be written as a date.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from records.formats.text.columns import array
from records.formats.text.words import MONTHS
from records.measurement import GAP
from specs.errors import InputError

NONE = np.iinfo(np.int64).min  # no time
NAME = r"([^\d\s.,/-]{3,9})"  # of a month
DATES = {
    "dmy": (r"^(\d{1,2})\.(\d{1,2})\.(\d{4})", r"\3-\2-\1"),
    "ymd": (r"^(\d{4})[/.](\d{1,2})[/.](\d{1,2})", r"\1-\2-\3"),
    "eight": (r"^(\d{4})(\d\d)(\d\d)($| \d\d?:)", r"\1-\2-\3\4"),
    "fourteen": (r"^(\d{4})(\d\d)(\d\d)[ T]?(\d\d)(\d\d)(\d\d)", r"\1-\2-\3 \4:\5:\6"),
    "day month": (rf"^(\d{{1,2}})[-. ]+{NAME}[-. ]+(\d{{4}})", r"\3-\2-\1"),
    "month day": (rf"^(?:{NAME}\.?,? +)?{NAME}\.? +(\d{{1,2}}), *(\d{{4}})", r"\4-\2-\3"),
    "year last": (rf"^{NAME} {NAME} +(\d{{1,2}}) (\S+) (\d{{4}})$", r"\5-\2-\3 \4"),
}
FOURTEEN = r"(19|20)\d\d[01]\d[0-3]\d ?[0-2]\d[0-5]\d[0-5]\d([.,]\d+)?"  # a date and a time as one number
USUAL = (  # decimals, the blank before a time, and time zones as ISO 8601 has them
    (r"(\d:\d\d),(\d+)", r"\1.\2"), (r"(:\d\d:\d\d):(\d{3}|\d{6})(\D|$)", r"\1.\2\3"),
    (r"^(\d{4})([-/.]\d{1,2})([-/.]\d{1,2})[T_-](\d)", r"\1\2\3 \4"),
    (r"\s*(?:UTC|GMT|Z|z)$", "Z"), (r"(:\d\d(?:\.\d+)?)\s+([+-]\d\d)", r"\1\2"),
    (r"(:\d\d(?:\.\d+)?[+-]\d\d)$", r"\1:00"),
)  # fmt: skip
SIX = tuple((rf"^(\d{{{n}}})([.,]|$)", "0" * (6 - n) + r"\1\2") for n in range(1, 6))
SLASHES = r"^(\d{1,2})/(\d{1,2})/(\d{4})"
NO_MONTH = {
    "dmy": r"^(1[3-9]|[23]\d)/\d{1,2}/",
    "mdy": r"^\d{1,2}/(1[3-9]|[23]\d)/",
}  # a day
ORDERS = {"dmy": r"\3-\2-\1", "mdy": r"\3-\1-\2"}
# Each part with two digits, one blank before the time.
PADDED = (
    (r"^(\d{4})-(\d)-", r"\1-0\2-"), (r"^(\d{4}-\d\d)-(\d)(\D|$)", r"\1-0\2\3"),
    (r"^(\d{4}-\d\d-\d\d)[ T]+(\d):", r"\1 0\2:"), (r"^(\d{4}-\d\d-\d\d)  +", r"\1 "),
)  # fmt: skip
# Times of day, and what lasts longer than a day: `N days hours:minutes:seconds`.
OF_DAY = (
    (r"^(\d{1,2}):(\d\d\.\d+)$", r"00:\1:\2"), (r"^(\d+):", r"0 days \1:"),
    (r"^(\d+) days?,? ", r"\1 days "), (r"^(\d+ days \d+):(\d):", r"\1:0\2:"),
)  # fmt: skip
HOURS = r"^(\d+) days (\d+):(.*)$"
PART = 1 << 18  # times looked at together
HOUR_NS = 3600 * 10**9
HALF = r"(?i)[\s\x{a0}\x{202f}]*[ap]\.?m\.?$"  # with blanks that do not break, too
TWELVE = r"(^|[ T])(0?[1-9]|1[0-2])(:\d\d(:\d\d(\.\d+)?)?)$"  # hours from 1 to 12, minutes behind them
ZONE = r"(Z|z|[+-]\d\d:?\d\d)$"


@dataclass
class Dates:
    """Reads cells block by block."""

    where: str
    order: str = ""  # dmy, mdy, ymd or hms: stated
    form: str = ""  # of the first cell: all others have it
    told: str = ""  # how days and months were told apart, where nobody stated it
    of_day: bool = False  # times of day without a day
    zone: bool | None = None
    halves: bool | None = None  # AM or PM behind each time

    def ns(self, cells: pa.Array, numbers: Sequence[int]) -> np.ndarray:
        """Whole ns [n], NONE for an empty cell; raises InputError with the line of one that is no time."""
        twelve, late = self._of_24_hours(cells, numbers)
        iso, hours = _hours(self._as_iso(twelve, numbers))
        self._check_zone(iso, cells, numbers)
        try:
            stamps = pc.cast(iso, pa.timestamp("ns", "UTC") if self.zone else pa.timestamp("ns"))  # type: ignore[attr-defined]
        except pa.ArrowException:
            bad = next((i for i, c in enumerate(iso.to_pylist()) if c is not None and not _is_iso(c)), 0)
            raise InputError(
                f"{self.where}: line {numbers[bad]}: '{cells[bad]}' is neither a number nor a date in a form "
                "that is read: 2026-03-29 01:59:59.900, 29.03.2026 01:59:59, 01:59:59.900, 01:59:59 PM"
            ) from None
        held = np.array(array(pc.cast(stamps, pa.int64()).fill_null(NONE)), dtype=np.int64)  # type: ignore[attr-defined]
        held[held != NONE] += (12 * late + hours)[held != NONE] * HOUR_NS
        return held

    def _of_24_hours(self, cells: pa.Array, numbers: Sequence[int]) -> tuple[pa.Array, np.ndarray]:
        """Cells without AM and PM, 12 o'clock as 0, and which of them are of the day's second half."""
        has_half = pc.match_substring_regex(cells, HALF)  # type: ignore[attr-defined]
        if self.halves is None:
            self.halves = bool(has_half[_there(cells)].as_py())
        self._check(has_half, self.halves, "AM or PM", cells, numbers)
        if not self.halves:
            return cells, np.zeros(len(cells), dtype=bool)
        late = pc.match_substring_regex(cells, r"(?i)p\.?m\.?$")  # type: ignore[attr-defined]
        bare = pc.replace_substring_regex(cells, HALF, "")  # type: ignore[attr-defined]
        wrong = pc.invert(pc.match_substring_regex(bare, TWELVE))  # type: ignore[attr-defined]
        self._refuse(wrong, "is no time of 12 hours with AM or PM", cells, numbers)
        bare = _replaced(bare, (r"(^|[ T])12:", r"\100:"), (r"(^|[ T])(\d{1,2}:\d\d)$", r"\1\2:00"))
        return bare, np.asarray(array(late.fill_null(False)))

    def _check(
        self, there: pa.Array, first: bool, what: str, cells: pa.Array, numbers: Sequence[int]
    ) -> None:
        """All cells state it, or none does."""
        says = (
            f"states no {what.removeprefix('a ')}, lines before do"
            if first
            else f"states {what}, lines before do not"
        )
        self._refuse(pc.invert(there) if first else there, says, cells, numbers)  # type: ignore[attr-defined]

    def _refuse(self, wrong: pa.Array, what: str, cells: pa.Array, numbers: Sequence[int]) -> None:
        at = pc.index(wrong, True).as_py()  # type: ignore[attr-defined]
        if at >= 0:
            raise InputError(f"{self.where}: line {numbers[at]}: '{cells[at]}' {what}")

    def _as_iso(self, cells: pa.Array, numbers: Sequence[int]) -> pa.Array:
        """Cells as ISO 8601; times of day on the first day of 1970."""
        six = (*SIX, (r"^(\d\d)(\d\d)(\d\d)", r"\1:\2:\3")) if self.order == "hms" else ()
        out = _replaced(cells, *six, *USUAL)
        some, place = out[_there(cells)].as_py(), numbers[_there(cells)]
        self.form = self.form or next((k for k, form in DATES.items() if re.match(form[0], some)), "other")
        if self.form in DATES:
            out = _replaced(out, DATES[self.form])
            out = _replaced(out, *_MONTHS) if NAME in DATES[self.form][0] else out
        if re.match(SLASHES, some):
            out = _replaced(out, (SLASHES, ORDERS[self._order(out, some, place)]))
        out = _replaced(out, *PADDED)
        self.of_day = self.of_day or bool(re.match(r"(\d+ days?,? )?\d+:\d\d", some))
        if self.of_day:
            if re.fullmatch(r"\d{1,3}:\d\d", some):
                raise InputError(
                    f"{self.where}: line {place}: '{some}' may be hours and minutes, or minutes and seconds; "
                    "write it with both"
                )
            out = _replaced(out, *OF_DAY)
        return _replaced(out, (r"(\.\d{9})\d+", r"\1"))

    def _order(self, cells: pa.Array, some: str, line: int) -> str:
        """Whether day or month come first: stated, or a number beyond 12 says it."""
        if self.order in ORDERS:
            return self.order
        days = {o: c for o, form in NO_MONTH.items() if (c := _first(cells, form))}
        if len(days) != 1:
            raise InputError(
                f"{self.where}: line {line}: '{some}': day or month first? --clock 'NAME [dd/mm/yyyy]' or "
                "'NAME [mm/dd/yyyy]' says which"
            )
        self.order, cell = next(iter(days.items()))
        self.told = f"'{cell}' can only have the {'day' if self.order == 'dmy' else 'month'} first"
        return self.order

    def _check_zone(self, iso: pa.Array, cells: pa.Array, numbers: Sequence[int]) -> None:
        """All cells state a time zone, or none does."""
        has_zone = pc.match_substring_regex(iso, ZONE)  # type: ignore[attr-defined]
        if self.zone is None:
            self.zone = bool(has_zone[_there(iso)].as_py())
        self._check(has_zone, self.zone, "a time zone", cells, numbers)


_MONTHS = tuple((rf"(?i)^(\d{{4}})-{name}[^-]*-", rf"\1-{n:02d}-") for name, n in MONTHS.items())


def _hours(cells: pa.Array) -> tuple[pa.Array, np.ndarray]:
    """Cells of hours as minutes and seconds of 1970, and the hours [n]; dates as they are, with none."""
    timed = pc.match_substring_regex(cells, HOURS)  # type: ignore[attr-defined]
    if not pc.any(timed).as_py():  # type: ignore[attr-defined]
        return cells, np.zeros(len(cells), dtype=np.int64)
    hours = np.zeros(len(cells), dtype=np.int64)
    for part, weight in ((r"\1", 24), (r"\2", 1)):
        digits = pc.if_else(timed, _replaced(cells, (HOURS, part)), "0")  # type: ignore[attr-defined]
        hours += weight * np.asarray(array(pc.cast(digits, pa.int64()).fill_null(0)))  # type: ignore[attr-defined]
    return _replaced(cells, (HOURS, r"1970-01-01 00:\3")), hours


def written_as_date(values: np.ndarray, first: float = 0.0) -> str:
    """`yyyymmdd` or `hhmmss` where all numbers `first` + values [n] may be that; "" where they are not.

    They are hours, minutes and seconds only where that leaves no gap when a minute ends.
    """
    found = set[str]()
    for k in range(0, len(values), PART):  # in parts: recordings are large
        part = values[k : k + PART + 1] + first
        form = _form_of(part[np.isfinite(part)])
        if form is None:
            return ""
        found.add(form)
    return next(iter(found - {""})) if len(found - {""}) == 1 else ""


def _form_of(values: np.ndarray) -> str | None:
    """What numbers may be; "" where minutes of one hour leave that open, None where they are numbers."""
    values = np.sort(values)  # rows may come late, or newest first
    whole = np.floor(values + 1e-6).astype(np.int64)
    if not len(values) or whole.min() < 0 or whole.max() >= 21_000_000:
        return None if len(values) else ""
    high, low = whole // 100 % 100, whole % 100
    if whole.min() > 19_000_000:
        ymd = (high > 0) & (high < 13) & (low > 0) & (low < 32) & (np.abs(values - whole) < 1e-6)
        return "yyyymmdd" if ymd.all() else None
    if whole.max() >= 240_000 or high.max() > 59 or low.max() > 59:
        return None
    steps, of_day = np.diff(values), np.diff(values - 40 * (whole // 100) - 2400 * (whole // 10_000))
    over = np.diff(whole // 100) > 0
    if not over.any():
        return ""
    even = GAP * np.median(of_day)
    return "hhmmss" if (steps[over] > even).all() and (of_day <= even).all() else None


def _replaced(cells: pa.Array, *changes: tuple[str, str]) -> pa.Array:
    for pattern, put in changes:
        cells = pc.replace_substring_regex(cells, pattern, put)  # type: ignore[attr-defined]
    return cells


def _there(cells: pa.Array) -> int:
    """Index of the first cell that is not empty."""
    return pc.index(pc.is_valid(cells), True).as_py()  # type: ignore[attr-defined]


def _first(cells: pa.Array, form: str) -> str:
    """The first cell of a form; "" if there is none."""
    at = pc.index(pc.match_substring_regex(cells, form), True).as_py()  # type: ignore[attr-defined]
    return cells[at].as_py() if at >= 0 else ""


def _is_iso(cell: str) -> bool:
    try:
        pc.cast(pa.array([cell]), pa.timestamp("ns", "UTC") if re.search(ZONE, cell) else pa.timestamp("ns"))  # type: ignore[attr-defined]
    except pa.ArrowException:
        return False
    return True
