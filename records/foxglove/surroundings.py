"""A scene as `foxglove.SceneUpdate`: things, zones, targets, the planned way of the grab.

Boxes and cylinders are themselves, height maps triangles, half-spaces plates as far as they are shown.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from records.foxglove.basics import Colour, Vector, colour, points, pose, stamp, vector
from specs import outlines
from specs.distance import along
from specs.scene import Box, Cylinder, HalfSpace, HeightMap, Scene, Thing, moved, parts_of
from specs.shapes import BASE

THING: Colour = (0.73, 0.64, 0.49, 1.0)
PLATE: Colour = (0.73, 0.64, 0.49, 0.5)
KEEP_OUT: Colour = (0.9, 0.2, 0.1, 0.3)
SLOW: Colour = (0.95, 0.7, 0.1, 0.3)
TARGET: Colour = (0.1, 0.6, 0.5, 0.5)
PLAN: Colour = (0.1, 0.4, 0.9, 1.0)
SWEPT: Colour = (0.1, 0.4, 0.9, 0.15)
COPIES_M = 2.0  # between the places at which a thing is shown that may be anywhere along its path
PLAN_M = 0.06  # thickness of the line of the planned way


def still(scene: Scene, time_ns: int, messages: Any, everywhere: bool = False) -> Any:
    """What stands where it stands: things, zones and targets.

    `everywhere`: what moves, too, at places all along its path.
    """
    made = [_entity(thing, 0.0, time_ns, messages) for thing in scene.things if not thing.path]
    if everywhere:
        copies = [copy for thing in scene.things if thing.path for copy in _copies(thing)]
        made += [_entity(copy, 0.0, time_ns, messages) for copy in copies]
    made += [_zone(scene, k, time_ns, messages, everywhere) for k in range(len(scene.zones))]
    size = vector([2.0 * scene.tolerance_m] * 3, messages)
    for number, target in enumerate(scene.targets, 1):
        sphere = messages.SpherePrimitive(
            pose=pose(target.xyz, messages), size=size, color=colour(TARGET, messages)
        )
        made.append(_made(f"target {number}", time_ns, messages, spheres=[sphere]))
    return messages.SceneUpdate(entities=made)


def moving(scene: Scene, seconds: float, time_ns: int, messages: Any) -> Any:
    """What moves, where it is at `seconds` of the run."""
    made = [_entity(thing, seconds, time_ns, messages) for thing in scene.things if thing.path]
    return messages.SceneUpdate(entities=made)


def plan(ways: Sequence[Sequence[Vector]], swept_m: float, time_ns: int, messages: Any) -> Any:
    """The planned ways of the grab [m] as lines, and the room of radius `swept_m` that the grab takes."""
    made = []
    for number, way in enumerate(ways, 1):
        lines = [_line(way, PLAN_M, PLAN, messages), _line(way, 2.0 * swept_m, SWEPT, messages)]
        made.append(_made(f"way {number}", time_ns, messages, lines=lines))
    return messages.SceneUpdate(entities=made)


def _copies(thing: Thing) -> Iterator[Thing]:
    """The thing at rest, all along its path."""
    for number, place in enumerate(dict.fromkeys(along(thing.places(), COPIES_M)), 1):
        yield replace(thing, name=f"{thing.name}, place {number}", path=((0.0, *place),))


def _entity(thing: Thing, seconds: float, time_ns: int, messages: Any) -> Any:
    x, y, z = outlines.away(thing, np.array([seconds]))[0].tolist()
    solids = [moved(part, (x, y, z)) for part in parts_of(thing)]
    if isinstance(thing, HeightMap):
        meshes = [outlines.corners(solid) for solid in solids if isinstance(solid, Box)]
        return _made(thing.name, time_ns, messages, triangles=[_mesh(meshes, THING, messages)])
    return _made(thing.name, time_ns, messages, **_primitives(solids, THING, messages))


def _zone(scene: Scene, number: int, time_ns: int, messages: Any, everywhere: bool) -> Any:
    zone = scene.zones[number]
    places = list(along(zone.shape.places(), COPIES_M)) if everywhere else [(0.0, 0.0, 0.0)]
    solids = [moved(zone.shape, place) for place in dict.fromkeys(places)]
    of = KEEP_OUT if zone.kind == "keep_out" else SLOW
    name = f"zone {number + 1}: {zone.shape.name}"
    return _made(name, time_ns, messages, **_primitives(solids, of, messages))


def _primitives(solids: Sequence[Box | Cylinder | HalfSpace], of: Colour, messages: Any) -> dict[str, Any]:
    """Primitives by the field of an entity that holds them."""
    found: dict[str, list[Any]] = {"cubes": [], "cylinders": [], "triangles": []}
    for solid in solids:
        if isinstance(solid, Box):
            half = math.radians(solid.turn_deg) / 2
            turned = pose(solid.middle, messages, (0.0, 0.0, math.sin(half), math.cos(half)))
            found["cubes"].append(
                messages.CubePrimitive(
                    pose=turned, size=vector(solid.size, messages), color=colour(of, messages)
                )
            )
        elif isinstance(solid, Cylinder):
            found["cylinders"].append(_cylinder(solid, of, messages))
        else:
            found["triangles"].append(_mesh([outlines.plate(solid)], PLATE, messages))
    return {name: made for name, made in found.items() if made}


def _cylinder(solid: Cylinder, of: Colour, messages: Any) -> Any:
    x, y, z = solid.foot
    return messages.CylinderPrimitive(
        pose=pose((x, y, z + solid.height / 2), messages),
        size=vector((2 * solid.radius, 2 * solid.radius, solid.height), messages),
        bottom_scale=1.0, top_scale=1.0, color=colour(of, messages),
    )  # fmt: skip


def _mesh(meshes: Sequence[tuple[np.ndarray, outlines.Faces]], of: Colour, messages: Any) -> Any:
    corners = [corner for mesh, faces in meshes for face in faces for corner in mesh[list(face)].tolist()]
    return messages.TriangleListPrimitive(
        pose=pose((0.0, 0.0, 0.0), messages), points=points(corners, messages), color=colour(of, messages)
    )


def _line(way: Sequence[Vector], thickness: float, of: Colour, messages: Any) -> Any:
    return messages.LinePrimitive(
        type=messages.LinePrimitiveLineType.LineStrip, pose=pose((0.0, 0.0, 0.0), messages),
        thickness=thickness, scale_invariant=False, points=points(way, messages), color=colour(of, messages),
    )  # fmt: skip


def _made(name: str, time_ns: int, messages: Any, **primitives: Any) -> Any:
    return messages.SceneEntity(timestamp=stamp(time_ns, messages), frame_id=BASE, id=name, **primitives)
