"""What Python sets up for the cycle in C (runtime/core/scan.c), laid out once: `runtime/core/scan_layout.h`.

There are no gaps.  Addresses are of memory that Python keeps for as long as the
cycle runs; an address of 0 means that there is no such thing.  `slewright generate` writes the header; a
library says by `token()` which layout it was compiled for.
"""

import ctypes
import hashlib
from ctypes import c_double, c_int64, c_uint8, c_uint32, c_void_p
from pathlib import Path
from typing import Any

from runtime.hmi.cells import EVERY, PHASE, Writer
from runtime.image import INPUT, OUTPUT, refreshed
from runtime.interfaces.outside import COMMANDS, PLACES as COMMANDED
from runtime.modbus.cells import HOLDING
from runtime.publisher import EVERY as PUBLISH_EVERY
from runtime.recorder import feed
from runtime.retain.process import FAILED, VALUES
from runtime.scan import PERIOD_NS, POLICY_EVERY, SHOWN_TICKS, STOLEN_NS
from runtime.seats_layout import (
    N_HEARD,
    N_SEATS,
    N_TARGETS,
    Cell,
    Grant,
    Hmi,
    Page,
    Seat,
    Seats,
    Targets,
)
from runtime.statistics import COARSE_BINS, COUNTS, TOP_US
from specs.errors import InputError

HEADER = Path(__file__).parent / "core" / "scan_layout.h"
N_OUT, N_COMMANDS = len(OUTPUT.signals), len(COMMANDS)
NO_END, LOCAL, SOCKETCAN = range(3)  # kinds of a bus's end


class Ring(ctypes.Structure):
    """One end of a queue (runtime/ring.py)."""

    _fields_ = [("words", c_void_p), ("data", c_void_p), ("capacity", c_int64)]


class Watch(ctypes.Structure):
    """Whether the process at the other end of a queue works: its last beat, and in which tick it moved."""

    _fields_ = [("beat", c_int64), ("tick", c_int64)]


class Bus(ctypes.Structure):
    """A bus and what is remembered of it beside `state`, which is SlrWire or SlrCanopen."""

    _fields_ = [
        ("kind", c_int64),
        ("descriptor", c_int64),  # of the socket
        ("state", c_void_p),
        ("came", c_void_p),  # SlrFrame[size]
        ("size", c_int64),
        ("count", c_int64),  # frames in `came`, of this tick
        ("now", c_int64),  # ns: when they were taken
        ("heads", c_void_p),  # struct mmsghdr[size], which lead into `came`
        ("told", c_void_p),  # what the kernel says of each of them beside it; 0 on a local bus
        ("empty", c_int64),  # ns: when nothing waited, as far as is known
        ("going", c_void_p),  # SlrFrame[], room for all that is due
        ("going_heads", c_void_p),
        ("unsent", c_int64),
        ("gone", c_int64),  # in this tick it could not be read
        ("alone", c_int64),  # whether nobody else may send what we send
        ("heard", c_int64),  # frames of somebody else that were ours, so far
        ("another", c_int64),  # until which tick another controller counts as there
        ("flags", c_int64),
    ]


class Devices(ctypes.Structure):
    """What the CANopen process and the cycle tell each other (runtime/canopen/cells.py)."""

    _fields_ = [("accepted", Cell), ("spent", Cell), ("seen", c_int64)]


class Planner(ctypes.Structure):
    """What is known of the planner (runtime/modbus/port.py); `present` is 0 where only the image is shown."""

    _fields_ = [
        ("present", c_int64),
        ("image", Cell),
        ("targets", Cell),
        ("late", c_int64),  # ticks of age from which on targets are lost
        ("seen", c_int64),  # number of the state of `targets` that was taken last; -1: none
        ("stamp", c_int64),
        ("heartbeat", c_int64),
        ("commits", c_int64),
        ("owner", c_int64),
        ("started", c_int64),  # ns
        ("lost", c_int64),  # the server gives no sign of life
        ("value", c_double * N_TARGETS),
    ]


