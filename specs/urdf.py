"""The machine's joints and their URDF, from `parameters/geometry.toml`, for RViz and Foxglove.

A grab hangs: between stick and tool lies the joint `tool_level`, which turns back what boom and stick turned.
The tool's own joints follow it, pitch before roll, as in the reference machine's equations.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree import ElementTree as Xml

from specs import shapes
from specs.shapes import BASE, Box, Vector

MADE = "Generated from specs/parameters/geometry.toml by slewright generate; do not edit."


@dataclass(frozen=True)
class Joint:
    """A joint from link `parent` to link `child`; its angle is the sum of `angles`."""

    name: str
    parent: str
    child: str
    origin: Vector
    axis: Vector
    angles: tuple[str, ...]  # signals
    limits: tuple[float, float] | None = None


def joints(values: Mapping[str, float] | None = None) -> tuple[Joint, ...]:
    """From the ground to the grab, each after the one that carries it; nominal where there are no `values`.

    The roll axis lies `grab_offset` below the pitch axis where the values say so; a drawing leaves it out.
    """
    p = shapes.sizes() | {"grab_offset": 0.0} if values is None else values
    foot = (p["boom_foot_x"], 0.0, p["boom_foot_z"])
    up, back, left, out = (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
    here = (0.0, 0.0, 0.0)
    boom, stick = (p["boom_min"], p["boom_max"]), (p["stick_min"], p["stick_max"])
    return (
        Joint("slew", BASE, "carriage", here, up, ("q_slew",)),
        Joint("boom", "carriage", "boom", foot, back, ("q_boom",), boom),
        Joint("stick", "boom", "stick", (p["boom_length"], 0.0, 0.0), back, ("q_stick",), stick),
        Joint("tool_level", "stick", "tip", (p["stick_length"], 0.0, 0.0), left, ("q_boom", "q_stick")),
        Joint("tool_pitch", "tip", "swivel", here, left, ("imu_tool_pitch",)),
        Joint(
            "tool_roll",
            "swivel",
            "tool",
            (0.0, 0.0, 0.0 - p.get("grab_offset", 0.0)),
            out,
            ("imu_tool_roll",),
        ),
    )


def bodies() -> tuple[Box, ...]:
    """What is drawn of each link."""
    p = shapes.sizes()
    boom, stick, rope = p["boom_length"], p["stick_length"], p["tool_length"]
    line = 2 / 3 * p["lines_radius"]
    return (
        *shapes.boxes(p),
        Box("boom", "boom", (boom, p["boom_width"], p["boom_depth"]), (boom / 2, 0.0, 0.0)),
        Box("stick", "stick", (stick, p["stick_width"], p["stick_depth"]), (stick / 2, 0.0, 0.0)),
        Box("lines", "tool", (line, line, rope), (0.0, 0.0, -rope / 2)),
        Box("grab", "tool", (p["grab_length"], p["grab_width"], p["grab_height"]), (0.0, 0.0, -rope)),
    )


def render() -> str:
    """The URDF."""
    robot = Xml.Element("robot", name="slewright")
    found = joints()
    links = [BASE, *(j.child for j in found), "grab", "cabin_imu", "tool_imu"]
    for name in links:
        link = Xml.SubElement(robot, "link", name=name)
        for body in bodies():
            if body.link == name:
                _box(link, body)
    for joint in found:
        _joint(robot, joint)
    tool_length = shapes.sizes()["tool_length"]
    for name, parent, place in (
        ("grab", "tool", (0.0, 0.0, -tool_length)),
        ("cabin_imu", "carriage", (0.0, 0.0, 0.0)),
        ("tool_imu", "tool", (0.0, 0.0, 0.0)),
    ):
        fixed = Xml.SubElement(robot, "joint", name=f"{name}_mount", type="fixed")
        _ends(fixed, parent, name, place)
    Xml.indent(robot)
    return f'<?xml version="1.0"?>\n<!-- {MADE} -->\n{Xml.tostring(robot, encoding="unicode")}\n'


def _box(link: Xml.Element, body: Box) -> None:
    visual = Xml.SubElement(link, "visual")
    Xml.SubElement(visual, "origin", xyz=_text(body.middle), rpy="0 0 0")
    Xml.SubElement(Xml.SubElement(visual, "geometry"), "box", size=_text(body.size))


def _joint(robot: Xml.Element, joint: Joint) -> None:
    kind = "revolute" if joint.limits else "continuous"
    made = Xml.SubElement(robot, "joint", name=joint.name, type=kind)
    _ends(made, joint.parent, joint.child, joint.origin)
    Xml.SubElement(made, "axis", xyz=_text(joint.axis))
    if joint.limits:
        low, high = (f"{v:.12g}" for v in joint.limits)
        Xml.SubElement(made, "limit", lower=low, upper=high, effort="0", velocity="0")


def _ends(joint: Xml.Element, parent: str, child: str, origin: Vector) -> None:
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)
    Xml.SubElement(joint, "origin", xyz=_text(origin), rpy="0 0 0")


def _text(vector: Vector) -> str:
    return " ".join(f"{v:.12g}" for v in vector)
