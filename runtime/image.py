"""The process image: what the control core reads and writes each tick, laid out once for C and Python.

Input image: every signal that a CAN message brings the controller, the planner's targets among them (the same
targets come by Modbus).  Output image: every signal that the controller sends.  Both are flat structs:

    tick      int64      the tick of 20 ms that the image belongs to
    overruns  int32      input: cycles of our own that ended too late so far; output: 0
    flags     uint32     input: `Flag` bits that the runtime knows of itself; output: those that are shown
    value     double[N]  SI units, as specs/signals.toml says
    age       int32[N]   ticks since the value's message came; -1: never
    status    uint8[N]   `Status`
    pad       uint8[]    zeros, to a whole number of 8 bytes: two equal images are equal bytes

`slewright generate` writes `runtime/core/image_layout.h` from here.  A core says by `token()` which layout it
was compiled with, and is refused with any other.
"""

import hashlib
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from specs.errors import InputError, nearest
from specs.signals import Signal, definition, signal

HEADER = Path(__file__).parent / "core" / "image_layout.h"
TICK_S = 0.02  # s, period of the base task (specs: 50 Hz)
NODE = "Controller"


class Status(IntEnum):
    """What is known of an input's value."""

    OK = 0
    NEVER = 1  # no message yet
    TIMEOUT = 2  # older than its timeout_s
    ERROR = 3  # the sender says error (J1939 0xFE..)
    NOT_AVAILABLE = 4  # the sender says not available (J1939 0xFF..)
    CHECKSUM = 5  # checksum or counter wrong
    RANGE = 6  # outside its range, or no number
    STUCK = 7  # has not moved for longer than noise allows
    FORCED = 8  # set by a service engineer; counts in STANDBY only, and not for what decides who may move
    TWO_SENDERS = 9  # more than one node sends its message


class Flag(IntFlag):
    """What the controller's computer lacks: the bits of `runtime_flags`."""

    NO_REALTIME = 1
    NO_LOCK = 2
    STOLEN_TIME = 4
    BUS_PASSIVE = 8
    BUS_OFF = 16
    RECORDER_LOST = 32
    MODBUS_LOST = 64
    RETAIN_LOST = 128
    DISK_FULL = 256
    GATE_LIMITED = 512
    POLICY_LATE = 1024
    FORCED = 2048  # not the computer's: some input is forced
    OTHER_CONTROLLER = 4096  # somebody else sends what only this controller may
    GUARDED = 8192  # not the computer's: the guard changed a controller's command


class Group(IntEnum):
    """Whom an input comes from: what its loss means for the state machine."""

    PLANNER = 0
    OPERATOR = 1
    MACHINE = 2  # readiness, emergency stop, faults
    SENSOR = 3
    INFORMATION = 4  # shown and recorded; nothing depends on it
    OWN = 5  # outputs
    POLICY = 6  # a policy outside: counts where the bundle needs it


@dataclass(frozen=True)
class Layout:
    """One image: `side` in C is SlrInput or SlrOutput; signals in the order of specs/signals.toml."""

    side: Literal["Input", "Output"]
    signals: tuple[Signal, ...]

    @cached_property
    def index(self) -> dict[str, int]:
        """Position of a signal in the arrays, by name."""
        return {s.name: i for i, s in enumerate(self.signals)}

    @cached_property
    def pad(self) -> int:
        """Bytes at the end, to a whole number of 8."""
        return -5 * len(self.signals) % 8 or 8

    @cached_property
    def dtype(self) -> np.dtype:
        """The C layout; sizes and offsets are checked against a core when it is loaded."""
        n = len(self.signals)
        fields = [("tick", "<i8"), ("overruns", "<i4"), ("flags", "<u4"), ("value", "<f8", (n,))]
        fields += [("age", "<i4", (n,)), ("status", "u1", (n,)), ("pad", "u1", (self.pad,))]
        return np.dtype(fields)

    def new(self) -> np.ndarray:
        """An image (structured array without dimensions): start values, nothing received yet."""
        image = np.zeros((), self.dtype)
        image["value"] = [s.start for s in self.signals]
        if self.side == "Input":
            image["age"], image["status"] = -1, Status.NEVER
        return image

    def at(self, name: str) -> int:
        """Position of signal `name`; raises InputError with the nearest names."""
        if name not in self.index:
            raise InputError(f"no {self.side.lower()} signal '{name}'; {nearest(name, self.index)}")
        return self.index[name]


class Address:
    """Where an image lies in memory, asked for once while it is the same: that takes longer than a step.

    ValueError for an array that is no image of the layout, for C would read past its end.
    """

    def __init__(self, layout: Layout) -> None:
        self._layout, self._at = layout, 0
        self._image: np.ndarray | None = None

    def __call__(self, image: np.ndarray) -> int:
        """The address of `image`."""
        if image is not self._image:
            if image.nbytes != self._layout.dtype.itemsize:
                side = self._layout.side.lower()
                raise ValueError(f"an array of {image.nbytes} bytes is no {side} image")
            self._image, self._at = image, image.ctypes.data
        return self._at


