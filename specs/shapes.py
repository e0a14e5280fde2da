"""The shapes of the machine's parts, for contacts and pictures: boxes and capsules fixed to its links.

Links and joints are those of `specs/urdf.py`; sizes come from `parameters/geometry.toml` and `shapes.toml`.
Boom and stick are straight here; the grab with its load is round about its axis, since nothing holds its yaw.
"""

import math
from dataclasses import dataclass

from specs import parameters

BASE = "base"  # the frame of targets: x forward at slew angle 0, y left, z up from the ground
TOOL = ("lines", "grab")  # capsules that swing
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Box:
    """A box on a link: its size and the place of its middle in the link's frame, m."""

    name: str
    link: str
    size: Vector
    middle: Vector


@dataclass(frozen=True)
class Capsule:
    """All points nearer than `radius` [m] to the line between two places, each in the frame of a link."""

    name: str
    start: tuple[str, Vector]
    end: tuple[str, Vector]
    radius: float


def sizes() -> dict[str, float]:
    """Nominal parameters of geometry and shapes, and where the tool's roll axis lies."""
    known = parameters.load("geometry", "shapes", "machine")
    wanted = {*parameters.load("geometry", "shapes"), "grab_offset"}
    return {name: p.value for name, p in known.items() if name in wanted}


def boxes(p: dict[str, float] | None = None) -> tuple[Box, ...]:
    """Chassis, carriage (the counterweight is its rear) and cabin."""
    p = p or sizes()
    deck = p["boom_foot_z"] - p["carriage_height"]
    chassis = (p["undercarriage_length"], p["undercarriage_width"], deck)
    carriage, cabin = (
        (p[f"{body}_length"], p[f"{body}_width"], p[f"{body}_height"]) for body in ("carriage", "cabin")
    )
    return (
        Box("chassis", BASE, chassis, (0.0, 0.0, deck / 2)),
        Box("carriage", "carriage", carriage, (p["carriage_x"], 0.0, deck + carriage[2] / 2)),
        Box("cabin", "carriage", cabin, (p["cabin_x"], p["cabin_y"], deck + cabin[2] / 2)),
    )


def capsules(p: dict[str, float] | None = None) -> tuple[Capsule, ...]:
    """Boom, stick, lines and grab; those of the arm hold the box of their section."""
    p = p or sizes()
    boom, stick = (math.hypot(p[f"{link}_width"], p[f"{link}_depth"]) / 2 for link in ("boom", "stick"))
    grab = p["tool_length"] - p["grab_offset"]  # below the roll axis
    low, high = (-grab + side * p["grab_half_height"] for side in (-1, 1))
    origin = (0.0, 0.0, 0.0)
    return (
        Capsule("boom", ("boom", origin), ("stick", origin), boom),
        Capsule("stick", ("stick", origin), ("tip", origin), stick),
        Capsule("lines", ("tip", origin), ("tool", (0.0, 0.0, -grab)), p["lines_radius"]),
        Capsule("grab", ("tool", (0.0, 0.0, high)), ("tool", (0.0, 0.0, low)), p["grab_radius"]),
    )
