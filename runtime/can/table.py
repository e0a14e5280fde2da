"""The frames that the control process reads and sends as C tables: `runtime/core/wire_layout.h`, generated.

The C code (`runtime/core/wire.c`) and the Python one (`codec`, `receive`, `transmit`) work by the same
numbers: those of `codec.Field` and `codec.Codec`.  A core says by `token()` which frames it was compiled for.
"""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from runtime.can import wire
from runtime.can.codec import Codec, Field, received_by
from runtime.can.receive import COUNTS, DOUBT, MOST_DOUBT, SPARE, TWO_SENDERS
from runtime.can.transmit import Turn, turns
from runtime.image import INPUT, NODE, OUTPUT, TICK_S, Layout, refreshed
from specs.e2e import LAST_COUNT, TABLE

HEADER = Path(__file__).parents[1] / "core" / "wire_layout.h"
TIMED_BY = "SlewPosition"  # the sensor message whose arrival end-to-end latency is counted from
PERIOD_NS = round(1e9 * TICK_S)
NUMBERS = {
    "EXTENDED": wire.EXTENDED, "REMOTE": wire.REMOTE, "ERROR": wire.ERROR,
    "IDENTIFIER": wire.IDENTIFIER, "BUS_OFF": wire.BUS_OFF,
    "RESTARTED": wire.RESTARTED, "CONTROLLER": wire.CONTROLLER, "RX_OVERFLOW": wire.RX_OVERFLOW,
    "ACTIVE": wire.ACTIVE, "PASSIVE": wire.RX_PASSIVE | wire.TX_PASSIVE, "COUNTS": COUNTS, "SPARE": SPARE,
    "LAST_COUNT": LAST_COUNT, "PERIOD_NS": PERIOD_NS, "DOUBT": DOUBT, "MOST_DOUBT": MOST_DOUBT,
    "TWO_SENDERS": TWO_SENDERS,
}  # fmt: skip


def token() -> str:
    """16 hex digits over everything that the C code knows of the frames."""
    return hashlib.sha256(definitions().encode()).hexdigest()[:16]


def header() -> str:
    """`wire_layout.h`."""
    return (
        "/* Generated from specs/signals.toml by slewright generate; do not edit. */\n"
        "#ifndef SLR_WIRE_LAYOUT_H\n#define SLR_WIRE_LAYOUT_H\n\n"
        f'#define SLR_WIRE_LAYOUT "{token()}"\n{definitions()}\n#endif\n'
    )


def write(check: bool = False, path: Path = HEADER) -> list[Path]:
    """Write the header if it is out of date (`check`: only say so); the paths that were."""
    return refreshed(path, header(), check)


def number_in(name: str) -> int:
    """Which of the messages read a message is; -1: none."""
    return next((i for i, c in enumerate(received_by(NODE)) if c.message.name == name), -1)


def definitions() -> str:
    """The C definitions of the controller's frames."""
    return definitions_of(received_by(NODE), turns(NODE), INPUT, OUTPUT)


def definitions_of(read: Sequence[Codec], sent: Sequence[Turn], inputs: Layout, outputs: Layout) -> str:
    """Those of the frames that some node reads and sends, with their signals' places in its images."""
    parts = [f"#define SLR_WIRE_{name} {number:#x}" for name, number in NUMBERS.items()]
    timed_by = next((i for i, c in enumerate(read) if c.message.name == TIMED_BY), -1)
    parts += [f"#define SLR_WIRE_TIMED_BY {timed_by} /* {TIMED_BY} */"]
    parts += [f"#define SLR_WIRE_CRC {{{', '.join(map(str, TABLE))}}}"]
    parts += _tables("IN", read, [(c.cycle_ticks, 0) for c in read], inputs)
    parts += _tables("OUT", [turn[0] for turn in sent], [turn[1:] for turn in sent], outputs)
    return "\n".join(parts)


def _tables(side: str, messages: Sequence[Codec], times: Sequence[tuple[int, int]], of: Layout) -> list[str]:
    """Macros X(name, identifier, bytes, CRC of the data ID, cycle, phase, first field, fields) and
    X(name, place, first bit, bits, scale, offset, low, high, largest, error, absent)."""
    rows, fields = [], []
    for codec, (every, phase) in zip(messages, times, strict=True):
        m = codec.message
        rows.append(
            f"  X({m.name}, {m.frame_id:#x}u, {m.length}, {codec.begun}, {every}, {phase}, {len(fields)}, "
            f"{len(codec.fields)})"
        )
        fields += [_field(f, of) for f in codec.fields]
    counts = [
        f"#define SLR_WIRE_{side}_MESSAGES {len(rows)}",
        f"#define SLR_WIRE_{side}_FIELDS {len(fields)}",
    ]
    return [
        *counts,
        f"#define SLR_WIRE_{side}_MESSAGE_TABLE(X) \\\n" + " \\\n".join(rows),
        f"#define SLR_WIRE_{side}_FIELD_TABLE(X) \\\n" + " \\\n".join(fields),
    ]


def _field(f: Field, of: Layout) -> str:
    p, (low, high) = f.place, f.limits
    return (
        f"  X({f.name}, {of.index[f.name]}, {p.start}, {p.length}, {float(p.scale)!r}, {float(p.offset)!r}, "
        f"{low!r}, {high!r}, {f.largest:#x}u, {f.error:#x}u, {f.absent:#x}u)"
    )
