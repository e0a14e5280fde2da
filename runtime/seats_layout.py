"""What the decision who commands works with (runtime/core/seats.c, page.c), laid out once for C and Python.

Part of `runtime/core/scan_layout.h`, which `slewright generate` writes (runtime/scan_layout.py).  The ports
of the interfaces (runtime/interfaces/port.py) and of the page (runtime/hmi/port.py) keep one of these each;
the cycle, in C or in Python, gives it to the same C functions.
"""

import ctypes
from ctypes import c_double, c_int64, c_uint8, c_uint32, c_void_p

from runtime.hmi.cells import HMI, MESSAGES
from runtime.image import INPUT
from runtime.interfaces.seats import NAMES
from runtime.modbus.cells import HOLDING

N_TARGETS, N_HEARD, N_IN, N_SEATS = len(HOLDING), len(MESSAGES), len(INPUT.signals), len(NAMES)
PAD = HMI["pad"].shape[0]


class Cell(ctypes.Structure):
    """One end of a cell (runtime/shared.py)."""

    _fields_ = [("memory", c_void_p), ("size", c_int64), ("stride", c_int64)]


class Targets(ctypes.Structure):
    """A state of such a cell (runtime/modbus/cells.py: TARGETS)."""

    _fields_ = [
        ("stamp_ns", c_int64),
        ("heartbeat_ns", c_int64),
        ("commits", c_uint32),
        ("owner", c_uint32),
        ("value", c_double * N_TARGETS),
    ]


class Seat(ctypes.Structure):
    """What a client of an interface asks for; without a cell there is no such seat."""

    _fields_ = [
        ("cell", Cell),
        ("number", c_int64),  # as others are told (runtime/interfaces/seats.py)
        ("seen", c_int64),  # number of the state that was taken last
        ("ended", c_int64),  # the claim whose right ended last: over for good; 0: none
        ("asked", Targets),
    ]


class Seats(ctypes.Structure):
    """Who commands over OPC UA or ROS 2.  From `seat` on it is what is known, whoever is told."""

    _fields_ = [
        ("granted", Cell),
        ("late", c_int64),  # ticks without a sign of life from which on a claim is over
        ("seat", Seat * N_SEATS),
        ("who", c_int64),  # place of the seat that has the right, from 1 on; 0: none
        ("owner", c_int64),  # which of its claims
        ("draining", c_int64),  # targets of a claim that is over are still being followed
    ]


class Hmi(ctypes.Structure):
    """A state of such a cell (runtime/hmi/cells.py: HMI)."""

    _fields_ = [
        ("targets", Targets),
        ("value", c_double * N_IN),
        ("force_number", c_uint32),
        ("forced", c_uint8 * N_IN),
        ("pad", c_uint8 * PAD),
    ]


class Grant(ctypes.Structure):
    """A state of such a cell (runtime/hmi/cells.py: GRANT)."""

    _fields_ = [(name, c_uint32) for name in ("writer", "owner", "forcing", "force_ended")]


class Page(ctypes.Structure):
    """What the operator's page sees and asks for.  From `taken` on it is what is known, whoever is told."""

    _fields_ = [
        ("seen", Cell),
        ("grant", Cell),
        ("asked", Cell),
        ("refused", c_void_p),  # int64[2 * N_HEARD]
        ("heard", c_int64 * N_HEARD),  # place of a signal of each message
        ("late", c_int64),  # ticks without a sign of life from which on a claim is over
        ("taken", c_int64),  # number of the state of `asked` that was taken last
        ("newest", Hmi),
        ("granted", Grant),
        ("ended", c_int64),  # the claim whose right ended last
        ("draining", c_int64),  # its targets are still being followed
        ("quiet", c_int64),  # pages only look: nothing is asked for, nothing is granted
        ("next", c_int64),  # tick of the next state of `seen`
        ("frames", c_int64 * N_HEARD),  # right frames so far
    ]


def follow(mine: ctypes.Structure, other: ctypes.Structure, first: str) -> None:
    """Know what another one knows: everything from the field `first` on."""
    at = getattr(type(mine), first).offset
    ctypes.memmove(ctypes.addressof(mine) + at, ctypes.addressof(other) + at, ctypes.sizeof(mine) - at)
