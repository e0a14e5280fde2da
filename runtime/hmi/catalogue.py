"""What a page is told once: signals and their units, texts of modes and states, the machine's shape."""

from functools import cache
from math import pi
from typing import Any

from runtime.hmi.cells import MESSAGES, Writer
from runtime.image import INPUT, NODE, OUTPUT, TICK_S, Flag, Status, forceable, group
from specs import parameters
from specs.signals import Signal, definition, signal
from specs.version import VERSION
from specs.wire import frame_bits

DISPLAY = {  # SI unit -> what operators read: unit, factor, offset
    "1": ("", 1.0, 0.0),
    "rad": ("°", 180 / pi, 0.0),
    "rad/s": ("°/s", 180 / pi, 0.0),
    "Pa": ("bar", 1e-5, 0.0),
    "K": ("°C", 1.0, -273.15),
    "m/s2": ("m/s²", 1.0, 0.0),
}
SHAPE = (  # of specs/parameters/geometry.toml
    *("carriage_length", "carriage_width", "carriage_height", "carriage_x"),
    *("cabin_length", "cabin_width", "cabin_height", "cabin_x", "cabin_y"),
    *("boom_length", "stick_length", "boom_foot_x", "boom_foot_z", "tool_length"),
    *("boom_min", "boom_max", "stick_min", "stick_max", "keepout_height", "keepout_radius"),
)
TARGETS = ("target_x", "target_y", "target_z", "pace", "load_told")


@cache
def catalogue() -> dict[str, Any]:
    """Plain data for JSON; frames (runtime/hmi/frames.py) follow the order of `signals`."""
    bus = definition().bus
    geometry = parameters.load("geometry")
    return {
        "version": VERSION,
        "signals": [
            *(_shown(s, "input") for s in INPUT.signals),
            *(_shown(s, "output") for s in OUTPUT.signals),
        ],
        "inputs": len(INPUT.signals),
        "modes": signal("control_mode").values,
        "statuses": {s.value: s.name.lower().replace("_", " ") for s in Status},
        "flags": {f.value: (f.name or "").lower().replace("_", " ") for f in Flag},
        "writers": {w.value: w.name.lower() for w in Writer},
        "messages": [_message(name) for name in MESSAGES],
        "sent_bits_per_s": _sent_bits(),
        "bit_rate": bus.bit_rate,
        "tick_s": TICK_S,
        "shape": {name: geometry[name].value for name in SHAPE},
        "targets": {name: _range(signal(name)) for name in TARGETS},
        "reach_tolerance_m": _tolerance(),
    }


def _shown(s: Signal, side: str) -> dict[str, Any]:
    unit, factor, offset = DISPLAY.get(s.unit, (s.unit, 1.0, 0.0))
    return {
        "name": s.name,
        "description": s.description,
        "side": side,
        "group": group(s).name.lower(),
        "message": s.can.message if s.can else "",
        "unit": unit,
        "factor": factor,
        "offset": offset,
        "min": s.min,
        "max": s.max,
        "values": s.values or None,
        "forceable": side == "input" and forceable(s),
    }


def _message(name: str) -> dict[str, Any]:
    message = definition().bus.messages[name]
    timeout = max((s.timeout_s or 0.0 for s in INPUT.signals if s.can and s.can.message == name), default=0.0)
    return {
        "name": name,
        "description": message.description,
        "sender": message.sender,
        "cycle_ms": message.cycle_ms,
        "timeout_ms": round(1000 * timeout),
        "bits": frame_bits(message.length),
    }


def _range(s: Signal) -> dict[str, Any]:
    return {"min": s.min, "max": s.max, "unit": s.unit, "start": s.start, "description": s.description}


def _tolerance() -> float:
    return parameters.load("gate")["target_tolerance"].value


def _sent_bits() -> float:
    ours = [m for m in definition().bus.messages.values() if m.sender == NODE]
    return sum(frame_bits(m.length) * 1000 / m.cycle_ms for m in ours)
