"""Throws: free flight, the pendulum ahead, plans that land where they should."""

import math
import re
from collections.abc import Mapping

import numpy as np
import pytest

from baselines.following.arrival import SENSED
from baselines.planning.planner import pose_of
from baselines.throwing.ballistics import ahead, flight
from baselines.throwing.plan import plan, reach, span
from baselines.throwing.thrower import TICK_S, Thrower
from fmus.equations import kinematics
from specs import parameters, pose, shapes
from specs.errors import InputError
from specs.scenario import Target

START = pose_of(Target(slew_deg=0.0, radius_m=9.5, height_m=3.5))
SIZES = shapes.sizes()
GRAVITY = kinematics.geometry().gravity


def test_a_load_flies_a_parabola():
    landed = flight(np.array([10.0, 1.0, 5.0]), np.array([-2.0, 3.0, 1.0]))
    assert 5.0 + landed.seconds - GRAVITY / 2 * landed.seconds**2 == pytest.approx(0.0, abs=1e-9)
    assert landed.place == pytest.approx([10.0 - 2.0 * landed.seconds, 1.0 + 3.0 * landed.seconds])


def test_what_hangs_still_stays_where_it_is():
    angles = np.array([0.4, 1.1, -1.9, 0.0, 0.0])
    place, speed = ahead(angles, np.zeros(5), 0.5, SIZES)
    assert place == pytest.approx(pose.grab(angles, SIZES)[0], abs=1e-6)
    assert speed == pytest.approx(np.zeros(3), abs=1e-6)


def steady_tilt(rate: float, boom: float, stick: float) -> float:
    """How far the grab hangs outwards while the slew turns at a rate."""
    radius, _ = kinematics.arm_tip(boom, stick, kinematics.geometry())
    tilt = 0.0
    for _ in range(50):
        tilt = math.atan(rate**2 * (radius + SIZES["tool_length"] * math.sin(tilt)) / GRAVITY)
    return tilt


def test_a_grab_that_is_carried_outwards_as_its_turn_wants_goes_on_in_its_circle():
    rate, boom, stick = 0.4, 1.0, -1.2
    radius, _ = kinematics.arm_tip(boom, stick, kinematics.geometry())
    angles = np.array([0.0, boom, stick, -steady_tilt(rate, boom, stick), 0.0])  # outwards
    place, speed = ahead(angles, np.array([rate, 0.0, 0.0, 0.0, 0.0]), 0.4, SIZES)
    turned = pose.grab(angles + np.array([0.4 * rate, 0.0, 0.0, 0.0, 0.0]), SIZES)[0]
    assert math.hypot(*turned[:2]) > radius
    assert place == pytest.approx(turned, abs=0.02)
    assert speed == pytest.approx([-rate * turned[1], rate * turned[0], 0.0], abs=0.1)


@pytest.mark.parametrize("beyond", [-3.0, 0.0, 2.0])
@pytest.mark.parametrize("turn", [-2.0, 0.3, 3.0])
def test_the_planned_path_throws_onto_the_target(beyond: float, turn: float):
    away = reach() + beyond
    target = (away * math.cos(turn), away * math.sin(turn))
    throw = plan(START, target)
    angles = throw.path.angles
    at = int(np.argmin(np.abs(angles[:, 0] - throw.slew)))
    hanging = pose.grab(np.hstack([angles, np.zeros((len(angles), 2))]), SIZES)
    landed = flight(hanging[at], np.gradient(hanging, 0.02, axis=0)[at])
    assert landed.place == pytest.approx(target, abs=0.1)
    g = {name: p.value for name, p in parameters.load("throwing", "planning").items()}
    assert np.abs(throw.path.rates[:, 0]).max() <= g["throw_slew_speed"] + 1e-6
    assert np.abs(throw.path.rates[:, 1:]).max() <= g["path_arm_speed"] + 1e-6
    assert angles[0] == pytest.approx(START)
    assert throw.path.rates[[0, -1]] == pytest.approx(np.zeros((2, 3)), abs=1e-3)


@pytest.mark.parametrize("away", [3.0, 25.0])
def test_a_place_that_no_throw_reaches_is_refused_with_those_that_are(away: float):
    with pytest.raises(InputError, match=r"valid: [\d.]+ to [\d.]+ m") as said:
        plan(START, (away, 0.0))
    for end in re.findall(r"[\d.]+", str(said.value).partition("valid: ")[2]):
        plan(START, (float(end), 0.0))  # what is said to be valid is
    assert span()[1] > reach() + 2.0


class Still:
    """A follower that has nothing to do."""

    ended = True

    def begin(self, path: object) -> None:
        pass

    def step(self, sensors: Mapping[str, float]) -> Mapping[str, float]:
        return {}


@pytest.mark.parametrize("share", [0.8, 1.0, 1.1])
def test_the_grab_opens_once_so_that_the_load_lands_beside_the_target(share: float):
    """Whatever the plan was: the slew may be slower or faster, and the gyros of a tilted tool see it."""
    target = (0.0, reach() + 1.0)
    throw = plan(START, target)
    thrower = Thrower(throw, target, Still())
    rate, (_, boom, stick) = share * throw.speed, throw.path.angles[-1]
    tilt = steady_tilt(rate, boom, stick)
    begin = throw.slew - math.copysign(1.5, rate)

    def angles(tick: float) -> np.ndarray:
        return np.array([begin + rate * tick * TICK_S, boom, stick, -tilt, 0.0])

    released = None
    for tick in range(400):
        values = dict(zip(SENSED, angles(tick), strict=True))
        gyros = {"imu_cabin_rate_z": rate, "imu_tool_rate_y": 0.0, "imu_tool_rate_x": rate * math.sin(tilt)}
        thrower.step({**values, **gyros, "qd_boom": 0.0, "qd_stick": 0.0})
        released = tick if thrower.released and released is None else released
    assert released is not None
    delay = parameters.parameter("grab_open_delay", "grab").value
    leaves = released + 1 + delay / TICK_S
    around = pose.grab(np.stack([angles(leaves - 0.05), angles(leaves + 0.05)]), SIZES)
    landed = flight(around.mean(axis=0), (around[1] - around[0]) / (0.1 * TICK_S)).place
    beside = math.atan2(*landed[::-1]) - math.pi / 2
    speed = float(np.hypot(*(around[1] - around[0])[:2])) / (0.1 * TICK_S)
    assert abs(beside) * np.hypot(*landed) < 0.6 * TICK_S * speed  # half a tick: it opens in whole ones
