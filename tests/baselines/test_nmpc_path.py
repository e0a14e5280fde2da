"""The model predictive follower of paths: its distances, its cost, and what it does in a scene."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

pytest.importorskip("coal", reason="pip install 'slewright[scenes]'")
pytest.importorskip("ompl", reason="pip install 'slewright[scenes]'")
pytest.importorskip("toppra", reason="pip install 'slewright[scenes]'")

from baselines.following import follower
from baselines.nmpc import prediction
from baselines.nmpc_path import cost
from baselines.nmpc_path.field import FAR_M, Field
from baselines.nmpc_path.follower import Predictive
from baselines.optima import around
from baselines.optima.around import Leg
from baselines.optima.plant import STATES
from baselines.planning.legs import Legs
from baselines.planning.path import Path
from baselines.planning.planner import Planner
from fmus.equations import kinematics
from specs import pose, scene_families, shapes
from specs.scene import Box, Scene
from verification.scenes.best import best, ratios
from verification.scenes.contacts import contacts
from verification.scenes.run import Case, run
from verification.scenes.score import score

SIZES = shapes.sizes()
GAP = scene_families.draw("gap:tuning:1")


def poses(count: int, seed: int = 1) -> np.ndarray:
    """Poses with a swinging tool, whose grab is well above the ground."""
    random = np.random.default_rng(seed)
    low, high = [-3.0, 0.9, -2.2, -0.2, -0.2], [3.0, 1.3, -1.6, 0.2, 0.2]
    return random.uniform(low, high, (count, 5))


@pytest.mark.parametrize("name", ["truck:tuning:0", "hopper:tuning:1", "gantry:tuning:2"])
def test_the_least_distance_is_that_of_an_independent_geometry_package(name: str):
    scene = scene_families.draw(name)
    distances, _ = Field(scene).planes(angles := poses(40))
    true = contacts(scene, angles, SIZES, np.zeros(len(angles))).distance
    mine = distances.min(axis=1)
    apart = true > 0.1  # inside of things both measure depth in their own way
    assert np.count_nonzero(apart) > 10
    assert np.all(mine[apart] - true[apart] > -1e-6)
    assert np.all(mine[apart] - true[apart] < 0.05)


def test_slopes_foresee_the_distance_a_little_further_on():
    field = Field(GAP)
    angles, step = poses(20), np.array([0.01, -0.004, 0.006, 0.01, -0.01])
    here, slopes = field.planes(angles)
    there, _ = field.planes(angles + step)
    foreseen = here + slopes @ step
    assert np.median(np.abs(there - foreseen)) < 0.003


def test_what_there_is_none_of_is_far_away():
    empty = replace(GAP, things=(), zones=())
    distances, slopes = Field(empty).planes(poses(3))
    assert np.all(distances[:, 1] == FAR_M)  # the ground is the only thing
    assert np.all(slopes[:, 1] == 0.0)


def test_the_cost_is_of_the_grab_point_where_the_tool_swings_to():
    residual = cost.of_path().residual[False]
    for angles in poses(20, seed=3) * [1, 1, 1, 0.3, 0.3]:
        x = prediction.rest(*angles[1:3])
        for name, value in zip(cost.POSE, angles, strict=True):
            x[prediction.STATES.index(name)] = value
        still = np.concatenate([angles[:3], [0.0, 0.0]])
        radius, height = kinematics.arm_tip(angles[1], angles[2], kinematics.geometry())
        told = np.zeros(cost.SIZE)
        told[: len(cost.TOLD)] = [0.0, angles[0], radius, height, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
        along, out, up = np.array(residual(x, told)[0]).ravel()[:3]
        away = pose.grab(angles[None], SIZES)[0] - pose.grab(still[None], SIZES)[0]
        c, s = np.cos(angles[0]), np.sin(angles[0])
        np.testing.assert_allclose(
            [along, out], [c * away[1] - s * away[0], c * away[0] + s * away[1]], atol=0.01
        )
        assert up == pytest.approx(0.0, abs=1e-9)


def test_nearer_than_the_distance_to_keep_costs_and_further_away_does_not():
    value = cost.of_path().value[False]
    x, told = prediction.rest(1.1, -2.0), np.zeros(cost.SIZE)
    told[cost.TOLD.index("near")] = 100.0
    assert float(value(x, told)) == 0.0
    told[len(cost.TOLD)] = 0.1  # the first plane: 0.1 m too near
    assert float(value(x, told)) == pytest.approx(1.0)


def test_a_plan_bends_away_from_a_wall_that_the_path_runs_into():
    legs = Legs(Planner(GAP)).foreseen()
    path = legs[0].path
    assert path is not None
    x, y, z = pose.grab(np.append(path.angles[len(path.angles) // 2], [0.0, 0.0])[None], SIZES)[0]
    wall = Box(name="w", middle=(x, y, z / 2), size=(1.0, 1.0, z))
    clear, blocked = (replace(GAP, things=things, zones=()) for things in ((), (wall,)))
    nearest = [_nearest_planned(scene, blocked, path) for scene in (clear, blocked)]
    assert nearest[0] < 0.0 < nearest[1]


def _nearest_planned(known: Scene, true: Scene, path: Path) -> float:
    """The least distance in `true` of the plan that is made half way with only `known` known."""
    driver = Predictive(known)
    tick = len(path.angles) // 2 - 150
    driver.begin(replace(path, angles=path.angles[tick:], rates=path.rates[tick:]))
    sensors = dict(zip(("q_slew", "q_boom", "q_stick"), path.angles[tick], strict=True))
    told = {"load_told": 0.0, "pace": 1.0, "imu_tool_pitch": 0.0, "imu_tool_roll": 0.0}
    for _ in range(10):
        driver.step({**sensors, **told})
    rows = [prediction.STATES.index(name) for name in cost.POSE]
    return float(Field(true).planes(driver.foreseen()[:, rows])[0][:, :2].min())


@pytest.mark.long
def test_it_swings_less_and_is_quicker_than_feed_forward():
    rows = {name: score(run(Case(GAP, name))) for name in ("floor", "nmpc")}
    assert not any(row["contact"] or row["missed"] for row in rows.values())
    for figure in ("tool", "cycle"):
        assert rows["nmpc"][figure] < rows["floor"][figure]


def test_optimal_control_has_the_grab_where_it_is():
    for angles in poses(10):
        x = np.zeros(len(STATES))
        for name, value in zip(cost.POSE, angles, strict=True):
            x[STATES.index(name)] = value
        there = np.array(around.grab(ca.DM(x))).ravel()
        np.testing.assert_allclose(there, pose.grab(angles[None], SIZES)[0], atol=1e-9)


@pytest.mark.long
def test_the_optimum_is_quicker_than_any_run_and_a_wall_costs_time():
    found = best(GAP, 1)
    row = score(run(Case(GAP, "nmpc")))
    assert 1.0 < found["seconds"] < row["cycle"]
    assert ratios([row], {GAP.name: found["seconds"]})["cycle_ratio"] == row["cycle"] / found["seconds"]
    leg = Legs(follower.find("floor").planner(GAP)).foreseen()[0]
    assert leg.path is not None
    open_yard = replace(GAP, things=(), zones=())
    least, converged = Leg(open_yard, leg.path, {"load_mass": 1000.0}).quickest()
    assert converged
    assert least <= found["seconds"] + 0.1


def test_no_ratio_where_no_optimum_was_found_or_a_target_was_missed():
    row = {"scene": "a", "driven": True, "missed": 0, "cycle": 10.0}
    assert ratios([row], {"a": None}) == {"cycle_ratio": None, "cycle_ratio_runs": 0}
    assert ratios([row, {**row, "missed": 1}], {"a": 5.0}) == {"cycle_ratio": 2.0, "cycle_ratio_runs": 1}
