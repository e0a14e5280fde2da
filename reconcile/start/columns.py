"""What the columns of a foreign recording are: their units and roles, by heading, then by data."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from reconcile.recordings.ends import far_off, held
from reconcile.start.headings import (
    QUANTITIES,
    is_of,
    role_of,
    roles_named,
    says_command,
    unit_in_name,
    words_of,
)
from reconcile.start.units import known_ratios
from records.formats import read_measurement
from records.formats.units import spelled
from records.measurement import Measurement
from specs.errors import InputError

LEAST_SAMPLES = 30
ALIKE = 0.95  # correlation of a column with the slope of a position that makes it a velocity
SAME = 0.1  # by which its size may differ from that slope, in the same or another usual unit
USUAL = (1.0, 1.0 / 6.0, *known_ratios())  # ratios of units; 1/6: rpm beside degrees
JUMP, SWITCHED = 0.2, 0.8  # of its range, that a signal jumps by; of all its changes, that are jumps
MOTION = ("position", "velocity")
VOLTAGES, CURRENTS = {"voltage", "volt", "spannung"}, {"current", "strom"}
WANTED = "guessed: a wanted value, and no other input is recorded"


@dataclass(frozen=True)
class Column:
    """A channel: `name` as the map needs it, `unit` "" where nothing says it, `role` "" where unknown."""

    name: str
    unit: str
    stated: bool  # the file states the unit in a way that every reader of recordings understands
    role: str
    reason: str
    time: np.ndarray
    values: np.ndarray

    @property
    def joint(self) -> int | None:
        """Number of the joint in the name."""
        found = re.findall(r"\d+", self.name)
        return int(found[-1]) if found else None

    @property
    def constant(self) -> bool:
        """Whether it keeps one value."""
        return bool(np.ptp(self.values) == 0.0)

    @property
    def held(self) -> bool:
        """Whether it moves in steps."""
        return held(self.values)

    @property
    def switched(self) -> bool:
        """Whether it moves in steps, noise aside: by few large changes from sample to sample."""
        changes = np.abs(np.diff(self.values))
        jumps = changes[changes > JUMP * np.ptp(self.values)]
        return bool(np.sum(jumps) > SWITCHED * np.sum(changes))

    @property
    def turns(self) -> bool:
        """Whether its unit is of an angle or of a speed of turning."""
        return is_of(self.unit, "rad") or is_of(self.unit, "rad/s")


def read_columns(path: Path) -> list[Column]:
    """The columns with numbers and their roles; InputError for a recording that no model can start from."""
    return columns_of(read_measurement(path), path)


def columns_of(measured: Measurement, path: Path) -> list[Column]:
    """The same of a recording that is read."""
    found = [_column(c) for c in measured.channels.values() if _numbers(c.values)]
    if not found:
        raise InputError(f"{path} has no column of numbers beside the time")
    most = max(len(c.time) for c in found)
    if most < LEAST_SAMPLES:
        raise InputError(f"{path} has {most} samples, and {LEAST_SAMPLES} are needed")
    return [c if c.role == "input" else _with_values(c) for c in _by_data(_heated(found))]


def _heated(columns: Sequence[Column]) -> list[Column]:
    """T1 beside Q1 without units, as heaters log them: a temperature and the heat that drives it."""
    names = {c.name for c in columns if not c.unit}
    text = "guessed: T and Q of one number are a temperature and its heat"

    def told(c: Column) -> Column:
        kind, number = c.name[:1], c.name[1:]
        if not (number.isdigit() and {f"T{number}", f"Q{number}"} <= names and c.name in names):
            return c
        return replace(c, role="input" if kind == "Q" else "other", reason=text)

    return [told(c) for c in columns]


def _with_values(column: Column) -> Column:
    """Without samples that stand for no value, such as -999: they would bend what is estimated."""
    off = far_off(column.values)
    return replace(column, time=column.time[~off], values=column.values[~off])


def _numbers(values: np.ndarray) -> bool:
    return np.issubdtype(values.dtype, np.number) and values.dtype != bool


def _column(channel) -> Column:
    values = np.asarray(channel.values, dtype=float)
    good = np.isfinite(values)
    unit, stated = spelled(channel.unit), bool(channel.unit)
    if not unit:
        unit = unit_in_name(channel.name)
    role, reason = role_of(channel.name, unit)
    return Column(channel.name, unit, stated, role, reason, channel.time[good], values[good])


def _by_data(columns: Sequence[Column]) -> list[Column]:
    """Roles that headings do not tell: a slope of a position is a velocity, steps or one more the input."""
    found = list(columns)
    positions = [c for c in found if c.role == "position" and not c.constant]
    for i, c in enumerate(found):
        if c.role or c.constant:
            continue
        for p in positions:
            alike, ratio = slope_alike(p, c)
            if abs(alike) > ALIKE and any(abs(ratio / usual - 1.0) < SAME for usual in USUAL):
                text = f"guessed: it follows the slope of {p.name} (correlation {alike:.3f})"
                found[i] = replace(c, role="velocity", reason=text)
                break
    unknown = [i for i, c in enumerate(found) if not c.role and not c.constant]
    held = [i for i in unknown if found[i].held]
    free = sum(not c.constant and c.role != "setpoint" for c in found)
    if not any(c.role == "input" for c in found) and len(held) < free:
        for i in held:
            found[i] = replace(found[i], role="input", reason="guessed: it moves in steps")
    unknown = [i for i, c in enumerate(found) if _may_drive(c)]
    if (
        len(unknown) == 1
        and any(c.role in MOTION and not c.constant for c in found)
        and not any(c.role == "input" for c in found)
    ):
        text = "guessed: nothing else is left that could drive it"
        found[unknown[0]] = replace(found[unknown[0]], role="input", reason=text)
    return _wanted(_last(_currents(_two(found))))


def _currents(columns: list[Column]) -> list[Column]:
    """Currents are outputs beside a voltage, unless something moves: a drive's current may be its input.

    Of a cell it is the other way round: its current is switched, and its voltage goes after that.
    """
    if any(c.role in MOTION and c.unit and not c.constant for c in columns):
        return columns
    inputs = [c for c in columns if c.role == "input" and not c.constant]
    drawn = next((c for c in inputs if _measures(c, "A", CURRENTS) and c.switched), None)
    follows = [c for c in inputs if _measures(c, "V", VOLTAGES) and not c.switched]
    if drawn is None or not follows:
        return currents_out(columns)
    text = f"a voltage, driven by {drawn.name}"
    return [replace(c, role="other", reason=text) if any(c is f for f in follows) else c for c in columns]


def currents_out(columns: Sequence[Column]) -> list[Column]:
    """The columns, those that are a current outputs where a voltage is the input."""
    inputs = [c for c in columns if c.role == "input" and not c.constant]
    drives = next((c for c in inputs if _measures(c, "V", VOLTAGES)), None)
    if drives is None:
        return list(columns)
    text = f"a current, driven by {drives.name}"
    flows = [c for c in inputs if _measures(c, "A", CURRENTS) and not says_command(c.name)]
    return [replace(c, role="other", reason=text) if any(c is f for f in flows) else c for c in columns]


def _measures(column: Column, unit: str, words: set[str]) -> bool:
    return column.unit == unit or (not column.unit and bool(set(words_of(column.name)) & words))


def _last(columns: list[Column]) -> list[Column]:
    """Of inputs alone, the one that its unit alone makes one is the output."""
    moving = [c for c in columns if not c.constant and c.role != "setpoint"]
    unsaid = [c for c in moving if "input" not in roles_named(c.name)]
    if len(moving) < 2 or len(unsaid) != 1 or any(c.role != "input" for c in moving):
        return columns
    text = "guessed: nothing else is left that could be the output"
    return [replace(c, role="other", reason=text) if c is unsaid[0] else c for c in columns]


def _wanted(columns: list[Column]) -> list[Column]:
    """The one wanted value is the input where there is no other."""
    moving = [c for c in columns if not c.constant]
    wanted = [c for c in moving if c.role == "setpoint"]
    if len(wanted) != 1 or len(moving) < 2 or any(c.role == "input" for c in moving):
        return columns
    return [replace(c, role="input", reason=WANTED) if c is wanted[0] else c for c in columns]


def _may_drive(column: Column) -> bool:
    """Whether it may be the input, for all that heading and unit tell; a temperature is none."""
    return column.role in ("", "other") and not column.constant and not is_of(column.unit, "K")


def _two(columns: list[Column]) -> list[Column]:
    """Two quantities that are no motion: where one alone moves in steps, it drives the other."""
    moving = [c for c in columns if not c.constant and c.role != "setpoint"]
    held = [c for c in moving if c.held]
    if len(moving) != 2 or len(held) != 1 or any(c.role not in ("input", "other", "") for c in moving):
        return columns
    (driver,) = held
    if set(words_of(driver.name)) & QUANTITIES:
        return columns

    def told(c: Column) -> Column:
        if c is driver and c.role != "input":
            return replace(c, role="input", reason="guessed: it moves in steps")
        if any(c is m for m in moving) and c is not driver and c.role != "other":
            return replace(c, role="other", reason=f"guessed: {driver.name} drives it")
        return c

    return [told(c) for c in columns]


def slope_alike(position: Column, other: Column) -> tuple[float, float]:
    """Correlation of changes of a position with another column's integral over them, and their ratio."""
    values = np.interp(position.time, other.time, other.values)
    area = np.append(0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(position.time)))
    best, ratio = 0.0, 1.0
    for lag in (1, 2, 5, 10, 20):
        if len(area) > 3 * lag:
            a, b = area[lag:] - area[:-lag], position.values[lag:] - position.values[:-lag]
            if np.ptp(a) > 0 and np.ptp(b) > 0:
                c = float(np.corrcoef(a, b)[0, 1])
                best, ratio = (c, float(np.std(a) / np.std(b))) if abs(c) > abs(best) else (best, ratio)
    return best, ratio
