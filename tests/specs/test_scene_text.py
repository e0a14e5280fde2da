"""A scene as plain data is the same scene when it is read again."""

import json

import pytest

from specs import scene, scene_families, scene_text
from specs.errors import InputError


@pytest.mark.parametrize("name", [*scene.names(), "tuning", "training"])
def test_every_scene_comes_back_as_it_was(name: str):
    for found in scene_families.find([name]):
        assert scene_text.of(json.loads(json.dumps(scene_text.plain(found))), "x") == found


@pytest.mark.parametrize(
    "data", [[], {}, {"name": 3}, {"name": "a"}, {"name": "a", "things": [{"kind": "x"}]}]
)
def test_what_is_no_scene_is_named(data: object):
    with pytest.raises(InputError, match=r"^bundle/guard-scene.json: "):
        scene_text.of(data, "bundle/guard-scene.json")
