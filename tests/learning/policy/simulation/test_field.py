"""Distances to things in training: those that a scene's field has; drawn things leave the ways free."""

from dataclasses import replace

import numpy as np
import torch

from baselines.nmpc_path.field import Field as SceneField
from fmus.models.slew_nn.untrained import untrained
from learning.policy.recipe import recipe
from learning.policy.simulation import things
from learning.policy.simulation.ahead import near
from learning.policy.simulation.environment import Environment
from learning.policy.simulation.field import ROWS, Field, ground, to_boxes
from learning.policy.simulation.situation import Situation
from specs import scene_families
from specs.policy import layout
from specs.scene import Box

N = 16
BOXES = (
    Box(name="wall", middle=(9.0, 2.0, 2.0), size=(0.6, 3.0, 4.0), turn_deg=30.0),
    Box(name="beam", middle=(6.0, -3.0, 7.0), size=(4.0, 0.5, 0.8), turn_deg=-70.0),
)
SCENE = replace(scene_families.draw("gap:tuning:1"), things=BOXES, zones=())


def things_of(boxes: tuple[Box, ...], n: int) -> torch.Tensor:
    """The boxes and the ground for each of n machines [boxes + 1, ROWS, n]."""
    rows = []
    for box in boxes:
        turn = np.radians(box.turn_deg)
        row = [*box.middle, *(side / 2 for side in box.size), np.cos(turn), np.sin(turn)]
        rows.append(torch.tensor(row, dtype=torch.float32)[:, None].expand(ROWS, n))
    return torch.cat([torch.stack(rows), ground(n)])


def poses(n: int) -> np.ndarray:
    """Random ones (n, 5), rad."""
    low, high = np.array([(-2.0, 2.0), (0.8, 1.4), (-2.1, -0.3), (-0.3, 0.3), (-0.3, 0.3)]).T
    return np.random.default_rng(4).uniform(low, high, (n, 5))


def environment() -> Environment:
    """Machines that see all that there is, among things."""
    return Environment(recipe("path_field", envs=N), [untrained(1, residual=True)], N, 3)


def test_distances_and_slopes_are_those_of_the_scene_s_own_field() -> None:
    angles = poses(200)
    wanted, slopes = SceneField(SCENE).planes(angles)
    found, by_pose = Field().planes(torch.tensor(angles.T, dtype=torch.float32), things_of(BOXES, 200))
    np.testing.assert_allclose(found.numpy().T, wanted, atol=1e-4)
    off = np.abs(by_pose.permute(2, 0, 1).numpy() - slopes)
    assert np.quantile(off, 0.99) < 0.03  # m/rad; beside an edge the nearest ball may be another one
    assert float(wanted.min()) < 0.0 < float(np.abs(slopes).max())


def test_no_way_passes_a_thing_nearer_than_the_least_gap() -> None:
    """With the tool hanging; and things are near enough to matter."""
    e = environment()
    s = e.fresh()
    assert s.things.shape == (things.COUNT + 1, ROWS, N)
    nearest = []
    for k in range(0, s.way.shape[1], things.STRIDE):
        q, radius, z = s.way[:, k]
        grab = torch.stack([radius * torch.cos(q), radius * torch.sin(q), z])
        nearest.append(to_boxes(grab[:, None], s.things[:-1].transpose(0, 1)).amin(0))
    least = torch.stack(nearest).amin(0)
    assert float(least.min()) > things.GAP[0]
    assert float((least < 3.0).float().mean()) > 0.3


def test_a_machine_that_goes_on_has_new_things_beside_its_new_way() -> None:
    e = environment()
    s = e.fresh()
    for _ in range(3):
        s = e.advance(s, torch.full((3, N), 0.2))
    again = e.retargeted(s)
    assert again.things.shape == s.things.shape
    assert not torch.equal(again.things, s.things)
    torch.testing.assert_close(again.things[-1], s.things[-1])  # the ground


def test_what_a_thing_costs_has_a_slope_by_where_the_machine_is() -> None:
    """The gradient of the distance is the change that a small move makes."""
    e = environment()
    s = replace(e.fresh(), things=things_of(BOXES, N))
    told = e.told(s)[0]

    def beside(move: float) -> Situation:
        q = (s.state.q + move).requires_grad_()
        return replace(s, state=replace(s.state, q=q))

    here, there = beside(0.0), beside(1e-3)
    assert e.field
    distance = near([here], [told], e.field)
    (slope,) = torch.autograd.grad(distance.sum(), [here.state.q])
    changed = ((near([there], [told], e.field) - distance) / 1e-3).detach().sum(0)
    assert told.shape == slope.shape
    assert float((slope - changed).abs().median()) < 0.05


def test_the_way_s_places_are_behind_ahead_and_at_the_target_that_is_told() -> None:
    e = environment()
    s = e.fresh()
    for _ in range(10):
        s = e.advance(s, torch.full((3, N), 0.1))
    seen = dict(zip(layout(e.recipe.history, e.ahead), e.observe(s), strict=True))
    angle = seen["slew_error[0]"] + s.way[0, 10 + e.lead]
    for seconds in e.ahead.waypoints_s:
        place = s.way[:, 10 + round(10 * seconds)]
        torch.testing.assert_close(seen[f"way_slew[{seconds:g}]"], angle - place[0])
        torch.testing.assert_close(seen[f"way_radius[{seconds:g}]"], place[1])
        torch.testing.assert_close(seen[f"way_z[{seconds:g}]"], place[2])
    assert float(seen["arm_distance"].max()) <= e.ahead.field_m
