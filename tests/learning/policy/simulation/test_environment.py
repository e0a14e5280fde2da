"""The environment: starts, targets, sensors, terminations and what is random."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from fmus.equations import kinematics
from fmus.models.slew_nn.network import SlewNetwork
from fmus.models.slew_nn.untrained import untrained
from learning.policy.recipe import recipe
from learning.policy.simulation.environment import LATE, Environment, without_noise
from specs import policy

N = 64
NETWORK = untrained(1, residual=True)


def environment(task: str = "full", **changed: object) -> Environment:
    """A small one with perfect sensors on nominal machines, unless changed."""
    base = without_noise(recipe(task, envs=N, consecutive=0.0))
    return Environment(replace(base, **changed), [NETWORK], N, 3)  # type: ignore[arg-type]


def read(e: Environment, observation: torch.Tensor) -> dict[str, torch.Tensor]:
    """An observation by the names of the layout."""
    return dict(zip(policy.layout(e.recipe.history), observation, strict=True))


def test_starts_at_rest_in_the_pose_range() -> None:
    """Poses, targets and slew errors inside their ranges; the tool hangs; histories are the first sensors."""
    e = environment()
    s = e.fresh()
    seen = read(e, e.observe(s))
    assert float(s.state.tool.abs().max()) == 0.0
    assert bool(((seen["q_boom[0]"] >= 0.8) & (seen["q_boom[0]"] <= 1.4)).all())
    assert torch.equal(seen["q_boom[0]"], seen["q_boom[-4]"])
    assert float(seen["slew_error[0]"].abs().max()) <= 2.5
    assert float(seen["slew_error[0]"].min()) < 0 < float(seen["slew_error[0]"].max())
    assert not bool(e.ended(s).any())
    g = kinematics.geometry()
    for radius, z in zip(seen["target_radius"].tolist(), seen["target_z"].tolist(), strict=True):
        assert kinematics.reachable(radius, 0.0, z, g) is None


def test_the_observation_is_that_of_the_contract() -> None:
    """Rolled out, an environment's history is what specs/policy.py's History makes of the same sensors."""
    e = environment()
    s, history = e.fresh(), policy.History(e.recipe.history)
    generator = torch.Generator().manual_seed(1)
    held: dict[str, float] = dict.fromkeys(policy.ACTIONS, 0.0)
    for _ in range(7):
        row = {n: float(v[0]) for n, v in zip(policy.CHANNELS, s.sensors[:, -1], strict=True)}
        row["q_slew"] = row.pop("slew_error")
        history.push(row, held)
        action = torch.rand(3, N, generator=generator) * 0.4 - 0.2
        held = dict(zip(policy.ACTIONS, action[:, 0].tolist(), strict=True))
        last, s = s, e.advance(s, action)
    told = {
        "target_x": float(last.target[0, 0]), "target_y": 0.0, "target_z": float(last.target[1, 0]),
        "load_told": float(last.told[0]), "pace": 1.0,
    }  # fmt: skip
    np.testing.assert_allclose(e.observe(last)[:, 0], history.observation(told), atol=2e-6)


def test_arm_rates_are_late_and_the_gyro_is_not() -> None:
    """Encoder rates of the arm show what was LATE periods ago."""
    e = environment()
    s, rates = e.fresh(), []
    for _ in range(8):
        s = e.advance(s, torch.full((3, N), 0.15))
        rates.append(s.state.arm[2])
    seen = read(e, e.observe(s))
    assert torch.equal(seen["qd_boom[0]"], rates[-1 - LATE])
    assert torch.equal(seen["imu_cabin_rate_z[0]"], s.state.omega[-1])


def test_gyro_and_tool_rates_pass_a_filter() -> None:
    """A filter of a half shows the mean of what it showed and what is; angles are not filtered."""
    e = environment()
    s = e.fresh()
    s.machine.rate_filter = torch.full((N,), 0.5)
    for _ in range(6):
        before, s = read(e, e.observe(s)), e.advance(s, torch.full((3, N), 0.2))
    seen = read(e, e.observe(s))
    rates = {"imu_cabin_rate_z[0]": s.state.omega[-1], "imu_tool_rate_x[0]": s.state.tool[2]}
    for name, now in rates.items():
        assert torch.allclose(seen[name], (before[name] + now) / 2, atol=1e-6)
    assert torch.equal(seen["imu_tool_roll[0]"], s.state.tool[0])


def test_a_family_has_each_network_four_times() -> None:
    """As it is and mirrored, late and taken forward; every one drives an equal share of the machines."""
    recipe_of = without_noise(recipe("family", envs=N))
    e = Environment(recipe_of, [NETWORK, untrained(2, (24, 16), (16,))], N, 3)
    assert [m.ahead for m in e.members] == [0, 0, 2, 2] * 2
    assert [group.count for group in e.plant.drive.groups] == [4, 4]
    s = e.fresh()
    after = e.advance(s, torch.full((3, N), 0.3))
    assert torch.isfinite(after.state.omega).all()
    assert e.unknown(after).shape == (N,)


def test_a_new_target_turns_the_whole_history() -> None:
    """Differences in the history stay; the error starts anew; the machine goes on swinging."""
    e = environment()
    s = e.fresh()
    for _ in range(6):
        s = e.advance(s, torch.full((3, N), 0.2))
    after = e.retargeted(s)
    old, new = read(e, e.observe(s)), read(e, e.observe(after))
    turn = after.state.q - s.state.q
    assert torch.allclose(new["slew_error[-3]"] - old["slew_error[-3]"], turn, atol=1e-6)
    assert torch.equal(after.state.tool, s.state.tool)
    assert torch.equal(after.start, after.state.q)
    assert not torch.equal(after.target, s.target)


def test_slew_only_keeps_arm_and_place() -> None:
    """The target hangs below the arm's tip; the arm does not move, whatever its references."""
    e = environment("slew")
    s = e.fresh()
    assert float(e.error(replace(s, state=replace(s.state, q=torch.zeros(N)))).abs().max()) < 1e-5
    after = e.advance(s, torch.full((3, N), 0.2))
    assert torch.equal(after.state.arm[:2], s.state.arm[:2])
    instant = e.instant(s, after)
    assert instant.error.shape == (1, N)
    assert instant.action.shape == (1, N)


