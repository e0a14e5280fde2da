"""The control process's ports that an interface with a right to command is tested with."""

from pathlib import Path

import numpy as np

from runtime.image import INPUT, Status
from runtime.interfaces import seats
from runtime.interfaces.port import Asked, SeatsPort
from runtime.interfaces.publish import ImagePort, create
from runtime.shared import Cell
from tests.runtime.bundles import core


class Both:
    """Seats, of which one is of the interface `name`, and images."""

    def __init__(self, folder: Path, name: str) -> None:
        seats.create(folder, (name,))
        granted = seats.join_granted(folder)
        assert granted
        self.granted: Cell = granted
        asked = Asked(seats.NAMES.index(name) + 1, seats.join(folder, name))
        self.seats = SeatsPort([asked], granted, core("pd").library)
        self.images = ImagePort(create(folder))

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        places = [INPUT.at(s.name) for s in seats.HOLDING]
        inputs["status"][places], inputs["age"][places] = Status.NEVER, -1  # no planner over CAN
        self.seats.receive(inputs, tick)
        self.images.receive(inputs, tick)

    def send(self, outputs: np.ndarray, tick: int) -> None:
        self.seats.send(outputs, tick)
        self.images.send(outputs, tick)
