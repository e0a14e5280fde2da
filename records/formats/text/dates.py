"""Days and times of day in the usual forms, as whole ns since 1970 or since midnight.

One form in the whole file, which its first cell shows.  What a form leaves open is refused with the option
that says it: a month that may be the day, hours that may be minutes.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from records.formats.text.columns import array
from specs.errors import InputError

NONE = np.iinfo(np.int64).min  # no time
DATES = {
    "dmy": (r"^(\d{1,2})\.(\d{1,2})\.(\d{4})", r"\3-\2-\1"),
    "ymd": (r"^(\d{4})/(\d{1,2})/(\d{1,2})", r"\1-\2-\3"),
    "eight": (r"^(\d{4})(\d\d)(\d\d)$", r"\1-\2-\3"),
}
SLASHES = r"^(\d{1,2})/(\d{1,2})/(\d{4})"
ORDERS = {"dmy": r"\3-\2-\1", "mdy": r"\3-\1-\2"}
# Each part with two digits, one blank before the time.
PADDED = (
    (r"^(\d{4})-(\d)-", r"\1-0\2-"), (r"^(\d{4}-\d\d)-(\d)(\D|$)", r"\1-0\2\3"),
    (r"^(\d{4}-\d\d-\d\d)[ T]+(\d):", r"\1 0\2:"), (r"^(\d{4}-\d\d-\d\d)  +", r"\1 "),
)  # fmt: skip
OF_DAY = ((r"^(\d{1,2}):(\d\d\.\d+)$", r"00:\1:\2"), (r"^(\d):", r"0\1:"), (r"^(\d\d):(\d):", r"\1:0\2:"))
HALF = r"(?i)[\s\x{a0}\x{202f}]*[ap]\.?m\.?$"  # with blanks that do not break, too
TWELVE = r"(^|[ T])(0?[1-9]|1[0-2])(:\d\d(:\d\d(\.\d+)?)?)$"  # hours from 1 to 12, minutes behind them
HALF_DAY_NS = 12 * 3600 * 10**9
ZONE = r"(Z|z|[+-]\d\d:?\d\d)$"


@dataclass
class Dates:
    """Reads cells block by block."""

    where: str
    order: str = ""  # dmy or mdy: stated
    form: str = ""  # of the first cell: all others have it
    of_day: bool = False  # times of day without a day
    zone: bool | None = None
    halves: bool | None = None  # AM or PM behind each time

    def ns(self, cells: pa.Array, numbers: Sequence[int]) -> np.ndarray:
        """Whole ns [n], NONE for an empty cell; raises InputError with the line of one that is no time."""
        twelve, late = self._of_24_hours(cells, numbers)
        iso = self._as_iso(twelve, numbers)
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
        held[late & (held != NONE)] += HALF_DAY_NS
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
        some, place = cells[_there(cells)].as_py(), numbers[_there(cells)]
        out = _replaced(cells, (r"(\d:\d\d),(\d+)", r"\1.\2"))
        self.form = self.form or next((k for k, form in DATES.items() if re.match(form[0], some)), "other")
        if self.form in DATES:
            out = _replaced(out, DATES[self.form])
        if re.match(SLASHES, some):
            out = _replaced(out, (SLASHES, ORDERS[self._order(some, place)]))
        out = _replaced(out, *PADDED)
        self.of_day = self.of_day or bool(re.match(r"\d{1,3}:\d\d", some))
        if self.of_day:
            if re.fullmatch(r"\d{1,3}:\d\d", some):
                raise InputError(
                    f"{self.where}: line {place}: '{some}' may be hours and minutes, or minutes and seconds; "
                    "write it with both"
                )
            out = _replaced(out, *OF_DAY, (r"^", "1970-01-01 "))
        return _replaced(out, (r"(\.\d{9})\d+", r"\1"))

    def _order(self, some: str, line: int) -> str:
        if self.order:
            return self.order
        raise InputError(
            f"{self.where}: line {line}: '{some}': day or month first? --clock 'NAME [dd/mm/yyyy]' or "
            "'NAME [mm/dd/yyyy]' says which"
        )

    def _check_zone(self, iso: pa.Array, cells: pa.Array, numbers: Sequence[int]) -> None:
        """All cells state a time zone, or none does."""
        has_zone = pc.match_substring_regex(iso, ZONE)  # type: ignore[attr-defined]
        if self.zone is None:
            self.zone = bool(has_zone[_there(iso)].as_py())
        self._check(has_zone, self.zone, "a time zone", cells, numbers)


def _replaced(cells: pa.Array, *changes: tuple[str, str]) -> pa.Array:
    for pattern, put in changes:
        cells = pc.replace_substring_regex(cells, pattern, put)  # type: ignore[attr-defined]
    return cells


def _there(cells: pa.Array) -> int:
    """Index of the first cell that is not empty."""
    return pc.index(pc.is_valid(cells), True).as_py()  # type: ignore[attr-defined]


def _is_iso(cell: str) -> bool:
    try:
        pc.cast(pa.array([cell]), pa.timestamp("ns", "UTC") if re.search(ZONE, cell) else pa.timestamp("ns"))  # type: ignore[attr-defined]
    except pa.ArrowException:
        return False
    return True
