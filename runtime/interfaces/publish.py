"""The control process's side of the interfaces that only look: both images, once a tick.

Where Modbus is configured its port does this already (runtime/modbus/port.py), into the same cell.
"""

import time
from pathlib import Path

import numpy as np

from runtime.image import INPUT
from runtime.modbus.cells import HOLDS_IMAGE, IMAGE, IMAGE_FILE
from runtime.modbus.port import STAMP
from runtime.shared import Cell, flat


def create(folder: Path) -> Cell:
    """Make the cell in a private folder."""
    return Cell.create(folder / IMAGE_FILE, IMAGE.itemsize, HOLDS_IMAGE)


class ImagePort:
    """Publishes both images each tick; brings nothing in."""

    def __init__(self, image: Cell) -> None:
        self.image = image
        self._show(INPUT.new())
        self._outputs = np.zeros(0)
        self._sent = flat(self._outputs)

    def _show(self, inputs: np.ndarray) -> None:
        self._inputs, self._seen = inputs, flat(inputs)

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Nothing comes this way."""
        if inputs is not self._inputs:
            self._show(inputs)

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Publish what came in and what goes out in this tick."""
        if outputs is not self._outputs:
            self._outputs, self._sent = outputs, flat(outputs)
        self.image.write(STAMP.pack(time.monotonic_ns()), self._seen, self._sent)

    def flags(self) -> int:
        """None."""
        return 0

    def received_ns(self) -> int:
        """No sensor comes this way."""
        return 0
