"""The machine in space, from its joints (specs/urdf.py) and the signals: transforms, joints, the scene."""

import math
from typing import Any

from runtime.interfaces.view import Seen
from specs import parameters, urdf

JOINTS = urdf.joints()
BLUE, RED, GREY = (0.1, 0.4, 0.9, 0.9), (0.9, 0.2, 0.1, 0.25), (0.6, 0.6, 0.6, 0.6)
TARGET_SIZE = 0.6  # m


def angles(seen: Seen) -> dict[str, float]:
    """Angle of each joint; no number where one of its signals is not known."""
    return {j.name: sum(seen.of(name) for name in j.angles) for j in JOINTS}


def transforms(seen: Seen, messages: Any) -> Any:
    """`foxglove.FrameTransforms` of all joints whose angles are known, and of what is fixed."""
    stamp, found = _stamp(seen, messages), []
    for joint, angle in zip(JOINTS, angles(seen).values(), strict=True):
        if math.isfinite(angle):
            half = math.sin(angle / 2)
            turn = messages.Quaternion(
                x=joint.axis[0] * half, y=joint.axis[1] * half, z=joint.axis[2] * half, w=math.cos(angle / 2)
            )
            found.append(_transform(messages, stamp, joint.parent, joint.child, joint.origin, turn))
    grab = (0.0, 0.0, -parameters.load("geometry")["tool_length"].value)
    still = messages.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    found.append(_transform(messages, stamp, "tool", "grab", grab, still))
    return messages.FrameTransforms(transforms=found)


def joint_states(seen: Seen, messages: Any) -> Any:
    """`foxglove.JointStates`."""
    made = [messages.JointState(name=n, position=a) for n, a in angles(seen).items() if math.isfinite(a)]
    return messages.JointStates(timestamp=_stamp(seen, messages), joints=made)


def scene(seen: Seen, messages: Any) -> Any:
    """`foxglove.SceneUpdate`: the target while there is one, and the column that is kept out."""
    stamp = _stamp(seen, messages)
    place = [seen.of(f"target_{axis}") for axis in "xyz"]
    there = seen.of("target_valid") == 1.0 and all(map(math.isfinite, place))
    size = messages.Vector3(x=TARGET_SIZE, y=TARGET_SIZE, z=TARGET_SIZE)
    spheres = [
        messages.SpherePrimitive(pose=_pose(messages, *place), size=size, color=_color(messages, BLUE))
    ]
    target = messages.SceneEntity(
        timestamp=stamp, frame_id=urdf.BASE, id="target", spheres=spheres if there else []
    )
    return messages.SceneUpdate(entities=[target, _keep_out(stamp, messages)])


def _keep_out(stamp: Any, messages: Any) -> Any:
    p = parameters.load("geometry")
    across, height = 2 * p["keepout_radius"].value, p["keepout_height"].value
    column = messages.CylinderPrimitive(
        pose=_pose(messages, 0.0, 0.0, height / 2), size=messages.Vector3(x=across, y=across, z=height),
        bottom_scale=1.0, top_scale=1.0, color=_color(messages, RED),
    )  # fmt: skip
    return messages.SceneEntity(timestamp=stamp, frame_id=urdf.BASE, id="keep-out", cylinders=[column])


def _transform(messages: Any, stamp: Any, parent: str, child: str, origin: urdf.Vector, turn: Any) -> Any:
    x, y, z = origin
    return messages.FrameTransform(
        timestamp=stamp, parent_frame_id=parent, child_frame_id=child,
        translation=messages.Vector3(x=x, y=y, z=z), rotation=turn,
    )  # fmt: skip


def _stamp(seen: Seen, messages: Any) -> Any:
    return messages.Timestamp(sec=seen.time_ns // 10**9, nsec=seen.time_ns % 10**9)


def _pose(messages: Any, x: float, y: float, z: float) -> Any:
    still = messages.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    return messages.Pose(position=messages.Vector3(x=x, y=y, z=z), orientation=still)


def _color(messages: Any, rgba: tuple[float, float, float, float]) -> Any:
    return messages.Color(r=rgba[0], g=rgba[1], b=rgba[2], a=rgba[3])
