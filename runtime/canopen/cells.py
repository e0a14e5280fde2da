"""What the CANopen process and the control process tell each other, each in a cell of its own."""

from pathlib import Path

import numpy as np

from runtime.shared import Cell
from specs.canopen import definition

NODES = len(definition().nodes)
NUMBERS = np.dtype((np.int64, (NODES,)))  # of each node, in the order of the specs; 0: none
ACCEPTED_FILE, HOLDS_ACCEPTED = "canopen-accepted.cell", "canopen accepted"
SPENT_FILE, HOLDS_SPENT = "canopen-spent.cell", "canopen spent"


def create(folder: Path) -> None:
    """Make both in a private folder."""
    for file, holds in ((ACCEPTED_FILE, HOLDS_ACCEPTED), (SPENT_FILE, HOLDS_SPENT)):
        Cell.create(folder / file, NUMBERS.itemsize, holds).close()


def join(folder: Path) -> tuple[Cell, Cell]:
    """Which setting of a device is in force, as the CANopen process says; which is not any more."""
    return (
        Cell.open(folder / ACCEPTED_FILE, NUMBERS.itemsize, HOLDS_ACCEPTED),
        Cell.open(folder / SPENT_FILE, NUMBERS.itemsize, HOLDS_SPENT),
    )


def read(cell: Cell) -> list[int]:
    """A cell's numbers; zeros before the first."""
    found = cell.read()
    return np.frombuffer(found[1], np.int64).tolist() if found else [0] * NODES