class Command(ctypes.Structure):
    """A state of such a cell (runtime/interfaces/outside.py: COMMAND)."""

    _fields_ = [("made_ns", c_int64), ("owner", c_int64), ("value", c_double * N_COMMANDS)]


class Outside(ctypes.Structure):
    """What is known of the policy outside (runtime/interfaces/outside.py)."""

    _fields_ = [
        ("present", c_int64),
        ("commands", Cell),
        ("late", c_int64),  # ticks of age from which on commands are lost
        ("seen", c_int64),  # number of the state of `commands` that was taken last; -1: none
        ("made", c_int64),
        ("owner", c_int64),
        ("value", c_double * N_COMMANDS),
    ]


class Published(ctypes.Structure):
    """What is published once a second, and what is kept over a power cut (runtime/publisher.py)."""

    _fields_ = [
        ("present", c_int64),
        ("counts", Cell),
        ("retain", Ring),
        ("watch", Watch),
        ("off", c_int64),  # BUS_OFF, as it was published
        ("kept", c_int64),  # how many signals are kept
        ("places", c_int64 * N_OUT),
    ]


class Record(ctypes.Structure):
    """The recorder's queue (runtime/recorder/feed.py)."""

    _fields_ = [
        ("ring", Ring),
        ("watch", Watch),
        ("every", c_int64),  # ticks between two snapshots
        ("due", c_int64),  # tick of the next one
        ("count", c_int64),  # ticks so far
        ("day", c_int64),  # ns: time of day less CLOCK_MONOTONIC
        ("kept", c_void_p),  # room for a state of the core
        ("keeps", c_int64),  # there is one
    ]


class Counts(ctypes.Structure):
    """Of one run (runtime/statistics.py)."""

    _fields_ = [(name, c_int64) for name in COUNTS]


TIMES = ("lateness", "policy_work", "other_work", "policy_step", "step", "bus", "latency")  # of SlrScan


class Tick(ctypes.Structure):
    """When what happened, ns: CLOCK_MONOTONIC, processor time of the thread; how often it waited; `attend`:
    what Python does in it; `bus`: in the system calls of the buses."""

    _fields_ = [
        (name, c_int64)
        for name in ("number", "deadline", "woke", "cpu", "waited", "attend", "sent", "used", "bus")
    ]


class Scan(ctypes.Structure):
    """Everything that a cycle needs."""

    _fields_ = [
        ("inputs", c_void_p),
        ("outputs", c_void_p),
        ("core", c_void_p),  # SlrState
        ("waits", c_int64),  # a cycle watches the clock until its deadline
        ("attends", c_int64),  # Python takes part in every cycle
        ("granted", c_int64),  # flags of what the system refused
        ("wires", Bus),
        ("devices", Bus),
        ("setting", Devices),
        ("planner", Planner),
        ("outside", Outside),
        ("seats", c_void_p),  # SlrSeats
        ("page", c_void_p),  # SlrPageEnd
        ("published", Published),
        ("record", Record),
        ("counts", c_void_p),  # Counts
        *((name, c_void_p) for name in TIMES),  # SlrTimes
        ("stolen_until", c_int64),
        ("received", c_int64),  # ns: when the sensor message came that was used last
        ("automatic", c_int64),
        ("policy", c_int64),  # a policy computes in this tick
        ("phase", c_int64),
        ("tick", Tick),
    ]