def _layout(side: Literal["Input", "Output"]) -> Layout:
    messages = definition().bus.messages
    ours = {n for n, m in messages.items() if (m.sender == NODE if side == "Output" else NODE in m.receivers)}
    return Layout(side, tuple(s for s in definition().signals.values() if s.can and s.can.message in ours))


INPUT = _layout("Input")
OUTPUT = _layout("Output")


def token() -> str:
    """16 hex digits over everything that a core and its caller must agree on."""
    return hashlib.sha256(definitions().encode()).hexdigest()[:16]


def group(s: Signal) -> Group:
    """Whom the signal comes from, by the message that brings it."""
    if s.can is None:
        return Group.OWN
    message = definition().bus.messages[s.can.message]
    if s.kind == "status" and message.sender != NODE:
        return Group.MACHINE if message.name == "MachineStatus" else Group.INFORMATION
    known = {NODE: Group.OWN, "Planner": Group.PLANNER, "Operator": Group.OPERATOR, "Policy": Group.POLICY}
    return known.get(message.sender, Group.SENSOR)


def forceable(s: Signal) -> bool:
    """Whether an input may be forced: not what decides who may move (switches, readiness, targets)."""
    return group(s) in (Group.SENSOR, Group.INFORMATION)


def timeout_ticks(s: Signal) -> int:
    """Ticks of age at which a signal counts as lost."""
    return round((s.timeout_s or 0.0) / TICK_S)


def header() -> str:
    """`image_layout.h`."""
    return (
        "/* Generated from specs/signals.toml by slewright generate; do not edit. */\n"
        "#ifndef SLR_IMAGE_LAYOUT_H\n#define SLR_IMAGE_LAYOUT_H\n\n#include <stdint.h>\n\n"
        f'#define SLR_LAYOUT "{token()}"\n{definitions()}\n#endif\n'
    )


def write(check: bool = False, path: Path = HEADER) -> list[Path]:
    """Write the header if it is out of date (`check`: only say so); the paths that were."""
    return refreshed(path, header(), check)


def refreshed(path: Path, text: str, check: bool) -> list[Path]:
    """Write a generated file if it does not say `text` (`check`: only say so); the paths that did not."""
    if path.is_file() and path.read_text() == text:
        return []
    if not check:
        path.write_text(text)
    return [path]


def definitions(inputs: Layout | None = None, outputs: Layout | None = None) -> str:
    """The C definitions of both images; of other signals for a node that is not the controller."""
    parts = [f"#define SLR_TICK_S {TICK_S!r}"]
    parts += [_enumeration("Status", Status), _enumeration("Flag", Flag), _enumeration("Group", Group)]
    parts += [_values("Mode", "control_mode"), _values("Fault", "fault_code")]
    for layout in (inputs or INPUT, outputs or OUTPUT):
        parts += [_indices(layout), _struct(layout), _limits(layout)]
    return "\n".join(parts)


def _enumeration(name: str, members: type[IntEnum] | type[IntFlag]) -> str:
    entries = ", ".join(f"SLR_{name.upper()}_{m.name} = {m.value}" for m in members)
    return f"typedef enum {{ {entries} }} Slr{name};"


def _values(name: str, of: str) -> str:
    entries = ", ".join(f"SLR_{name.upper()}_{text.upper()} = {n}" for n, text in signal(of).values.items())
    return f"typedef enum {{ {entries} }} Slr{name};"


def _indices(layout: Layout) -> str:
    kind = {"Input": "IN", "Output": "OUT"}[layout.side]
    lines = [f"  SLR_{kind}_{s.name} = {i}," for i, s in enumerate(layout.signals)]
    return "enum {\n" + "\n".join(lines) + f"\n  SLR_{kind}_COUNT = {len(layout.signals)}\n}};"


def _struct(layout: Layout) -> str:
    n = len(layout.signals)
    return (
        f"typedef struct {{\n  int64_t tick;\n  int32_t overruns;\n  uint32_t flags;\n  double value[{n}];\n"
        f"  int32_t age[{n}];\n  uint8_t status[{n}];\n  uint8_t pad[{layout.pad}];\n}} Slr{layout.side};"
    )


def _limits(layout: Layout) -> str:
    """A macro with one entry a signal: value reference, group, range, timeout in ticks, start."""
    rows = [
        f"  X({s.name}, {s.vr}, SLR_GROUP_{group(s).name}, {_real(s.min)}, {_real(s.max)}, "
        f"{timeout_ticks(s)}, {_real(s.start)})"
        for s in layout.signals
    ]
    return f"#define SLR_{layout.side.upper()}_SIGNALS(X) \\\n" + " \\\n".join(rows)


def _real(value: float | None) -> str:
    return repr(float(value or 0.0))
