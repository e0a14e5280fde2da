"""The machine in space and what is around it, from the signals: transforms, joints, target, keep-out."""

import math
from typing import Any

from records.foxglove import machine
from records.foxglove.basics import Colour, colour, pose, stamp, vector
from runtime.interfaces.view import Seen
from specs import parameters, urdf

BLUE: Colour = (0.1, 0.4, 0.9, 0.9)
RED: Colour = (0.9, 0.2, 0.1, 0.25)
TARGET_SIZE = 0.6  # m


def angles(seen: Seen) -> dict[str, float]:
    """Angle of each joint; no number where one of its signals is not known."""
    return {j.name: sum(seen.of(name) for name in j.angles) for j in machine.JOINTS}


def transforms(seen: Seen, messages: Any) -> Any:
    """`foxglove.FrameTransforms` of all joints whose angles are known, and of what is fixed."""
    return machine.transforms(angles(seen), seen.time_ns, messages)


def joint_states(seen: Seen, messages: Any) -> Any:
    """`foxglove.JointStates`."""
    return machine.joint_states(angles(seen), seen.time_ns, messages)


def scene(seen: Seen, messages: Any) -> Any:
    """`foxglove.SceneUpdate`: the target while there is one, and the column that is kept out."""
    at = stamp(seen.time_ns, messages)
    place = [seen.of(f"target_{axis}") for axis in "xyz"]
    there = seen.of("target_valid") == 1.0 and all(map(math.isfinite, place))
    size = vector([TARGET_SIZE] * 3, messages)
    spheres = [messages.SpherePrimitive(pose=pose(place, messages), size=size, color=colour(BLUE, messages))]
    target = messages.SceneEntity(
        timestamp=at, frame_id=urdf.BASE, id="target", spheres=spheres if there else []
    )
    return messages.SceneUpdate(entities=[target, _keep_out(at, messages)])


def _keep_out(at: Any, messages: Any) -> Any:
    p = parameters.load("geometry")
    across, height = 2 * p["keepout_radius"].value, p["keepout_height"].value
    column = messages.CylinderPrimitive(
        pose=pose((0.0, 0.0, height / 2), messages), size=vector((across, across, height), messages),
        bottom_scale=1.0, top_scale=1.0, color=colour(RED, messages),
    )  # fmt: skip
    return messages.SceneEntity(timestamp=at, frame_id=urdf.BASE, id="keep-out", cylinders=[column])
