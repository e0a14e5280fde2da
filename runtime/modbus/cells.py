"""What the control process and the Modbus server tell each other: the layouts of their two shared cells.

`image.cell` goes out once a tick: both images and when they were made.  `targets.cell` comes in: what the
client that may write has committed, and when its heartbeat last moved; written at least every BEAT_S, so that
a server that is gone shows.
"""

from pathlib import Path

import numpy as np

from runtime.image import INPUT, OUTPUT
from runtime.shared import Cell
from specs.signals import Signal, definition
from specs.wire import ModbusPlace

BEAT_S = 0.05  # s, between two states of targets.cell at most
IMAGE_FILE, TARGETS_FILE = "image.cell", "targets.cell"
HOLDS_IMAGE, HOLDS_TARGETS = "image", "targets"

IMAGE = np.dtype([("stamp_ns", "<i8"), ("inputs", INPUT.dtype), ("outputs", OUTPUT.dtype)])


def placed(table: str) -> list[tuple[Signal, ModbusPlace]]:
    """Signals of a register table by address."""
    found = [(s, s.modbus) for s in definition().signals.values() if s.modbus and s.modbus.table == table]
    return sorted(found, key=lambda pair: pair[1].address)


HOLDING = tuple(s for s, _ in placed("holding"))
TARGETS = np.dtype(
    [
        ("stamp_ns", "<i8"),  # of this state, on the monotonic clock
        ("heartbeat_ns", "<i8"),  # when the writer's heartbeat moved last; 0: not since it may write
        ("commits", "<u4"),  # of this writer; 0: none, and no value counts
        ("owner", "<u4"),  # another number for each that becomes the writer; 0: there is none
        ("value", "<f8", (len(HOLDING),)),  # SI, in the order of HOLDING
    ]
)


def create(folder: Path) -> tuple[Cell, Cell]:
    """Make both cells in a private folder: image, targets."""
    image = Cell.create(folder / IMAGE_FILE, IMAGE.itemsize, HOLDS_IMAGE)
    return image, Cell.create(folder / TARGETS_FILE, TARGETS.itemsize, HOLDS_TARGETS)


def join(folder: Path) -> tuple[Cell, Cell]:
    """Join them: image, targets; raises InputError if they are of another version."""
    image = Cell.open(folder / IMAGE_FILE, IMAGE.itemsize, HOLDS_IMAGE)
    return image, Cell.open(folder / TARGETS_FILE, TARGETS.itemsize, HOLDS_TARGETS)
