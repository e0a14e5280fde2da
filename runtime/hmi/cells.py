"""What the control process and the HMI tell each other: the layouts of their three shared cells.

`seen.cell` goes out ten times a second: both images, what the cycles and the bus came to.  `grant.cell` goes
out when it changes: who writes targets, and which forcing is in force (the Modbus server reads it, too).
`hmi.cell` comes in: what the page that may write asks for, and what is to be forced.
"""

import struct
from enum import IntEnum
from pathlib import Path

import numpy as np

from runtime.can.codec import received_by
from runtime.image import INPUT, NODE, OUTPUT
from runtime.modbus.cells import TARGETS
from runtime.shared import Cell
from runtime.statistics import COARSE_BINS

EVERY, PHASE = 5, 3  # ticks between two states of `seen`; not in the ticks of the policy
SEEN_FILE, GRANT_FILE, HMI_FILE = "seen.cell", "grant.cell", "hmi.cell"


class Writer(IntEnum):
    """Whose targets count: one at a time, and nobody who is alive is displaced."""

    NOBODY = 0
    PLANNER = 1  # over CAN or Modbus
    HMI = 2


def _messages() -> dict[str, int]:
    """Messages that the controller hears, and the place of one of their signals in the input image."""
    found: dict[str, int] = {}
    for place, s in enumerate(INPUT.signals):
        if s.can:
            found.setdefault(s.can.message, place)
    return {c.message.name: found[c.message.name] for c in received_by(NODE)}


MESSAGES = _messages()

WORK = np.dtype(
    [
        ("ticks", "<i8"),
        ("overruns", "<i8"),
        ("stolen", "<i8"),
        ("skipped", "<i8"),
        ("unrecorded", "<i8"),
        ("late_largest_ns", "<i8"),
        ("work_largest_ns", "<i8"),
        ("late", "<i8", (COARSE_BINS,)),  # ticks by lateness: runtime.statistics.Histogram.coarse
        ("work", "<i8", (2, COARSE_BINS)),  # by the work of a cycle: with the policy, and the others
        ("heard", "<i8", (len(MESSAGES),)),  # right frames so far of each of MESSAGES
        ("refused", "<i8", (len(MESSAGES),)),  # frames with a wrong checksum or counter
        ("repeated", "<i8", (len(MESSAGES),)),  # of these, right ones that had come before
    ]
)
LADDER = np.dtype(  # what slr_ladder (runtime/core/slr.h) tells
    [
        (name, "<i8")
        for name in (
            *("known", "stops", "stops_signal", "bars", "bars_signal", "enabled", "asked", "allowed"),
            *("deflected", "target", "neutral"),
        )
    ]
)
SEEN = np.dtype(
    [
        ("stamp_ns", "<i8"),  # on the monotonic clock
        ("day_ns", "<i8"),  # time of day then
        ("writer", "<i8"),
        ("forcing", "<i8"),  # number of the forcing in force; 0: none
        ("work", WORK),
        ("ladder", LADDER),
        ("inputs", INPUT.dtype),
        ("outputs", OUTPUT.dtype),
    ]
)
SEEN_HEAD = struct.Struct("<11q")  # its plain numbers, from `stamp_ns` to `work_largest_ns`
GRANT = np.dtype(
    [
        ("writer", "<u4"),
        ("owner", "<u4"),  # number of the claim that was granted; 0: none
        ("forcing", "<u4"),
        ("force_ended", "<u4"),  # number of the last forcing that was ended or refused here
    ]
)
HMI = np.dtype(
    [
        ("targets", TARGETS),
        ("value", "<f8", (len(INPUT.signals),)),  # what is to be forced, where `forced` is not 0
        ("force_number", "<u4"),  # another one for each change; 0: nothing is to be forced
        ("forced", "u1", (len(INPUT.signals),)),
        ("pad", "u1", (-(4 + len(INPUT.signals)) % 8 or 8,)),  # to a whole number of 8 bytes
    ]
)
CELLS = ((SEEN_FILE, SEEN, "seen"), (GRANT_FILE, GRANT, "grant"), (HMI_FILE, HMI, "hmi"))


def create(folder: Path) -> tuple[Cell, Cell, Cell]:
    """Make the cells in a private folder: seen, grant, hmi."""
    seen, grant, asked = (Cell.create(folder / n, kind.itemsize, holds) for n, kind, holds in CELLS)
    grant.write(np.zeros((), GRANT))
    return seen, grant, asked


def join(folder: Path) -> tuple[Cell, Cell, Cell]:
    """Join them; raises InputError if they are of another version."""
    seen, grant, asked = (Cell.open(folder / n, kind.itemsize, holds) for n, kind, holds in CELLS)
    return seen, grant, asked


def join_grant(folder: Path) -> Cell | None:
    """Only who writes; None where no HMI is."""
    path = folder / GRANT_FILE
    return Cell.open(path, GRANT.itemsize, "grant") if path.is_file() else None


def state_of(cell: Cell, kind: np.dtype) -> np.void | None:
    """The newest state in a cell; None if there is none yet."""
    found = cell.read()
    return np.frombuffer(found[1], kind)[0] if found else None
