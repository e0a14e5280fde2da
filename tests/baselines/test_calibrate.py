"""Calibration: curves are inverted as they should be, the shipped tables and arm fit the machine."""

import numpy as np
import pytest

from baselines.arm_velocity import calibrate, identify
from baselines.arm_velocity.model import JOINTS, POINTS
from baselines.bench import arm_loop, bare_machine
from orchestrator.system.system import System
from specs import parameters

GRID = np.linspace(-0.2, 0.2, POINTS)
DEAD_BAND = {1: 0.15, -1: 0.12}


def _curve(levels: np.ndarray, top: float = 0.3) -> np.ndarray:
    """Speeds of a made-up joint: a dead band of its own on each side, then a parabola."""
    past = np.where(levels > 0, levels - DEAD_BAND[1], -levels - DEAD_BAND[-1])
    past = np.maximum(past, 0.0)
    return np.sign(levels) * top * (0.8 * past + 0.4 * past**2)


def test_inverting_a_known_curve_gives_back_its_speeds() -> None:
    levels = np.concatenate([-calibrate.LEVELS[::-1], calibrate.LEVELS])
    values = np.array(calibrate.invert(levels, _curve(levels)))
    assert len(values) == POINTS
    assert values[POINTS // 2] == 0.0
    assert np.all(np.diff(values) > 0)
    np.testing.assert_allclose(_curve(values), GRID, atol=2e-4)


def test_noise_in_the_sweep_leaves_the_table_monotone() -> None:
    levels = np.concatenate([-calibrate.LEVELS[::-1], calibrate.LEVELS])
    noise = 0.004 * np.random.default_rng(1).standard_normal(len(levels))
    values = calibrate.invert(levels, _curve(levels) + noise)
    assert np.all(np.diff(values) > 0)


def test_speeds_out_of_reach_get_full_joystick() -> None:
    levels = np.concatenate([-calibrate.LEVELS[::-1], calibrate.LEVELS])
    values = calibrate.invert(levels, _curve(levels, top=0.15))
    assert (values[0], values[-1]) == (-1.0, 1.0)


@pytest.fixture(scope="module")
def machine() -> System:
    return bare_machine([f"q_{joint}" for joint in JOINTS])


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("point", [2, 9, 15, 22])
def test_shipped_table_drives_the_machine_at_its_speed(machine: System, joint: str, point: int) -> None:
    known = {name: p.value for name, p in parameters.load("arm_velocity").items()}
    speeds, values = calibrate.table(known, joint)
    measured = calibrate.settled_speed(machine, joint, float(values[point]))
    assert measured == pytest.approx(speeds[point], rel=0.03, abs=0.002)


@pytest.mark.parametrize(("delay", "response"), [(5, 0.1), (13, 0.6), (20, 0.3)])
def test_fit_finds_a_known_arm(delay: int, response: float) -> None:
    known = identify.model(delay, response, identify.LENGTH)
    assert identify.fit(known[None, :])[:2] == (delay, pytest.approx(response))


@pytest.mark.parametrize("joint", JOINTS)
def test_shipped_arm_follows_the_machine(joint: str) -> None:
    """A step of 0.1 rad/s: nominal and measured position within 0.01 rad over two seconds."""
    p = {name: parameter.value for name, parameter in parameters.load("arm").items()}
    ticks = round(p[f"{joint}_delay"] / 0.02)
    nominal = identify.model(ticks, p[f"{joint}_response"], identify.LENGTH)
    measured = identify.step_response(arm_loop(), joint, 0.1, 0.0)
    assert np.max(np.abs(nominal - measured)) * 0.1 < 0.02
    assert p[f"{joint}_delay"] > 0.2  # paper: larger than the encoders'
