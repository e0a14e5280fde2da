"""`slewright bundle --guard`: which scenes a guard takes, and what the bundle says of it."""

import json
from pathlib import Path

import numpy as np
import pytest

from deployment.bundling import archive as signing, guard, polar
from deployment.bundling.polar import RECTS, Rect
from runtime import bundle as form
from runtime.archive import container, names as form_names
from slewright.__main__ import run
from specs import scene as scenes, scene_text
from specs.errors import InputError
from specs.scene import Box, Goal, HalfSpace, Scene, Thing
from specs.scene_families import SETS, find, single
from tests.runtime.archive.made import key
from tests.runtime.bundles import guarded

THROUGH = ((0.0, 12.0, 0.0, 0.0), (5.0, -12.0, 0.0, 0.0))
HERE = Goal(slew_deg=0.0, radius_m=9.0, height_m=4.0)


def of(*things: Thing) -> Scene:
    return Scene(name="s", description="d", start=HERE, targets=(HERE,), things=things)


@pytest.mark.long
def test_every_scene_that_is_not_sealed_can_be_guarded() -> None:
    for name in (*scenes.names(), *(which for which in SETS if which != "test")):
        for scene in find([name]):
            found = guard.zones(scene)
            assert max(map(len, found.sectors)) <= RECTS
            assert any(found.sectors), scene.name


@pytest.mark.parametrize(
    ("thing", "said"),
    [
        (Box(name="cart", middle=(0.0, 0.0, 2.0), size=(1.0, 1.0, 4.0), path=THROUGH), "or come there"),
        (HalfSpace(name="slope", point=(2.0, 0.0, 2.0), normal=(0.1, 0.0, 1.0)), "in the machine itself"),
        (Box(name="block", middle=(0.0, 0.0, 2.0), size=(3.0, 3.0, 4.0)), "in the machine itself"),
    ],
)  # fmt: skip
def test_what_a_guard_cannot_hold_is_named(thing: Thing, said: str) -> None:
    with pytest.raises(InputError, match=said):
        guard.zones(of(thing))


def test_a_set_of_scenes_is_no_scene() -> None:
    with pytest.raises(InputError, match=r"'tuning' is a set of 24 scenes; name one, as truck:tuning:0"):
        single("tuning")


def test_an_upright_half_space_reaches_everywhere_behind_it() -> None:
    wall = guard.zones(of(HalfSpace(name="wall", point=(8.0, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))))
    assert wall.sectors[0][0].r0 == pytest.approx(8.0, abs=0.01)
    assert not wall.sectors[guard.SECTORS // 2]


@pytest.mark.long
@pytest.mark.parametrize("up", [1.0, -1.0])
def test_a_level_half_space_reaches_all_around(up: float) -> None:
    level = guard.zones(of(HalfSpace(name="roof", point=(0.0, 0.0, 15.0 * up), normal=(0.0, 0.0, -up))))
    assert all(len(rects) == 1 for rects in level.sectors)


def test_too_many_rectangles_become_fewer_that_hold_them_all() -> None:
    random = np.random.default_rng(1)
    rects = [
        Rect(r, r + 0.3, z, z + 0.3, bool(k % 2)) for k, (r, z) in enumerate(random.uniform(0, 10, (40, 2)))
    ]
    few = polar.few(rects)
    assert len(few) == RECTS
    for one in rects:
        assert any(
            f.r0 <= one.r0 and one.r1 <= f.r1 and f.z0 <= one.z0 and one.z1 <= f.z1
            and (one.tool_only or not f.tool_only)
            for f in few
        )  # fmt: skip


def test_the_bundle_says_what_it_guards(tmp_path: Path) -> None:
    out, figures = tmp_path / "pd", tmp_path / "figures.json"
    assert run(["bundle", "pd", "--out", str(out), "--guard", "truck", "--json", str(figures)]) == 0
    assert form.load(out).guard == "truck"
    assert json.loads(figures.read_text())["guard"] == "truck"
    assert "guard_clearance" in json.loads((out / form.PARAMETERS).read_text())
    assert form.scene_of(out) == scenes.load("truck")
    (out / form.GUARD_SCENE).write_text("{}")
    with pytest.raises(InputError, match=r"guard-scene\.json was changed since it was built"):
        form.load(out)


def test_a_signed_archive_holds_the_scene(tmp_path: Path) -> None:
    signing.write(guarded("pd"), tmp_path / "pd.slwb", key(), "1.0")
    inside = container.read(tmp_path / "pd.slwb")[form_names.BUNDLE + form.GUARD_SCENE]
    assert scene_text.of(json.loads(inside), "archive") == scenes.load("truck")


@pytest.mark.parametrize(("name", "said"), [("trukc", "truck"), ("tuning", "is a set of 24 scenes")])
def test_a_wrong_scene_is_wrong_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, said: str
) -> None:
    assert run(["bundle", "pd", "--out", str(tmp_path / "pd"), "--guard", name]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "pd").exists()
