"""A policy that sees its way and things, in scenes: it sees there what it saw in training."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

pytest.importorskip("coal", reason="pip install 'slewright[scenes]'")
pytest.importorskip("ompl", reason="pip install 'slewright[scenes]'")
pytest.importorskip("toppra", reason="pip install 'slewright[scenes]'")

from baselines.planning.path import Path as Way, of_angles
from baselines.planning.planner import hanging
from deployment.bundling import policy as bundling
from learning.policy import export
from learning.policy.gradient import begin
from learning.policy.network import Interface, shaped, weights_of
from learning.policy.recipe import recipe
from specs.errors import InputError
from specs.policy import ACTIONS, CHANNELS, SENSORS, SLEW_ERROR, contract, layout
from tests.learning.policy.simulation.test_field import BOXES, SCENE, N, environment, things_of
from verification.evaluation import policies
from verification.scenes import run
from verification.scenes.seeing import PERIOD, Seeing

RECIPE = recipe("path_field")
AGE = 4  # periods


def seeing() -> export.Policy:
    """`path.onnx` with all inputs of the recipe; those that are new count for nothing."""
    way = Interface(RECIPE.task, RECIPE.history, RECIPE.prior, ahead=RECIPE.ahead)
    mlp = shaped(RECIPE, way)
    begin(mlp, RECIPE, way)
    seen = {"waypoints_s": RECIPE.waypoints_s, "field_m": RECIPE.field_m}
    return export.Policy(contract("full", lead_s=RECIPE.lead_s, **seen), weights_of(mlp))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That policy."""
    return export.write(seeing(), tmp_path_factory.mktemp("seeing") / "seeing.onnx")


def path(start: float) -> Way:
    """Slew, boom and stick from one pose to another, about the wall of SCENE."""
    share = np.linspace(0.0, 1.0, 300)[:, None]
    angles = np.array([start, 1.1, -1.6]) + share * np.array([0.5, 0.1, -0.2])
    return of_angles(angles, np.zeros((1, 3)), 0.3)


@pytest.mark.parametrize("start", [-0.2, 3.0])
def test_it_sees_what_it_saw_in_training(start: float) -> None:
    """Every entry of an observation, at random sensors, among the same boxes on the same way.

    But for few slopes: where two places of a part are as near, either may be taken.
    """
    e, way = environment(), hanging(path(start))
    x, y, z = torch.tensor(way[::PERIOD], dtype=torch.float32).T
    places = torch.stack([torch.atan2(y, x), torch.hypot(x, y), z])
    places[0] = torch.tensor(np.unwrap(places[0].numpy()))
    s = e.fresh()
    s = replace(s, way=places[:, :, None].expand(-1, -1, N), things=things_of(BOXES, N), age=0 * s.age + AGE)
    s = replace(s, target=e.told(s)[1:])
    sensed = s.sensors[:, -1].clone()
    sensed[CHANNELS.index(SLEW_ERROR)] = places[0, AGE] - e.told(s)[0] + 0.1 * torch.randn(N)
    s = replace(s, sensors=sensed[:, None].expand(-1, RECIPE.history, -1))
    theirs = e.observe(s).numpy().T
    ours = np.array([observed(s, sensed[:, k], float(e.told(s)[0, k]), start, k) for k in range(N)])
    slope = np.array(["_by_" in name for name in layout(RECIPE.history, RECIPE.ahead)])
    np.testing.assert_allclose(ours[:, ~slope], theirs[:, ~slope], atol=2e-3)
    off = np.abs(ours - theirs)[:, slope] > 0.05
    assert off.any(axis=1).mean() <= 0.2
    assert np.abs(theirs[:, slope]).max() > 1.0


def observed(s, sensed, told: float, start: float, k: int) -> list[float]:
    """What the follower sees of machine k's sensors AGE periods after the path began."""
    values = dict(zip(CHANNELS, sensed.tolist(), strict=True))
    sensors = {name: values[SLEW_ERROR if name == "q_slew" else name] for name in SENSORS}
    sensors["q_slew"] += told
    driver = Seeing(SCENE, seeing())
    driver.begin(path(start))
    driver._arrival.tick = AGE * PERIOD
    for _ in range(RECIPE.history):
        driver._history.push(sensors, {name: values[name] for name in ACTIONS})
    return driver.observation({**sensors, "load_told": float(s.told[k]), "pace": float(s.pace[k])})


def test_it_answers_ten_times_a_second_and_needs_a_path() -> None:
    driver = Seeing(SCENE, seeing())
    sensors = dict.fromkeys(SENSORS, 0.0) | {"q_boom": 1.1, "q_stick": -1.6, "load_told": 0.0, "pace": 1.0}
    with pytest.raises(InputError, match="needs a path"):
        driver.step(sensors)
    driver.begin(path(0.0))
    asked = [driver.step(sensors) for _ in range(2 * PERIOD + 1)]
    assert all(one is asked[0] for one in asked[:PERIOD])
    assert asked[PERIOD] is not asked[0]
    assert set(asked[0]) == set(ACTIONS)


def test_where_there_is_no_scene_it_is_refused(file: Path) -> None:
    """And in scenes it is led, never sent straight to a target."""
    for standing in (policies.task_of, policies.controllers):
        with pytest.raises(InputError, match=r"led along a planned path.* --controller .*seeing.onnx@path"):
            standing([file])
    with pytest.raises(InputError, match=r"seeing.onnx: .*no signal tells"):
        bundling.content(file, "native")
    with pytest.raises(InputError, match=r"say .*seeing.onnx@path"):
        run.check(str(file))
    run.check(f"{file}{run.LED}")


def test_who_sees_follows_and_who_does_not_is_led(file: Path) -> None:
    case = run.Case(SCENE, f"{file}{run.LED}")
    assert isinstance(run.seeing(case), Seeing)
    assert run.seeing(replace(case, controller="learning/policies/path.onnx@path")) is None
    assert run.seeing(replace(case, controller="pd@path")) is None


@pytest.mark.long
def test_with_new_inputs_that_count_for_nothing_it_drives_as_the_policy_it_was(file: Path) -> None:
    """As a follower beside the machine, or as a model within it: within what a tick more or less makes."""
    from specs import scene_families
    from verification.scenes.score import score

    scene = scene_families.draw("pole:tuning:0")
    names = (f"{file}{run.LED}", f"learning/policies/path.onnx{run.LED}")
    ours, theirs = (score(run.run(run.Case(scene, name))) for name in names)
    assert ours["missed"] == theirs["missed"] == 0
    assert ours["cycle"] == pytest.approx(theirs["cycle"], abs=0.5)
    assert ours["clearance"] == pytest.approx(theirs["clearance"], abs=0.1)
