"""From observation to inputs and from outputs to commands: torch and CasADi agree, angles are right."""

import casadi as ca
import numpy as np
import pytest
import torch

from fmus.equations import kinematics
from learning.policy.features import HOLD_GAIN, Reader, commands, features, joint_errors, limited
from learning.policy.graph import to_torch
from learning.policy.network import Interface
from specs import policy
from specs.errors import InputError


def observations(n: int, history: int = policy.HISTORY) -> np.ndarray:
    """Plausible ones [n, N]."""
    rng = np.random.default_rng(5)
    rows = []
    for _ in range(n):
        seen = policy.History(history)
        for _ in range(history):
            sensors = {name: rng.normal(0, 0.2) for name in policy.SENSORS}
            sensors |= {"q_boom": rng.uniform(0.8, 1.4), "q_stick": rng.uniform(-2.1, -0.3)}
            seen.push(sensors, {name: rng.uniform(-0.2, 0.2) for name in policy.ACTIONS})
        radius, angle = rng.uniform(7, 13), rng.uniform(-3, 3)
        told = {"target_x": radius * np.cos(angle), "target_y": radius * np.sin(angle)}
        told |= {
            "target_z": rng.uniform(3, 9),
            "load_told": rng.uniform(0, 2000),
            "pace": rng.uniform(0.4, 1.4),
        }
        rows.append(seen.observation(told))
    return np.array(rows)


@pytest.mark.parametrize("task", policy.TASKS)
@pytest.mark.parametrize("history", [1, 5])
def test_torch_sees_what_casadi_sees(task: str, history: int) -> None:
    """Inputs and commands of both, to single precision."""
    seen = observations(6, history)
    way = Interface(task, history)
    batch = torch.tensor(seen.T, dtype=torch.float32)
    f = features(task, history)
    expected = np.array([np.array(f(row)).ravel() for row in seen])
    np.testing.assert_allclose(way.features(batch).numpy(), expected, rtol=1e-5, atol=3e-6)
    y = np.random.default_rng(1).normal(0, 2, (6, way.outputs))
    asked = way.asked(torch.tensor(y, dtype=torch.float32), batch)
    c = commands(task, history)
    by_hand = np.array([np.array(limited()(c(a, b))).ravel() for a, b in zip(y, seen, strict=True)])
    np.testing.assert_allclose(way.limited(asked).numpy().T, by_hand, atol=3e-6)
    assert np.abs(by_hand[:, 1:]).max() == pytest.approx(policy.ARM_LIMIT)


def test_joint_errors_are_those_of_the_inverse_kinematics() -> None:
    """2 tan(D / 2) of the angle past the goal, wherever the target can be reached."""
    g, seen = kinematics.geometry(), observations(20)
    for row in seen:
        read = Reader(ca.DM(row), policy.HISTORY)
        found = joint_errors(read)
        radius, z = float(read.now("target_radius")), float(read.now("target_z"))
        _, boom, stick = kinematics.inverse(radius, 0.0, z, g)
        for name, goal in (("q_boom", boom), ("q_stick", stick)):
            assert float(found[name]) == pytest.approx(
                2 * np.tan((float(read.now(name)) - goal) / 2), abs=1e-9
            )


def test_the_slew_policy_holds_the_arm() -> None:
    """Its references bring boom and stick back to the target's pose."""
    row = observations(1)[0]
    found = np.array(commands("slew", policy.HISTORY)(0.3, row)).ravel()
    errors = joint_errors(Reader(ca.DM(row), policy.HISTORY))
    assert found[0] == pytest.approx(0.3)
    np.testing.assert_allclose(found[1:], [-HOLD_GAIN * float(errors[n]) for n in ("q_boom", "q_stick")])


def test_a_leak_lets_gradient_pass_at_a_limit() -> None:
    """Forward the same; backward a share."""
    way = Interface("full", 5)
    asked = torch.tensor([[2.0], [0.1], [0.0]], requires_grad=True)
    way.limited(asked, 0.1).sum().backward()
    np.testing.assert_allclose(way.limited(asked, 0.1).detach(), [[1.0], [0.1], [0.0]])
    assert asked.grad is not None
    np.testing.assert_allclose(asked.grad.numpy(), [[0.1], [1.1], [1.1]])


def test_an_operator_without_counterpart_is_refused() -> None:
    """By name."""
    x = ca.SX.sym("x")
    with pytest.raises(InputError, match="OP_ERF"):
        to_torch(ca.Function("f", [x], [ca.erf(x)]))
