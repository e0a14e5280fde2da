"""The C headers of both ends of the bus, from specs: the peer's images and frames, places of signals."""

from collections.abc import Sequence

from deployment.hil.machine_node import COMMAND_TIMEOUT, NODES, SLOW_HEARTBEATS
from deployment.hil.panel import CALM, HEARTBEATS
from fmus.definition import Variable, from_signals
from runtime import image
from runtime.can import table
from runtime.can.codec import received_by
from runtime.can.transmit import turns
from runtime.image import INPUT, OUTPUT, Group, Layout, group

PLANNER = "Planner"
TARGETS = ("target_x", "target_y", "target_z", "load_told", "pace")
COMMANDS = ("u_slew", "u_boom", "u_stick")
SHOWN = (*COMMANDS, "qd_boom_ref", "qd_stick_ref", "control_mode", "fault_code", "target_reached")
ENABLE_BEAT, REQUEST_BEAT = 6, 10  # when the operator does what; by then every slow message has come
SLOW_BEATS = 5  # ticks between counts of a slow heartbeat


def inputs() -> tuple[Variable, ...]:
    """What goes to the controller: targets and sensors."""
    return from_signals(*TARGETS, *(s.name for s in INPUT.signals if group(s) is Group.SENSOR))


def outputs() -> tuple[Variable, ...]:
    """What comes of it."""
    return from_signals(*SHOWN)


def peer_headers() -> dict[str, str]:
    """image_layout.h, wire_layout.h and slr.h of everybody but the controller, who sends what it reads."""
    read = [c for c in received_by("Machine") if c.message.sender == image.NODE]
    sent = sorted(
        (
            turn
            for node in (*NODES, PLANNER)
            for turn in turns(node)
            if _is_for_the_controller(turn.codec.message)
        ),
        key=lambda turn: turn.codec.message.frame_id,
    )
    sides = Layout("Input", OUTPUT.signals), Layout("Output", INPUT.signals)
    return {
        "image_layout.h": _guarded("PEER_IMAGE_H", image.definitions(*sides)),
        "wire_layout.h": _guarded(
            "PEER_WIRE_H", '#define SLR_WIRE_LAYOUT ""\n' + table.definitions_of(read, sent, *sides)
        ),
        "slr.h": _guarded(
            "PEER_SLR_H", '#include <stddef.h>\n#include "image_layout.h"\n#define SLR_EXPORT\n'
        ),
    }


def _is_for_the_controller(message: object) -> bool:
    return image.NODE in message.receivers  # type: ignore[attr-defined]


def ends_config() -> str:
    """ends_config.h: plain signals and their places in images and variables, and everybody's calm values."""
    beats = {**HEARTBEATS, **dict.fromkeys(SLOW_HEARTBEATS, SLOW_BEATS)}
    calm = {**CALM, "target_valid": 1.0}
    lines = [
        f"#define ENDS_INPUTS {_places(inputs(), 'IN')}",
        f"#define ENDS_OUTPUTS {_places(outputs(), 'OUT')}",
        "#define ENDS_COMMANDS {" + ", ".join(f"SLR_OUT_{name}" for name in COMMANDS) + "}",
        "#define ENDS_CALM(X) " + " ".join(f"X({name}, {value!r})" for name, value in calm.items()),
        "#define ENDS_BEATS(X) " + " ".join(f"X({name}, {every})" for name, every in beats.items()),
        f"#define ENDS_COMMAND_TIMEOUT {float(COMMAND_TIMEOUT)!r}",
        f"enum {{ ENDS_ENABLE_BEAT = {ENABLE_BEAT}, ENDS_REQUEST_BEAT = {REQUEST_BEAT} }};",
        f"#define ENDS_PERIOD_NS INT64_C({table.PERIOD_NS})",
    ]
    return _guarded("ENDS_CONFIG_H", "\n".join(lines))


def _places(variables: Sequence[Variable], side: str) -> str:
    return "{" + ", ".join(f"{{NW_{v.name}, SLR_{side}_{v.name}}}" for v in variables) + "}"


def _guarded(name: str, text: str) -> str:
    return f"#ifndef {name}\n#define {name}\n\n#include <stdint.h>\n\n{text}\n#endif\n"
