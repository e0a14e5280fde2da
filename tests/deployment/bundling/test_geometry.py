"""Walls and reach in the core are those of fmus.equations.kinematics."""

import numpy as np
import pytest

from deployment.bundling.config import geometry
from fmus.equations import kinematics

GEOMETRY = geometry()


def walls(joints: np.ndarray) -> np.ndarray:
    """[wall, (distance, rate, by boom, by stick)]."""
    return np.array(GEOMETRY(joints, [8.0, 0.0, 5.0])[0]).T


def test_reach_says_what_kinematics_says() -> None:
    random = np.random.default_rng(1)
    points = random.uniform([-18, -18, 0], [18, 18, 14], (3000, 3))
    told = [float(GEOMETRY([0.0, 1.2, -1.5, 0.0, 0.0], p)[2]) >= 0.0 for p in points]
    known = [kinematics.reachable(*p) is None for p in points]
    assert 0.1 < np.mean(known) < 0.9
    assert told == known


def test_distance_is_that_of_the_hanging_grab() -> None:
    g, joints = kinematics.geometry(), np.array([0.7, 1.2, -1.5, 0.0, 0.0])
    point = np.array(kinematics.grab_point(0.7, *kinematics.arm_tip(1.2, -1.5, g), g), dtype=float)
    assert float(GEOMETRY(joints, point + np.array([0.3, 0.0, 0.4]))[1]) == pytest.approx(0.5)


def test_walls_are_distances_with_their_gradients_and_rates() -> None:
    g, step = kinematics.geometry(), 1e-6
    joints = np.array([0.3, 1.1, -1.4, 0.13, -0.21])
    here = walls(joints)
    radius, tip = (float(v) for v in kinematics.arm_tip(1.1, -1.4, g))
    wanted = [tip - g.tool_length - g.keepout_height, radius - g.keepout_radius]
    wanted += [1.1 - g.boom_min, g.boom_max - 1.1, -1.4 - g.stick_min, g.stick_max + 1.4]
    assert here[:, 0] == pytest.approx(wanted)
    for joint in (1, 2):
        moved = joints.copy()
        moved[joint] += step
        assert (walls(moved)[:, 0] - here[:, 0]) / step == pytest.approx(here[:, joint + 1], abs=1e-5)
    assert here[:, 1] == pytest.approx(here[:, 2] * 0.13 + here[:, 3] * -0.21)
