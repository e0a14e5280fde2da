"""The machine in space: transforms and states of its joints (specs/urdf.py), and its parts as boxes."""

import math
from collections.abc import Mapping
from typing import Any

from records.foxglove.basics import STILL, Colour, colour, pose, stamp, vector
from specs import parameters, urdf

JOINTS = urdf.joints()
METAL: Colour = (0.55, 0.58, 0.6, 1.0)


def transforms(angles: Mapping[str, float], time_ns: int, messages: Any) -> Any:
    """`foxglove.FrameTransforms` of all joints whose angle [rad], by name, is known, and of what is fixed."""
    found = []
    for joint in JOINTS:
        half = angles[joint.name] / 2
        if math.isfinite(half):
            x, y, z = (math.sin(half) * along for along in joint.axis)
            turn = messages.Quaternion(x=x, y=y, z=z, w=math.cos(half))
            found.append(_transform(messages, time_ns, joint.parent, joint.child, joint.origin, turn))
    grab = (0.0, 0.0, -parameters.load("geometry")["tool_length"].value)
    x, y, z, w = STILL
    still = messages.Quaternion(x=x, y=y, z=z, w=w)
    found.append(_transform(messages, time_ns, "tool", "grab", grab, still))
    return messages.FrameTransforms(transforms=found)


def joint_states(angles: Mapping[str, float], time_ns: int, messages: Any) -> Any:
    """`foxglove.JointStates` of the joints whose angle [rad], by name, is known."""
    made = [messages.JointState(name=n, position=a) for n, a in angles.items() if math.isfinite(a)]
    return messages.JointStates(timestamp=stamp(time_ns, messages), joints=made)


def parts(time_ns: int, messages: Any) -> Any:
    """`foxglove.SceneUpdate`: the machine as boxes that move with its links, for files without its URDF."""
    bodies = urdf.bodies()
    entities = []
    for link in dict.fromkeys(body.link for body in bodies):
        cubes = [
            messages.CubePrimitive(
                pose=pose(body.middle, messages), size=vector(body.size, messages),
                color=colour(METAL, messages),
            )
            for body in bodies if body.link == link
        ]  # fmt: skip
        entities.append(
            messages.SceneEntity(
                timestamp=stamp(time_ns, messages), frame_id=link, id=link, frame_locked=True, cubes=cubes
            )
        )
    return messages.SceneUpdate(entities=entities)


def _transform(messages: Any, time_ns: int, parent: str, child: str, origin: urdf.Vector, turn: Any) -> Any:
    return messages.FrameTransform(
        timestamp=stamp(time_ns, messages), parent_frame_id=parent, child_frame_id=child,
        translation=vector(origin, messages), rotation=turn,
    )  # fmt: skip
