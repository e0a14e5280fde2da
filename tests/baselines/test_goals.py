"""Targets that are passed without stopping, and targets that move: their paths, and who follows them."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("coal", reason="pip install 'slewright[scenes]'")
pytest.importorskip("ompl", reason="pip install 'slewright[scenes]'")
pytest.importorskip("toppra", reason="pip install 'slewright[scenes]'")

from baselines.following import follower
from baselines.planning.legs import Legs
from baselines.planning.path import TICK_S, Path
from baselines.planning.planner import Planner, hanging
from specs.errors import InputError
from specs.scene import Goal, Scene, build, load
from verification.scenes.best import best
from verification.scenes.run import Case, run
from verification.scenes.score import score

BARGE = load("barge")


def goal(slew_deg: float, radius_m: float = 10.0, height_m: float = 4.0, **more: object) -> Goal:
    return Goal(slew_deg=slew_deg, radius_m=radius_m, height_m=height_m, **more)  # type: ignore[arg-type]


def yard(*targets: Goal) -> Scene:
    return Scene(name="yard", description="nothing is near", start=goal(0.0), targets=targets)


def path_of(scene: Scene, kind: str = "floor") -> Path:
    (leg,) = Legs(follower.find(kind).planner(scene)).foreseen()
    assert leg.path is not None, leg.reason
    return leg.path


@pytest.mark.parametrize("kind", ["floor", "shaped", "nmpc"])
def test_a_path_passes_its_targets_in_their_order_without_stopping(kind: str):
    scene = yard(goal(40.0, 11.0, 5.0, through=True), goal(70.0, 9.0, through=True), goal(110.0))
    path = path_of(scene, kind)
    grab = hanging(path)
    at = [int(np.argmin(np.linalg.norm(grab - target.xyz, axis=1))) for target in scene.targets]
    near = [np.linalg.norm(grab[k] - target.xyz) for k, target in zip(at, scene.targets, strict=True)]
    assert at == sorted(at)
    assert max(near) <= scene.tolerance_m
    assert np.all(np.linalg.norm(path.rates[at[0] : at[1]], axis=1) > 0.02)


@pytest.mark.parametrize("kind", ["floor", "shaped"])
def test_a_path_meets_a_target_that_moves_and_goes_on_with_it_smoothly(kind: str):
    scene = yard(goal(70.0, path=((0.0, 0.0, 0.0, 0.0), (60.0, -18.0, 0.0, 3.0))))
    path = path_of(scene, kind)
    ticks = np.arange(path.there + round(1.7 / TICK_S), len(path.angles) - round(2.0 / TICK_S))
    away = hanging(path)[ticks] - np.array([path.target(int(k)) for k in ticks])
    assert np.linalg.norm(away, axis=1).max() < 0.05
    assert np.abs(path.accelerations).max() < 0.4


def test_a_target_that_is_too_fast_to_be_met_is_said_to_be():
    fast = yard(goal(20.0, path=((0.0, 0.0, 0.0, 0.0), (4.0, -16.0, 6.0, 0.0), (8.0, 0.0, 0.0, 0.0))))
    (leg,) = Legs(Planner(fast)).foreseen()
    assert leg.path is None
    assert "the machine sets out" in leg.reason or "too fast" in leg.reason


def test_a_target_that_leaves_the_reach_says_when():
    away = yard(goal(60.0, 12.0, path=((0.0, 0.0, 0.0, 0.0), (8.0, 10.0, 10.0, 0.0))))
    (leg,) = Legs(Planner(away)).foreseen()
    assert leg.path is None
    assert "s after the machine sets out" in leg.reason


@pytest.mark.parametrize(
    ("targets", "said"),
    [
        ([{"through": True}], "targets: the last one is where the way ends"),
        ([{"path": [[0, 0, 0, 0], [1, 1, 0, 0]]}, {}], "targets.1: only the last one may move"),
        ([{"path": [[1, 0, 0, 0], [0, 1, 0, 0]]}], "path: times must grow"),
        ([{}, {"through": True, "path": [[0, 0, 0, 0]]}], "a target that moves cannot be passed"),
        ([{"passing": True}], "passing"),
    ],
)
def test_what_targets_cannot_be_is_refused_by_name(targets: list[dict], said: str):
    place = {"slew_deg": 30.0, "radius_m": 10.0, "height_m": 4.0}
    data = {"description": "d", "start": place, "targets": [place | more for more in targets]}
    with pytest.raises(InputError, match=said):
        build("s", data, "s.toml")


def test_no_optimum_is_looked_for_where_targets_move():
    assert best(BARGE, 1) == {"scene": "barge", "seconds": None}


@pytest.mark.long
@pytest.mark.parametrize("name", ["floor", "nmpc", "pd"])
def test_the_barge_is_reached_past_the_point_above_the_wall(name: str):
    row = score(run(Case(BARGE, name)))
    assert (row["missed"], row["targets"], row["contact"]) == (0, 2, False)


@pytest.mark.long
def test_a_target_that_is_not_passed_is_missed():
    aside = replace(BARGE, targets=(BARGE.targets[1],))
    ran = run(Case(aside, "floor"))
    passed = replace(ran, case=replace(ran.case, scene=BARGE))
    assert (score(ran)["missed"], score(passed)["missed"]) == (0, 1)
