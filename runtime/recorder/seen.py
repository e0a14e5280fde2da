"""What a recording in shadow mode holds beside its ticks: `/operator`, what the real operator did.

`seen_NAME` as it came, with age and status: joystick and switches, which the core was not shown
(runtime/shadow.py), and the valve commands that somebody else sent on the bus, where there were any.  `tick`
is that of `/tick`.
"""

from functools import cache

import numpy as np

from runtime.image import Status
from runtime.recorder.message import DOUBLE, FIXED32, SFIXED32, SFIXED64, Field, Places
from specs.signals import signal

SEEN = 3  # kind of its entries in the recorder's queue
SEEN_TOPIC = "/operator"
SHADOWED = "shadow"  # `mode` in the metadata of such a recording
SHADOW = ", in shadow: nothing is commanded"  # said wherever its commands are shown
JOYSTICK = ("joystick_slew", "joystick_boom", "joystick_stick")
SWITCHES = ("operator_enable", "automatic_request", "automatic_allowed")
VALVES = ("u_slew", "u_boom", "u_stick", "control_enable")
NAMES = (*JOYSTICK, *SWITCHES, *VALVES)
PREFIX = "seen_"
_N = len(NAMES)
DTYPE = np.dtype(
    [("tick", "<i8"), ("value", "<f8", (_N,)), ("age", "<i4", (_N,)), ("status", "u1", (_N,)),
     ("pad", "u1", (-5 * _N % 8,))]
)  # fmt: skip


def new() -> np.ndarray:
    """An entry (structured array without dimensions): nothing seen yet."""
    entry = np.zeros((), DTYPE)
    entry["age"], entry["status"] = -1, Status.NEVER
    return entry


def fields() -> tuple[Field, ...]:
    """Fields of `slewright.Operator`, numbered as those of `slewright.Tick`."""
    at = {name: place[1] for name, place in (DTYPE.fields or {}).items()}
    found = [Field("tick", 1, SFIXED64, 0, 8)]
    for i, name in enumerate(NAMES):
        s = signal(name)
        found += [
            Field(PREFIX + name, 10 * s.vr, DOUBLE, at["value"] + 8 * i, 8, s.unit),
            Field(f"{PREFIX}{name}_age", 10 * s.vr + 1, SFIXED32, at["age"] + 4 * i, 4),
            Field(f"{PREFIX}{name}_status", 10 * s.vr + 2, FIXED32, at["status"] + i, 1),
        ]
    return tuple(sorted(found, key=lambda f: f.number))


@cache
def places() -> Places:
    """Where an entry's bytes are in its message."""
    return Places(fields(), DTYPE.itemsize)


def units() -> dict[str, str]:
    """`unit:NAME` -> unit, as our converter reads it."""
    return {f"unit:{f.name}": f.unit for f in fields() if f.unit}