STRUCTURES = (
    *(Cell, Ring, Watch, Bus, Devices, Targets, Planner, Command, Outside, Seat, Seats, Hmi, Grant, Page),
    *(Published, Record, Counts, Tick, Scan),
)
NUMBERS = {
    "TARGETS": N_TARGETS, "FIRST_TARGET": min(INPUT.index[s.name] for s in HOLDING), "HEARD": N_HEARD,
    "COMMANDS": N_COMMANDS, "FIRST_COMMAND": COMMANDED.start,
    "SEATS": N_SEATS, "NOBODY": int(Writer.NOBODY), "PLANNER": int(Writer.PLANNER), "PAGE": int(Writer.HMI),
    "LOCAL": LOCAL, "SOCKETCAN": SOCKETCAN, "PERIOD_NS": PERIOD_NS,
    "POLICY_EVERY": POLICY_EVERY, "STOLEN_NS": STOLEN_NS, "SHOWN_TICKS": SHOWN_TICKS,
    "DEAD_TICKS": feed.DEAD_TICKS, "DISK_FULL": feed.DISK_FULL, "TICK": feed.TICK, "SNAPSHOT": feed.SNAPSHOT,
    "PAGE_EVERY": EVERY, "PAGE_PHASE": PHASE, "PUBLISH_EVERY": PUBLISH_EVERY, "VALUES": VALUES,
    "SAVE_FAILED": FAILED, "TIMES_TOP": TOP_US, "TIMES_COARSE": COARSE_BINS,
}  # fmt: skip


def token() -> str:
    """16 hex digits over everything that library and caller must agree on."""
    return hashlib.sha256(_body().encode()).hexdigest()[:16]


def header() -> str:
    """`scan_layout.h`."""
    return (
        "/* Generated from runtime/scan_layout.py by slewright generate; do not edit. */\n"
        "#ifndef SLR_SCAN_LAYOUT_H\n#define SLR_SCAN_LAYOUT_H\n\n#include <stdint.h>\n\n"
        f'#define SLR_SCAN_LAYOUT "{token()}"\n{_body()}\n#endif\n'
    )


def write(check: bool = False, path: Path = HEADER) -> list[Path]:
    """Write the header if it is out of date (`check`: only say so); the paths that were."""
    return refreshed(path, header(), check)


def check(library: ctypes.CDLL, part: str = "scan", *kinds: type[ctypes.Structure]) -> None:
    """Raise InputError if a bundle's library was compiled for another cycle.

    `part`: "scan", which is there on Linux only, or "seats"; `kinds`: structures whose sizes it adds up.
    """
    if not hasattr(library, f"slr_{part}_layout"):
        raise InputError("the bundle's core knows no cycle: of an older version? Build it again")
    layout, size = (getattr(library, f"slr_{part}_{name}") for name in ("layout", "size"))
    layout.restype, size.restype = ctypes.c_char_p, ctypes.c_size_t
    found = layout().decode(), size()
    if found != (token(), sum(ctypes.sizeof(kind) for kind in kinds or (Scan,))):
        raise InputError(f"the bundle's core knows cycle {found[0]}, not {token()}; build it again")


def _body() -> str:
    parts = [f"#define SLR_SCAN_{name} {number}" for name, number in NUMBERS.items()]
    return "\n".join([*parts, *map(_struct, STRUCTURES)])


def _struct(of: type[ctypes.Structure]) -> str:
    fields: list[tuple[str, Any]] = list(of._fields_)  # type: ignore[arg-type]
    lines = [f"  {_declared(name, kind)};" for name, kind in fields]
    return "typedef struct {\n" + "\n".join(lines) + f"\n}} {_name(of)};"


def _declared(name: str, kind: Any) -> str:
    if issubclass(kind, ctypes.Array):
        return f"{_name(kind._type_)} {name}[{kind._length_}]"
    return f"void *{name}" if kind is c_void_p else f"{_name(kind)} {name}"


def _name(kind: Any) -> str:
    plain = {c_int64: "int64_t", c_uint32: "uint32_t", c_uint8: "uint8_t", c_double: "double"}
    return plain.get(kind) or f"Slr{_C_NAMES.get(kind, kind.__name__)}"


# Names that C has for something else already, or that say too little there.
_C_NAMES = {
    Bus: "BusEnd", Ring: "RingEnd", Cell: "CellEnd", Page: "PageEnd", Tick: "ScanTick", Counts: "ScanCounts",
}  # fmt: skip
