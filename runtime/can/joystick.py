"""J1939 joysticks as the operator's input: BJM and EJM frames instead of OperatorJoystick.

An axis comes as a magnitude of 0 to 1000 (0.1 % each; 1022 error, 1023 not available) and three fields of two
bits: neutral, negative side, positive side (00 no, 01 yes, 10 error, 11 not available).  What contradicts
itself (both sides, or neutral with a magnitude) is an error.  Buttons are fields of two bits, too.  Joysticks
send every 100 ms or on a change, but not faster than every 20 ms; most send every 20 ms.
Source: SAE J1939-71, PGN 64982 (BJM1), 64983 (EJM1), 64984 (BJM2), 64985 (EJM2), SPN 2660 to 2700; ISO 15077
for the pattern of the axes.

These frames have no counter and no checksum: a stuck joystick is only seen by its timeout and its neutral
position.  The heartbeat that the runtime expects of the operator's panel is counted here, one for each frame.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from runtime.image import INPUT, TICK_S, Status, timeout_ticks
from specs.errors import InputError
from specs.schema import STRICT
from specs.signals import signal

GROUPS = {"BJM1": 64982, "EJM1": 64983, "BJM2": 64984, "EJM2": 64985}
AXES = {"x": 0, "y": 2, "theta": 4}  # first byte of an axis in its frame; theta in EJM only
BUTTONS = range(1, 13)
FULL, ERROR_COUNT, ABSENT_COUNT = 1000, 1022, 1023
NO, YES, ERROR, ABSENT = 0, 1, 2, 3  # two bits
HEARTBEATS = 251
Group = Literal["BJM1", "EJM1", "BJM2", "EJM2"]


@dataclass(frozen=True, kw_only=True)
class Axis:
    """Where an axis comes from: source address, frame and axis; `sign` -1 turns it round."""

    __pydantic_config__: ClassVar[Any] = STRICT

    source: int
    group: Group
    axis: Literal["x", "y", "theta"]
    sign: Literal[-1, 1] = 1


@dataclass(frozen=True, kw_only=True)
class Button:
    """Where a button comes from: source address, frame, and its number from 1."""

    __pydantic_config__: ClassVar[Any] = STRICT

    source: int
    group: Group
    button: int

    def __post_init__(self) -> None:
        if self.button not in BUTTONS:
            raise InputError(f"button {self.button}: {BUTTONS[0]} to {BUTTONS[-1]}")


@dataclass(frozen=True, kw_only=True)
class Joysticks:
    """Which axes and buttons are the operator's; the default is two joysticks in the ISO pattern.

    Left joystick to the right: slew to the right (clockwise, so turned round); left forward: stick out;
    right back: boom up.
    """

    __pydantic_config__: ClassVar[Any] = STRICT

    slew: Axis = Axis(source=0x85, group="BJM1", axis="x", sign=-1)
    stick: Axis = Axis(source=0x85, group="BJM1", axis="y")
    boom: Axis = Axis(source=0x86, group="BJM1", axis="y", sign=-1)
    enable: Button = Button(source=0x85, group="BJM1", button=1)
    automatic: Button = Button(source=0x86, group="BJM1", button=1)
    cycle_ms: int = 20  # longest time between two frames of a joystick

    def __post_init__(self) -> None:
        if not 20 <= self.cycle_ms <= 100:
            raise InputError(f"cycle_ms = {self.cycle_ms}: a J1939 joystick sends every 20 to 100 ms")

    @property
    def targets(self) -> dict[str, Axis | Button]:
        """By signal."""
        return {
            "joystick_slew": self.slew, "joystick_boom": self.boom, "joystick_stick": self.stick,
            "operator_enable": self.enable, "automatic_request": self.automatic,
        }  # fmt: skip


def axis_value(data: bytes, axis: str) -> tuple[float, Status]:
    """An axis of a frame, -1 to 1, and what is known of it."""
    first = AXES[axis]
    low, high = data[first], data[first + 1]
    neutral, negative, positive = low & 3, low >> 2 & 3, low >> 4 & 3
    count = low >> 6 | high << 2
    if count == ABSENT_COUNT or ABSENT in (negative, positive):
        return 0.0, Status.NOT_AVAILABLE
    if count == ERROR_COUNT or ERROR in (neutral, negative, positive):
        return 0.0, Status.ERROR
    if count > FULL:
        return 0.0, Status.RANGE
    contradicts = negative == positive == YES or (
        neutral == YES and count > 0 and YES in (negative, positive)
    )
    if contradicts or (count > 0 and YES not in (neutral, negative, positive)):
        return 0.0, Status.ERROR
    if neutral == YES or count == 0:
        return 0.0, Status.OK
    return (-1.0 if negative == YES else 1.0) * count / FULL, Status.OK


def button_value(data: bytes, button: int) -> tuple[float, Status]:
    """A button of a frame, 0 or 1, and what is known of it; four to a byte, the first in its top bits."""
    at, within = divmod(button - 1, 4)
    bits = data[5 + at] >> (6 - 2 * within) & 3
    if bits == ABSENT:
        return 0.0, Status.NOT_AVAILABLE
    return (0.0, Status.ERROR) if bits == ERROR else (float(bits), Status.OK)


class Joystick:
    """Reads the frames that `mapped` names and puts the operator's signals into the image."""

    def __init__(self, mapped: Joysticks | None = None, index: Mapping[str, int] = INPUT.index) -> None:
        mapped = mapped or Joysticks()
        self._wanted: dict[tuple[int, int], list[tuple[int, Axis | Button]]] = {}
        names = [*mapped.targets, "operator_heartbeat"]
        for name, place in mapped.targets.items():
            key = (GROUPS[place.group], place.source)
            self._wanted.setdefault(key, []).append((names.index(name), place))
        self._places = np.array([index[name] for name in names], dtype=np.intp)
        # Several frames may be missed, as with every other message; slower joysticks have the longer time.
        slower = mapped.cycle_ms / 1000 / TICK_S
        self._timeout = round(max(timeout_ticks(signal(names[0])), timeout_ticks(signal(names[0])) * slower))
        self._value = np.zeros(len(names))
        self._tick = np.full(len(names), -1)
        self._status = np.full(len(names), int(Status.NEVER))

    def take(self, frame_id: int, data: bytes, tick: int) -> bool:
        """Take a frame that came in `tick`; False if it is none of the joysticks named."""
        places = self._wanted.get((frame_id >> 8 & 0x3FFFF, frame_id & 0xFF))
        if places is None or len(data) != 8:
            return False
        for i, place in places:
            found = (
                button_value(data, place.button)
                if isinstance(place, Button)
                else axis_value(data, place.axis)
            )
            value, self._status[i] = found
            self._tick[i] = tick
            if found[1] == Status.OK:
                self._value[i] = value if isinstance(place, Button) else place.sign * value
        self._value[-1] = (self._value[-1] + 1) % HEARTBEATS
        self._tick[-1], self._status[-1] = tick, Status.OK
        return True

    def fill(self, image: np.ndarray, tick: int) -> None:
        """Put values, ages and status into the image."""
        age = np.where(self._tick < 0, -1, tick - self._tick)
        late = age >= self._timeout
        image["value"][self._places] = self._value
        image["age"][self._places] = age
        image["status"][self._places] = np.where(late, Status.TIMEOUT, self._status)
