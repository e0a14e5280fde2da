"""Forward kinematics and shapes of the machine."""

import math

import casadi as ca
import numpy as np
import pytest

from fmus.equations import kinematics, multibody
from fmus.models.machine.model import MODEL
from specs import pose, shapes, urdf

SIZES = shapes.sizes()


@pytest.mark.parametrize("seed", range(4))
def test_the_grab_is_where_the_reference_machines_equations_have_it(seed: int):
    random = np.random.default_rng(seed)
    angles = random.uniform([-3, 0.6, -2.4, -0.5, -0.5], [3, 1.5, -0.15, 0.5, 0.5])
    symbols = [ca.SX.sym(f"q{k}") for k in range(5)]
    grab = multibody.motion(symbols, [0] * 5, MODEL.namespaces[3]).grab
    own = ca.Function("grab", [ca.vertcat(*symbols), MODEL.symbols[3]], [grab])
    x, y, z = np.array(own(angles, MODEL.start_parameters())).ravel()
    c, s = math.cos(angles[0]), math.sin(angles[0])  # the equations are written in the slewing frame
    assert np.allclose(pose.grab(angles, SIZES)[0], [c * x - s * y, s * x + c * y, z], atol=1e-12)


def test_frames_of_many_poses_are_those_of_each():
    angles = np.random.default_rng(0).uniform(-1, 1, (7, 5))
    together = pose.grab(angles, SIZES)
    assert np.array_equal(together, np.vstack([pose.grab(row, SIZES) for row in angles]))


def test_boom_and_stick_are_as_long_as_the_geometry_says():
    found = pose.frames(np.array([[0.4, 1.1, -1.5, 0.0, 0.0]]), SIZES)
    lengths = {c.name: np.linalg.norm(np.subtract(*pose.ends(found, c))) for c in shapes.capsules()}
    p = kinematics.geometry()
    assert lengths["boom"] == pytest.approx(p.boom_length)
    assert lengths["stick"] == pytest.approx(p.stick_length)
    assert lengths["lines"] == pytest.approx(p.tool_length)


@pytest.mark.parametrize("name", ["boom", "stick"])
def test_a_capsule_holds_the_section_that_is_drawn(name: str):
    box = next(b for b in urdf.bodies() if b.name == name)
    capsule = next(c for c in shapes.capsules() if c.name == name)
    assert capsule.radius >= math.hypot(*box.size[1:]) / 2 - 1e-12
