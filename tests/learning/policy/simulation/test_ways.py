"""Targets that move along ways: how the ways go, and what a policy that is led along them is told."""

from dataclasses import replace

import pytest
import torch

from fmus.models.slew_nn.untrained import untrained
from learning.policy.recipe import recipe
from learning.policy.simulation.environment import Environment, without_noise
from learning.policy.simulation.ways import ROUNDED, Pace, ways
from specs.policy import SPACING_S, layout

N, LEAD = 16, 10  # machines; periods


def environment() -> Environment:
    """Nominal machines that are led by one second."""
    led = replace(without_noise(recipe("path", envs=N)), lead_s=LEAD * SPACING_S)
    return Environment(led, [untrained(1, residual=True)], N, 3)


def test_a_way_goes_from_rest_to_rest_through_the_corners_no_faster_than_told() -> None:
    corners = torch.tensor([[0.0, 1.0, -1.2], [1.4, 1.2, -0.9], [1.0, 0.9, -1.5]])[:, :, None]
    pace = Pace(*(torch.tensor([value]) for value in (0.35, 0.1, 2.0)))
    found = ways(corners, pace, 300)[:, :, 0]
    torch.testing.assert_close(found[:, 0], corners[0, :, 0])
    torch.testing.assert_close(found[:, -1], corners[-1, :, 0])
    rates = found.diff(dim=1) / SPACING_S
    assert float(rates[0].abs().max()) <= 0.35 + 1e-5
    assert float(rates[1:].abs().max()) <= 0.1 + 1e-5
    # 1.4 rad at 0.35 rad/s and 0.6 rad at 0.1 rad/s, and what both means last longer
    assert float(found[:, round((4.0 + 6.0 + 2.0 + ROUNDED) / SPACING_S) :].diff(dim=1).abs().max()) < 1e-5
    assert float((rates.diff(dim=1) / SPACING_S)[0].abs().max()) < 0.5


def test_what_is_told_is_where_the_target_that_counts_will_be() -> None:
    """The error to what counts is 0 at first; what is told is ahead; the history turns with it."""
    e = environment()
    s, angles = e.fresh(), list[torch.Tensor]()
    assert float(e.instant(s, s).error.abs().max()) < 1e-4
    for k in range(1, 31):
        s = e.advance(s, torch.zeros(3, N))
        angles.append(s.state.q + s.way[0, k + LEAD])  # about the slew axis, wherever the target is
    seen = dict(zip(layout(e.recipe.history), e.observe(s), strict=True))
    told = s.way[:, 30 + LEAD]
    torch.testing.assert_close(seen["slew_error[0]"] + told[0], angles[-1])
    torch.testing.assert_close(seen["slew_error[-4]"] + told[0], angles[-5], atol=1e-5, rtol=0.0)
    torch.testing.assert_close(seen["target_radius"], told[1])
    torch.testing.assert_close(e.instant(s, s).slew + s.way[0, 30], angles[-1], atol=1e-5, rtol=0.0)


def test_at_the_end_of_a_way_the_target_stands() -> None:
    e = environment()
    s = replace(e.fresh(), age=torch.full((N,), 10_000))
    after = e.advance(s, torch.zeros(3, N))
    torch.testing.assert_close(after.target, s.way[1:, -1])
    torch.testing.assert_close(e.instant(after, after).slew, after.state.q)


def test_a_machine_goes_on_along_a_new_way_from_where_it_is() -> None:
    e = environment()
    s = e.fresh()
    for _ in range(20):
        s = e.advance(s, torch.full((3, N), 0.2))
    again = e.retargeted(s)
    assert float(again.age.max()) == 0.0
    assert float(e.instant(again, again).slew.abs().max()) == pytest.approx(0.0, abs=1e-5)
    torch.testing.assert_close(again.state.tool, s.state.tool)
