"""Where the machine's links and shapes are at given joint angles: forward kinematics with the swinging tool.

Walks the joints of `specs/urdf.py`, for many poses at once.  Angles are rows of slew, boom, stick, tool pitch
and tool roll, rad; places are in the base frame, m.
"""

from collections.abc import Mapping

import numpy as np

from specs import urdf
from specs.shapes import BASE, Capsule

STEP_RAD = 1e-3  # of an angle, for the slope of a distance by differences
BALL_M = 0.4  # between the balls along a capsule, between which a distance is at most 0.03 m too large
ANGLES = ("q_slew", "q_boom", "q_stick", "imu_tool_pitch", "imu_tool_roll")  # signals that joints turn by
Frame = tuple[np.ndarray, np.ndarray]  # rotations (n, 3, 3) into the base and origins (n, 3)


def frames(angles: np.ndarray, p: Mapping[str, float]) -> dict[str, Frame]:
    """The frame of every link at each row of `angles` (n, 5), of a machine with the parameters `p`."""
    angles = np.atleast_2d(np.asarray(angles, dtype=float))
    by_name: dict[str, np.ndarray] = dict(zip(ANGLES, angles.T, strict=True))
    count = len(angles)
    found: dict[str, Frame] = {BASE: (np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3)))}
    for joint in urdf.joints(p):
        turned, origin = found[joint.parent]
        angle = sum((by_name[name] for name in joint.angles), np.zeros(count))
        place = origin + turned @ np.array(joint.origin)
        found[joint.child] = (turned @ _rotation(joint.axis, angle), place)
    return found


def points(found: Mapping[str, Frame], link: str, place: tuple[float, float, float]) -> np.ndarray:
    """A place in a link's frame, in the base (n, 3)."""
    turned, origin = found[link]
    return origin + turned @ np.array(place)


def ends(found: Mapping[str, Frame], capsule: Capsule) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of a capsule's line in the base, (n, 3) each."""
    return points(found, *capsule.start), points(found, *capsule.end)


def along(capsule: Capsule, p: Mapping[str, float]) -> np.ndarray:
    """Places (m), 0 to 1 along a capsule's line, of the balls that stand for it."""
    start, end = ends(frames(np.zeros((1, len(ANGLES))), p), capsule)
    return np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(end - start) / BALL_M))


def grab(angles: np.ndarray, p: Mapping[str, float]) -> np.ndarray:
    """The grab point (n, 3) at each row of `angles`."""
    place = (0.0, 0.0, p.get("grab_offset", 0.0) - p["tool_length"])
    return points(frames(angles, p), "tool", place)


def _rotation(axis: tuple[float, float, float], angle: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)
