"""Stamp, pose, points and colour as Foxglove's messages have them.

`messages` is `foxglove.messages` of foxglove-sdk, handed in by who has loaded it: no room needs it otherwise.
"""

from collections.abc import Iterable, Sequence
from typing import Any

Colour = tuple[float, float, float, float]  # red, green, blue, how opaque: 0 to 1
Vector = Sequence[float]
STILL = (0.0, 0.0, 0.0, 1.0)  # the quaternion (x, y, z, w) that turns nothing


def stamp(time_ns: int, messages: Any) -> Any:
    """`Timestamp` of a time in ns."""
    return messages.Timestamp(sec=time_ns // 10**9, nsec=time_ns % 10**9)


def pose(place: Vector, messages: Any, turn: Vector = STILL) -> Any:
    """`Pose` of a place [m] and a quaternion (x, y, z, w)."""
    x, y, z, w = turn
    return messages.Pose(
        position=vector(place, messages), orientation=messages.Quaternion(x=x, y=y, z=z, w=w)
    )


def vector(place: Vector, messages: Any) -> Any:
    """`Vector3`, m."""
    x, y, z = map(float, place)
    return messages.Vector3(x=x, y=y, z=z)


def points(places: Iterable[Vector], messages: Any) -> list[Any]:
    """`Point3` of each place, m."""
    return [messages.Point3(x=float(x), y=float(y), z=float(z)) for x, y, z in places]


def colour(rgba: Colour, messages: Any) -> Any:
    """`Color`."""
    return messages.Color(r=rgba[0], g=rgba[1], b=rgba[2], a=rgba[3])
