"""A machine that turns the other way is its mirror image, and is driven so."""

from pathlib import Path

import numpy as np
import pytest
import torch

from fmus.models.slew.model import MODEL
from specs.policy import ACTIONS, CHANNELS, LIMITS, ONCE
from tests.fmus.models.test_slew import FREE, HELD, STATES, points
from tests.fmus.models.test_slew_nn import KINDS, build_from, by_fmu, commands
from tests.learning.policy.test_network import built, observations

MIRROR = {"p_a": "p_b", "p_b": "p_a"}


@pytest.mark.parametrize("mode", [FREE, HELD])
def test_left_and_right_are_exact_mirror_images(mode):
    p = MODEL.start_parameters()
    for x, u in points(50):
        other = u * [-1, 1, 1, -1]
        here, there = (np.array(MODEL.f(*z, mode, p)).ravel() for z in ((x, u), (mirrored(x), other)))
        assert np.array_equal(mirrored(here), there)


def mirrored(x: np.ndarray) -> np.ndarray:
    sign = [1.0 if n in MIRROR else -1.0 for n in STATES]
    return np.array(sign) * x[[STATES.index(MIRROR.get(n, n)) for n in STATES]]


def test_a_symmetric_network_turns_alike_both_ways(tmp_path: Path) -> None:
    fmu = build_from(KINDS["symmetric"], "symmetric", tmp_path)
    u, inertia = commands()
    there, back = by_fmu(fmu, u, inertia), by_fmu(fmu, -u, inertia)
    np.testing.assert_allclose(back, there[:, [0, 1, 3, 2]] * [-1, -1, 1, 1], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("task", ["slew", "full"])
def test_a_mirrored_machine_is_driven_in_a_mirror(task: str) -> None:
    """Slew, roll and their rates turned: the joystick turns, the arm does the same."""
    way, mlp = built(task, "mirror")
    seen = observations(5)
    odd = {"u_slew", "slew_error", "imu_tool_roll", "imu_cabin_rate_z", "imu_tool_rate_x"}
    turn = torch.tensor([-1.0 if n in odd else 1.0 for n in CHANNELS for _ in range(5)] + [1.0] * len(ONCE))
    here, there = (way.asked(mlp(way.features(x)), x).detach() for x in (seen, seen * turn[:, None]))
    np.testing.assert_allclose(there, here * torch.tensor([-1.0, 1.0, 1.0])[:, None], atol=1e-5)
    assert set(LIMITS) == set(ACTIONS)
