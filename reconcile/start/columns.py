"""What the columns of a foreign recording are: their units and roles, by heading, then by data."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from reconcile.recordings.ends import far_off
from reconcile.start.units import known_ratios
from records.formats import read_measurement
from records.formats.units import OTHERS, is_unit, spelled
from records.measurement import Measurement
from specs.errors import InputError
from specs.units import compatible

LEAST_SAMPLES = 30
ALIKE = 0.95  # correlation of a column with the slope of a position that makes it a velocity
SAME = 0.1  # by which its size may differ from that slope, in the same or another usual unit
USUAL = (1.0, 1.0 / 6.0, *known_ratios())  # ratios of units; 1/6: rpm beside degrees
HELD = 0.5  # share of samples equal to the one before, of what moves in steps
WORDS = {
    "output": "out output response",
    "setpoint": "des desired ref reference target setpoint soll sollwert goal",
    "acceleration": "acc accel acceleration qdd ddq beschleunigung",
    "velocity": "v vel velocity speed omega w rpm rate qd dq qdot drehzahl geschwindigkeit geschw thetadot",
    "input": "u tau torque force cmd command voltage current moment drehmoment kraft pwm input spannung "
    "strom volt effort duty trq frc in valve spool pump heater throttle lever joystick control ctrl rudder",
    "position": "q p x y pos position angle phi theta winkel weg height hoehe encoder stroke lage ang",
}
ROLE_OF_WORD = {word: role for role, words in WORDS.items() for word in words.split()}
COMMANDS = ("command", "cmd", "input", "rudder")  # inputs whatever their unit: a position may be asked for
UNIT_ROLES = (
    ("rad", "position"), ("m", "position"), ("rad/s", "velocity"), ("m/s", "velocity"),
    ("rad/s2", "acceleration"), ("m/s2", "acceleration"), ("N", "input"), ("N.m", "input"),
)  # fmt: skip
SHORT_UNITS = {
    "degps": "deg/s", "dps": "deg/s", "radps": "rad/s", "mps": "m/s", "kmh": "km/h", "kph": "km/h",
}  # fmt: skip
MOTION = ("position", "velocity")
LEVELS = ("level", "niveau", "stand", "fuellstand", "füllstand")
COMMAND_UNITS = ("V", "A", "%")


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
        return float(np.mean(np.diff(self.values) == 0.0)) > HELD

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
    return [c if c.role == "input" else _with_values(c) for c in _by_data(found)]


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
    role, reason = _role(channel.name, unit)
    return Column(channel.name, unit, stated, role, reason, channel.time[good], values[good])


def unit_in_name(name: str) -> str:
    """The unit that a name ends with, as in `q_rad`, `torque(Nm)`, `speed rpm`, or is a word of it, as in
    `rpm1`; "" where it has none."""
    match = re.search(r"\(([^()]+)\)\s*$", name) or re.search(r"[_ .]([A-Za-z°%]+(?:/s|ps)?)$", name)
    text = match[1] if match else ""
    text = SHORT_UNITS.get(text.lower(), text)
    lone = len(text) == 1 and match is not None and not match[0].endswith(")") and text not in "VANm%"
    if text and not lone and is_unit(text):
        return spelled(text)
    return "rpm" if "rpm" in _words(name) else ""


def _words(name: str) -> list[str]:
    return [w.lower() for w in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]


def _role(name: str, unit: str) -> tuple[str, str]:
    words = _words(name)
    named = [ROLE_OF_WORD[w] for w in words if w in ROLE_OF_WORD]
    if "setpoint" in named and "input" not in named:
        return "setpoint", "its name says that it is a wanted value"
    if set(words) & set(LEVELS) and is_of(unit, "m"):
        return "other", "its name says that it is a level"
    if command := next((w for w in words if w in COMMANDS), ""):
        return "input", f"its name has '{command}'"
    for wanted, role in UNIT_ROLES:
        if is_of(unit, wanted):
            return role, f"its unit is {unit}"
    if "output" in named:
        return "output", "its name says that it is an output"
    if unit in COMMAND_UNITS and (not named or "input" in named):
        return "input", f"its unit is {unit}"
    if unit and unit != "1":
        return "other", f"its unit is {unit}"
    order = [r for r in WORDS if r in named]
    return (
        (order[0], f"its name has '{words[[ROLE_OF_WORD.get(w) for w in words].index(order[0])]}'")
        if (order)
        else ("", "")
    )


def is_of(unit: str, wanted: str) -> bool:
    """Whether a unit measures what `wanted` does."""
    ours = OTHERS[unit][1] if unit in OTHERS else unit
    try:
        return bool(unit) and compatible(ours, wanted)
    except (InputError, KeyError):
        return False


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
    if not any(c.role == "input" for c in found) and len(held) < sum(not c.constant for c in found):
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
    return _two(found)


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
