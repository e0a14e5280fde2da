"""Both images as an interface reads them: each signal's value, how good it is, and when it came."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.image import INPUT, OUTPUT
from runtime.modbus.cells import HOLDS_IMAGE, IMAGE, IMAGE_FILE
from runtime.modbus.port import PERIOD_NS
from runtime.modbus.showing import STALE_NS, UNKNOWN
from runtime.shared import Cell
from specs.signals import Signal

SIGNALS: tuple[Signal, ...] = (*INPUT.signals, *OUTPUT.signals)
INDEX = {s.name: i for i, s in enumerate(SIGNALS)}
INPUTS = len(INPUT.signals)


@dataclass(frozen=True)
class Seen:
    """All signals in the order of SIGNALS at one tick; times in ns of the day's clock."""

    tick: int
    time_ns: int
    value: np.ndarray
    status: np.ndarray  # Status; that of outputs tells what the controller knows
    age: np.ndarray  # ticks; -1: never came
    inputs: np.void
    outputs: np.void

    @property
    def known(self) -> np.ndarray:
        """Whether a value means something."""
        return ~np.isin(self.status, UNKNOWN)

    @property
    def values(self) -> np.ndarray:
        """Values, no number where nothing is known."""
        return np.where(self.known, self.value, np.nan)

    def of(self, name: str) -> float:
        """Value of a signal; no number where nothing is known."""
        place = INDEX[name]
        return float("nan") if self.status[place] in UNKNOWN else float(self.value[place])

    def source_ns(self, place: int) -> int:
        """When the message that brought a signal came."""
        return self.time_ns - max(int(self.age[place]), 0) * PERIOD_NS


class View:
    """The control process's images; joins the cell that it publishes them in."""

    def __init__(self, cell: Cell) -> None:
        self._cell, self._number, self._stamp = cell, -1, 0
        self.last_ns = 0  # time of day of the last images

    @classmethod
    def join(cls, folder: Path) -> "View":
        """Join the cell in a run's folder; raises InputError if it is of another version."""
        return cls(Cell.open(folder / IMAGE_FILE, IMAGE.itemsize, HOLDS_IMAGE))

    @property
    def joined(self) -> bool:
        """Whether anything was published yet."""
        return self._stamp > 0

    @property
    def stale(self) -> bool:
        """Whether the control process does not publish, or no longer."""
        return time.monotonic_ns() - self._stamp > STALE_NS

    def new(self) -> Seen | None:
        """What was published since the last call; None if nothing was."""
        if self._cell.number == self._number or not (found := self._cell.read()):
            return None
        self._number, image = found[0], np.frombuffer(found[1], IMAGE)[0]
        self._stamp = int(image["stamp_ns"])
        inputs, outputs = image["inputs"], image["outputs"]
        joined = {k: np.concatenate([inputs[k], outputs[k]]) for k in ("value", "status", "age")}
        joined["age"][INPUTS:] = 0  # outputs are this tick's
        self.last_ns = day_ns = time.time_ns() - (time.monotonic_ns() - self._stamp)
        return Seen(int(inputs["tick"]), day_ns, **joined, inputs=inputs, outputs=outputs)
