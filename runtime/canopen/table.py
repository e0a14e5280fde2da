"""The CANopen devices as C tables: `runtime/core/canopen_layout.h`, generated from specs/canopen.toml.

A core says by `token()` which devices it was compiled for.
"""

import hashlib
import math
from pathlib import Path

from runtime.image import INPUT, OUTPUT, TICK_S, Layout, refreshed
from specs import canopen
from specs.canopen import Node, Place

HEADER = Path(__file__).parents[1] / "core" / "canopen_layout.h"
READY = "machine_ready"  # what a machine without one of its valves is not
TIMED_BY = "q_slew"  # the sensor whose arrival end-to-end latency is counted from


def token() -> str:
    """16 hex digits over everything that the C code knows of the devices."""
    return hashlib.sha256(_body().encode()).hexdigest()[:16]


def header() -> str:
    """`canopen_layout.h`."""
    return (
        "/* Generated from specs/canopen.toml by slewright generate; do not edit. */\n"
        "#ifndef SLR_CANOPEN_LAYOUT_H\n#define SLR_CANOPEN_LAYOUT_H\n\n"
        f'#define SLR_CANOPEN_LAYOUT "{token()}"\n{_body()}\n#endif\n'
    )


def write(check: bool = False, path: Path = HEADER) -> list[Path]:
    """Write the header if it is out of date (`check`: only say so); the paths that were."""
    return refreshed(path, header(), check)


def _body() -> str:
    found = canopen.definition()
    lost = math.ceil(found.bus.lost_ms / 1000 / TICK_S)
    parts = [f"#define SLR_CANOPEN_NODES {len(found.nodes)}", f"#define SLR_CANOPEN_LOST {lost} /* ticks */"]
    parts += [f"#define SLR_CANOPEN_SYNC {found.bus.sync:#x}"]
    parts += [f"#define SLR_CANOPEN_READY {INPUT.at(READY)} /* {READY} */"]
    parts += [f"#define SLR_CANOPEN_TIMED_BY {INPUT.at(TIMED_BY)} /* {TIMED_BY} */"]
    rows = [f"  X({n.name}, {n.id}, {int(n.is_actuator)})" for n in found.nodes]
    parts += ["/* name, id, whether it takes commands */", _macro("NODE_TABLE", rows)]
    parts += _tables("IN", [(i, n, n.sends) for i, n in enumerate(found.nodes)], canopen.TPDO1, INPUT)
    parts += _tables("OUT", [(i, n, n.takes) for i, n in enumerate(found.nodes)], canopen.RPDO1, OUTPUT)
    return "\n".join(parts)


def _tables(side: str, pdos: list[tuple[int, Node, tuple[Place, ...]]], base: int, of: Layout) -> list[str]:
    """X(node, identifier, bytes, first field, fields) and X(name, place, first bit, bits, sign, zero, scale,
    low, high, whether the device takes the sensor's zero off)."""
    rows, fields = [], []
    for number, node, places in pdos:
        if places:
            size = sum(p.entry.bits for p in places) // 8
            rows.append(f"  X({number}, {base + node.id:#x}, {size}, {len(fields)}, {len(places)})")
            fields += [_field(node, p, of) for p in places]
    counts = [
        f"#define SLR_CANOPEN_{side}_PDOS {len(rows)}",
        f"#define SLR_CANOPEN_{side}_FIELDS {len(fields)}",
    ]
    return [*counts, _macro(f"{side}_PDO_TABLE", rows), _macro(f"{side}_FIELD_TABLE", fields)]


def _field(node: Node, place: Place, of: Layout) -> str:
    e, (low, high) = place.entry, place.limits
    taken_off = int(f"{canopen.ZERO_OF}{place.signal.name}" in node.write.values())
    return (
        f"  X({place.signal.name}, {of.at(place.signal.name)}, {place.start}, {e.bits}, {int(e.signed)}, "
        f"INT64_C({e.zero}), {e.scale!r}, {low!r}, {high!r}, {taken_off})"
    )


def _macro(name: str, rows: list[str]) -> str:
    return f"#define SLR_CANOPEN_{name}(X) \\\n" + " \\\n".join(rows)
