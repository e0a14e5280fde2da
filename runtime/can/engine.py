"""The engine's speed as its own control unit sends it: EEC1 of J1939 instead of the machine's slow message.

Source: SAE J1939-71, PGN 61444 (EEC1), SPN 190: bytes 4 and 5, 0.125 rpm for each count from 0; the highest
numbers are not values (specs/wire.py).  It has neither counter nor checksum: an engine that has gone is only
seen by the signal's timeout.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

import numpy as np

from runtime.can.codec import Field
from runtime.image import INPUT, Status, timeout_ticks
from specs.errors import InputError
from specs.schema import STRICT
from specs.signals import signal
from specs.wire import CanPlace

GROUP = 61444
SPEED = signal("engine_speed")
FIELD = Field(SPEED, CanPlace(message="EEC1", start=24, length=16, scale=0.125 * pi / 30.0))


@dataclass(frozen=True, kw_only=True)
class Engine:
    """Source address of the engine's control unit; J1939 gives 0 to the first engine, 1 to the second."""

    __pydantic_config__: ClassVar[Any] = STRICT

    source: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.source <= 0xFD:
            raise InputError(f"source = {self.source}: J1939 addresses are 0 to 253")


class EngineSpeed:
    """Reads the engine's frames and puts its speed into the image."""

    def __init__(self, engine: Engine | None = None, index: Mapping[str, int] = INPUT.index) -> None:
        self._source, self._place = (engine or Engine()).source, index[SPEED.name]
        self._timeout = timeout_ticks(SPEED)
        self._value, self._tick, self._status = 0.0, -1, Status.NEVER

    def take(self, frame_id: int, data: bytes, tick: int) -> bool:
        """Take a frame that came in `tick`; False if it is not the engine's."""
        if (frame_id >> 8 & 0x3FFFF, frame_id & 0xFF) != (GROUP, self._source) or len(data) != 8:
            return False
        value, self._status = FIELD.value(int.from_bytes(data[3:5], "little"))
        self._value = value if self._status == Status.OK else self._value
        self._tick = tick
        return True

    def fill(self, image: np.ndarray, tick: int) -> None:
        """Put value, age and status into the image."""
        age = -1 if self._tick < 0 else tick - self._tick
        image["value"][self._place] = self._value
        image["age"][self._place] = age
        image["status"][self._place] = Status.TIMEOUT if age >= self._timeout else self._status
