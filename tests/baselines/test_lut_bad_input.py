"""Recordings from which no table can be made are refused, with the place."""

import numpy as np
import pytest

from baselines.arm_velocity import lut
from records.measurement import Channel, Measurement
from specs.errors import InputError
from tests.baselines import lut_recordings as made


@pytest.fixture(scope="module")
def good() -> Measurement:
    return made.sweep(made.Joint(), 1, loads=(200e5,))[0]


def refused(*recordings: Measurement, joints: tuple[str, ...] = ("boom",)) -> str:
    """What the calibration says to these recordings."""
    with pytest.raises(InputError) as refusal:
        lut.calibrate(recordings, joints, bootstraps=5)
    message = str(refusal.value)
    assert message.count("\n") <= 1
    return message


def test_a_missing_channel_is_named_with_what_can_be_calibrated(good: Measurement) -> None:
    message = refused(good, joints=("boom", "stick"))
    assert "sweep0 has no u_stick and no q_stick" in message
    assert "--joint boom" in message
    assert "no joint can" in refused(made.without(good, "q_boom"))


def test_recordings_of_one_joint_each_go_together(good: Measurement) -> None:
    other = made.sweep(made.Joint(), 2, loads=(200e5,), name="stick")[0]
    assert set(lut.calibrate([good, other], ["boom", "stick"], bootstraps=5)) == {"boom", "stick"}


def test_constant_excitation(good: Measurement) -> None:
    still = made.changed(good, u_boom=np.full(len(good["u_boom"].time), 0.3))
    message = refused(still)
    assert "sweep0: u_boom is 0.3 throughout" in message


def test_a_joystick_in_percent(good: Measurement) -> None:
    message = refused(made.changed(good, u_boom=100 * good["u_boom"].values))
    assert "u_boom is 100" in message or "u_boom is -100" in message
    assert "valid is -1 … 1" in message


def test_a_joystick_that_stays_in_the_dead_band() -> None:
    message = refused(*made.sweep(made.Joint(), 3, levels=(0.02, 0.05, 0.08)))
    assert "never leaves the dead band" in message
    assert "-0.08 … 0.08" in message


def test_a_saturated_angle(good: Measurement) -> None:
    q = good["q_boom"].values
    message = refused(made.changed(good, q_boom=np.minimum(q, np.quantile(q, 0.9))))
    assert "q_boom stands at its highest value" in message
    assert "s while u_boom drives" in message


def test_a_saturated_pressure(good: Measurement) -> None:
    p = good["p_boom_a"].values
    message = refused(made.changed(good, p_boom_a=np.minimum(p, np.quantile(p, 0.6))))
    assert "p_boom_a stands at its highest value" in message


def test_a_sweep_that_is_not_monotone_after_repair() -> None:
    def fallen(command: float) -> float:
        return made.curve(command) if not 0.5 <= command <= 0.8 else 0.4 * made.curve(command)

    message = refused(*made.sweep(made.Joint(curve=fallen), 4))
    assert "not monotone even after repair" in message
    assert "u_boom = +0." in message
    assert " s) it goes" in message


def test_a_joint_that_goes_against_its_joystick(good: Measurement) -> None:
    assert "turn the sign" in refused(made.changed(good, q_boom=-good["q_boom"].values))


def test_a_joystick_that_is_never_held(good: Measurement) -> None:
    time = good["u_boom"].time
    assert "never held long enough" in refused(made.changed(good, u_boom=0.8 * np.sin(3 * time)))


def test_an_angle_that_comes_too_seldom(good: Measurement) -> None:
    q = good["q_boom"]
    seldom = Channel("q_boom", "rad", q.time[::10], q.values[::10])
    slow = Measurement({**good.channels, "q_boom": seldom}, source="slow")
    assert "slow: q_boom has a sample every 0.2 s" in refused(slow)
