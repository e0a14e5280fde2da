"""The URDF, read as another program would: its chain puts the grab where the machine's equations do."""

import math
from xml.etree import ElementTree

import numpy as np
import pytest

from fmus.equations import kinematics
from specs import foxglove, urdf
from specs.signals import signals

ROBOT = ElementTree.fromstring(urdf.render().split("?>", 1)[1])


def numbers(text: str | None) -> np.ndarray:
    return np.array([float(v) for v in (text or "0 0 0").split()])


def place(link: str, angles: dict[str, float]) -> np.ndarray:
    """Pose of a link in the base, by the file alone."""
    carrying = {j.find("child").get("link"): j for j in ROBOT.iter("joint")}  # type: ignore[union-attr]
    pose = np.eye(4)
    while link in carrying:
        joint = carrying[link]
        own = np.eye(4)
        own[:3, 3] = numbers(joint.find("origin").get("xyz"))  # type: ignore[union-attr]
        if joint.get("type") != "fixed":
            own[:3, :3] = turn(numbers(joint.find("axis").get("xyz")), angles[joint.get("name") or ""])  # type: ignore[union-attr]
        pose = own @ pose
        link = joint.find("parent").get("link") or ""  # type: ignore[union-attr]
    return pose


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


@pytest.mark.parametrize("seed", range(5))
def test_grab_is_where_the_equations_put_it(seed: int):
    random, p = np.random.default_rng(seed), kinematics.geometry()
    slew, boom, stick, pitch, roll = random.uniform([-3, 0.6, -2.4, -0.5, -0.5], [3, 1.5, -0.15, 0.5, 0.5])
    angles = {"slew": slew, "boom": boom, "stick": stick, "tool_level": boom + stick}
    radius, height = kinematics.arm_tip(boom, stick, p)
    hanging = kinematics.grab_point(slew, radius, height, p)
    assert np.allclose(place("grab", angles | {"tool_pitch": 0.0, "tool_roll": 0.0})[:3, 3], hanging)
    swung = place("grab", angles | {"tool_pitch": pitch, "tool_roll": roll})[:3, 3]
    own = turn(np.array([0, 1, 0]), pitch) @ turn(np.array([1, 0, 0]), roll) @ [0, 0, -p.tool_length]
    wanted = turn(np.array([0, 0, 1]), slew) @ (np.array([radius, 0, height]) + own)
    assert np.allclose(swung, wanted)


def test_a_grab_swings_as_the_signals_say():
    angles: dict[str, float] = {j.name: 0.0 for j in urdf.joints()}
    at_rest = place("grab", angles)[:3, 3]
    assert (place("grab", angles | {"tool_roll": 0.1})[:3, 3] - at_rest)[1] > 0.1  # towards +y
    assert (place("grab", angles | {"tool_pitch": 0.1})[:3, 3] - at_rest)[0] < -0.1  # towards the slew axis


def test_joints_and_layout_name_signals_that_there_are():
    assert {name for j in urdf.joints() for name in j.angles} <= signals().keys()
    assert {name for _, names in foxglove.PLOTS for name in names} <= signals().keys()
    assert all(len(names) > 1 for _, names in foxglove.PLOTS)
