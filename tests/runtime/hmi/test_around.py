"""What stands around the machine on the page: what it is told, live and in playback, and what it draws."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from records.record import RecordWriter
from runtime.bundle import scene_of
from runtime.control import ControlCore
from runtime.hmi import around, watch
from runtime.hmi.playback import Playback
from runtime.hmi.retold import Retold
from runtime.hmi.timeline import open_timeline
from runtime.hmi.web import Request
from runtime.shared import private_folder
from specs import scene_text
from specs.clearance import Clearance
from specs.scene import Box, Cylinder, Goal, HalfSpace, HeightMap, Scene, Zone, load
from tests.runtime.bundles import built, guarded
from tests.runtime.hmi.browser import Browser
from tests.runtime.hmi.served import Served
from tests.runtime.hmi.test_playback import simulated, site

HERE = Goal(slew_deg=30.0, radius_m=9.0, height_m=4.0)
YARD = Scene(
    name="yard", description="d", start=HERE, targets=(HERE,),
    things=(
        Box(name="wall", middle=(9, 4, 1), size=(1, 4, 2), turn_deg=30.0),
        Cylinder(name="pole", foot=(0, 8, 0), radius=0.3, height=6.0),
        HalfSpace(name="house", point=(-9, 0, 0), normal=(1, 0, 0)),
        HalfSpace(name="roof", point=(0, 0, 18), normal=(0, 0, -1)),
        HeightMap(name="pile", corner=(5, 5), cell=1.0, heights=((1, 2),)),
        Box(name="cart", middle=(9, 0, 1), size=(1, 1, 2), path=((0, 0, -8, 0), (9, 0, 1, 0))),
    ),
    zones=(
        Zone(kind="keep_out", shape=Box(name="road", middle=(0, 12, 1), size=(9, 2, 2))),
        Zone(kind="slow", shape=Cylinder(name="people", foot=(9, 9, 0), radius=2, height=3)),
    ),
)  # fmt: skip
WAYS = [[[9.0, 0.0, 4.0], [7.0, 6.0, 5.0], [0.0, 9.0, 4.0]]]
ANGLES = ("q_slew", "q_boom", "q_stick", "imu_tool_pitch", "imu_tool_roll")
STEPPED_IN = slice(250, 350)  # rows: 5 to 7 s
SHOWN = "document.querySelector('#clearance').textContent"


def run_in_the_yard(folder: Path) -> Path:
    """A run of 10 s, in which the guard steps in for the grab."""
    path, t = folder / "run.parquet", 0.02 * np.arange(500)
    meta = {scene_text.SCENE: scene_text.plain(YARD), scene_text.WAYS: WAYS, "scene": "yard"}
    part = np.zeros(len(t))
    part[STEPPED_IN] = 4.0
    with RecordWriter(path, ["time", *ANGLES, "guard_part"], meta) as writer:
        still = np.tile([1.1, -1.9, 0.0, 0.0], (len(t), 1))
        writer.append(np.column_stack([t, 0.1 * t, still, part]))
    return path


def asked(playback: Playback, path: str, **query: str) -> dict:
    route = playback.routes()[("GET", path)]
    return route(Request(query, {}, "", "", True))


def test_everything_is_drawn_as_plain_data():
    drawn = around.Around(YARD, "the run's", WAYS).drawn
    assert json.loads(json.dumps(drawn, allow_nan=False)) == drawn
    kinds = {solid["name"]: solid["kind"] for solid in drawn["solids"]}
    assert kinds == {
        **dict.fromkeys(("wall", "pole", "house", "roof", "cart"), "thing"),
        "pile": "pile", "road": "keep_out", "people": "slow",
    }  # fmt: skip
    solid = {one["name"]: one for one in drawn["solids"]}
    assert solid["pole"]["z"] == [0.0, 6.0]
    assert np.hypot(*(np.array(solid["wall"]["outline"]) - [9, 4]).T) == pytest.approx(
        [np.hypot(2, 0.5)] * 4, abs=1e-3
    )
    assert max(x for x, _ in solid["house"]["outline"]) == -9.0
    assert solid["roof"]["outline"] == []
    assert solid["roof"]["plane"] == [0.0, 0.0, -1.0, -18.0]
    assert drawn["ways"] == WAYS
    assert drawn["targets"] == [list(HERE.xyz)]


def test_without_a_time_of_the_scene_a_thing_is_drawn_everywhere_that_it_comes():
    """A cart that comes from 8 m beside to 1 m on the other side."""
    guards = around.of_bundle(YARD)
    assert guards
    carts = [solid for solid in guards.drawn["solids"] if solid["name"] == "cart"]
    assert not any(solid["path"] for solid in guards.drawn["solids"])
    assert len(carts) == 10
    sides = sorted(min(y for _, y in cart["outline"]) for cart in carts)
    assert sides == pytest.approx(np.arange(-8.5, 1.0, 1.0))
    assert len(around.Around(YARD, "the run's").drawn["solids"]) == len(guards.drawn["solids"]) - 9


def test_a_run_of_a_scene_plays_with_its_clearance(tmp_path: Path):
    playback = Playback(open_timeline(run_in_the_yard(tmp_path)))
    assert asked(playback, "/api/catalogue")["around"]["name"] == "yard"
    frames = asked(playback, "/api/frames", **{"from": "0", "to": "9"})["frames"]
    clearance = Clearance(YARD)
    for frame in frames[::10]:
        expected = clearance.near((0.1 * frame["t"], 1.1, -1.9, 0.0, 0.0), frame["t"])
        assert [one[0] for one in frame["near"]] == [one.part for one in expected]
        assert frame["near"][0][1] == pytest.approx(expected[0].distance, abs=2e-3)


def test_other_runs_have_nothing_around(tmp_path: Path):
    playback = Playback(open_timeline(simulated(tmp_path)))
    assert asked(playback, "/api/catalogue")["around"] is None
    assert "near" not in asked(playback, "/api/frames")["frames"][0]


def test_the_scene_of_a_bundle_is_that_of_its_guard():
    assert scene_of(guarded("pd").folder) == load("truck")
    assert scene_of(built("pd").folder) is None
    retold = Retold(ControlCore(guarded("pd")))  # the bundle of a recording
    assert retold.around
    assert retold.around.drawn["name"] == "truck"


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    monkeypatch.setattr(watch, "STALE_NS", 10**12)
    folder = private_folder("slewright-test-")
    with Served(ControlCore(guarded("pd")), folder) as found:
        yield found
    shutil.rmtree(folder, ignore_errors=True)


def test_a_live_page_is_told_what_the_guard_keeps_off(served: Served):
    drawn = served.ask("api/catalogue")[1]["around"]
    assert drawn["whose"] == "the guard's"
    assert drawn["ways"] == drawn["targets"] == []
    assert {"bay wall", "pile"} <= {solid["name"] for solid in drawn["solids"]}


@pytest.mark.browser
def test_a_live_page_shows_the_clearance(served: Served, browser: str, tmp_path: Path):
    with Browser(browser, tmp_path / "browser") as page:
        page.open(served.address)
        page.wait(f"/^Clearance [0-9.]+ m, [a-z]+ to /.test({SHOWN})")
        assert page.run("document.querySelectorAll('#side .around').length") > 5
        assert page.complaints == []


@pytest.mark.browser
def test_the_page_draws_scene_plan_and_clearance(browser: str, tmp_path: Path):
    with site(run_in_the_yard(tmp_path)) as address, Browser(browser, tmp_path / "browser") as page:
        page.open(address)
        page.wait(f"{SHOWN}.startsWith('Clearance')")
        first = page.run(SHOWN)
        for view in ("above", "side"):
            assert page.run(f"document.querySelectorAll('#{view} .way').length") == 1
            assert page.run(f"document.querySelectorAll('#{view} .goal').length") == 1
            assert page.run(f"document.querySelectorAll('#{view} .nearest').length") >= 1
            numbers = f"[...document.querySelectorAll('#{view} .around')].map(x => x.getAttribute('points'))"
            assert "NaN" not in "".join(filter(None, page.run(numbers)))
        page.write("#slider", "6")
        page.wait(f"/Guard steps in: grab −?[0-9.]+ m to /.test({SHOWN})")
        assert page.run("document.querySelector('#clearance').classList.contains('warning')")
        page.write("#slider", "9.5")
        page.wait(f"{SHOWN}.startsWith('Clearance')")
        assert page.run(SHOWN) != first
        for size in ((1024, 768), (768, 1024)):
            page.resize(*size)
            assert page.run("document.documentElement.scrollHeight <= innerHeight")
        assert page.complaints == []