def test_terminations_too_low_and_too_near() -> None:
    """2 m above the ground and 2 m from the axis (geometry.toml), the swinging grab's own point."""
    e = environment()
    s = e.fresh()
    low = s.state.arm.clone()
    low[0], low[1] = 0.6, -2.4
    g = kinematics.geometry()
    radius, height = kinematics.arm_tip(0.6, -2.4, g)
    expected = height - g.tool_length < g.keepout_height or radius < g.keepout_radius
    assert expected
    assert bool(e.ended(replace(s, state=replace(s.state, arm=low))).all())


def test_noise_and_machines_are_random_and_can_be_switched_off() -> None:
    """Observations of one situation differ by the noise alone; off, they do not; a seed repeats itself."""
    noisy = Environment(recipe("full", envs=N), [NETWORK], N, 3)
    again = Environment(recipe("full", envs=N), [NETWORK], N, 3)
    s, t = noisy.fresh(), again.fresh()
    assert torch.equal(noisy.observe(s), again.observe(t))
    assert float(s.machine.load.std()) > 300
    assert float(s.machine.named("tool_length_x").std()) > 0.1
    assert 0 < int((s.told == 0).sum()) < N
    still = torch.zeros(3, N)
    roll = policy.CHANNELS.index("imu_tool_roll")
    angles = [noisy.advance(s, still).sensors[roll, -1] for _ in range(50)]
    assert float(torch.stack(angles).std(0).mean()) == pytest.approx(0.002, rel=0.1)
    quiet = environment()
    q = quiet.fresh()
    once, twice = (quiet.observe(quiet.advance(q, still)) for _ in range(2))
    assert torch.equal(once, twice)
    assert float(q.machine.load.abs().max()) == 0.0


def test_a_swinging_start() -> None:
    """The option: a share of the starts swings."""
    s = environment(swinging=0.5).fresh()
    moving = s.state.tool[:4].abs().sum(0) > 0
    assert 0.2 < float(moving.float().mean()) < 0.8


def test_taking_off_the_encoders_delay_makes_the_slew_move_earlier() -> None:
    """With `ahead_s` 0.2 the trained networks' carriage answers a step two periods earlier."""
    network = SlewNetwork.load(
        Path(__file__).resolve().parents[4] / "fmus" / "models" / "slew_nn" / "weights.npz"
    )
    first = {}
    for ahead in (0.0, 0.2):
        e = Environment(replace(environment().recipe, ahead_s=ahead), [network], 1, 3)
        s, speeds = e.fresh(), []
        for _ in range(20):
            s = e.advance(s, torch.tensor([[0.8], [0.0], [0.0]]))
            speeds.append(float(s.state.omega[-1]))
        first[ahead] = next(k for k, w in enumerate(speeds) if w > math.radians(3))
    assert first[0.0] - first[0.2] == 2
