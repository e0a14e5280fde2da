"""Who commands is decided in C (runtime/core/seats.c, page.c); here a cycle in Python calls that."""

import ctypes
from typing import Any

import numpy as np

from runtime import scan_layout
from runtime.image import INPUT, OUTPUT, Address
from runtime.seats_layout import Page, Seats

MODE = OUTPUT.index["control_mode"]


class Decision:
    """A function NAME_receive of a bundle's library, which works on a structure `state` of a port."""

    def __init__(self, library: ctypes.CDLL, name: str, state: ctypes.Structure) -> None:
        """Raises InputError for a library that was compiled for another cycle."""
        scan_layout.check(library, "seats", Seats, Page)
        prepare, self._call = library.slr_seats_prepare, getattr(library, f"{name}_receive")
        prepare.argtypes, prepare.restype = [], None
        self._call.argtypes = [*[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 3]
        self._call.restype = None
        prepare()
        self.at, self.place = ctypes.addressof(state), Address(INPUT)

    def __call__(self, inputs: np.ndarray, outputs: Any, now: int, others: bool) -> None:
        """Decide at `now` [ns]; `outputs` of the last tick; `others`: somebody else commands."""
        self._call(self.at, self.place(inputs), now, int(outputs["value"][MODE]), others)
