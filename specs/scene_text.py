"""A scene as plain data, and back: what a bundle and a run's record keep of it."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from specs.errors import InputError
from specs.scene import KINDS, Scene, Thing, build

SCENE, WAYS = "scene_content", "planned"  # a record's metadata: `plain`, and planned ways of the grab [m]
NAMES = {kind: name for name, kind in KINDS.items()}


def plain(scene: Scene) -> dict[str, Any]:
    """Content of a scene file that gives this scene, its name beside it; JSON and TOML can hold it."""
    found = {k: v for k, v in asdict(scene).items() if k not in ("things", "zones")}
    found["things"] = [_thing(thing) for thing in scene.things]
    found["zones"] = [
        {**_thing(zone.shape, "shape"), "kind": zone.kind, "speed_m_s": zone.speed_m_s}
        for zone in scene.zones
    ]
    return json.loads(json.dumps(found))


def of(data: Any, where: str) -> Scene:
    """The scene of `plain`; InputError, `where` first, for data of another form."""
    if not isinstance(data, Mapping) or not isinstance(data.get("name"), str):
        raise InputError(f"{where}: holds no scene")
    return build(data["name"], {k: v for k, v in data.items() if k != "name"}, where)


def _thing(thing: Thing, key: str = "kind") -> dict[str, Any]:
    return {**asdict(thing), key: NAMES[type(thing)]}
