"""The supervisor: what it clips, what it aborts on, and that it looks at sensors only."""

import math
from dataclasses import replace

import pytest
from hypothesis import example, given, strategies as st

from learning.collection.command import NEUTRAL, Command
from learning.collection.machine import SENSED
from learning.collection.plan import PERIOD_S, Limits
from learning.collection.supervisor import SATURATING, WATCHED, State, supervise

LIMITS = Limits(
    boom_rad=(0.8, 1.4),
    stick_rad=(-2.1, -0.3),
    slew_speed_rad_s=0.7,
    keepout_margin_m=0.3,
    tool_swing_rad=0.6,
    tool_swing_abort_rad=1.2,
)
LARGE = Command(1.0, 0.2, 0.2)


def at_rest(**values: float) -> dict[str, float]:
    """Sensors of a machine that stands in the middle of its range."""
    seen = dict.fromkeys((*WATCHED, *SATURATING), 0.0) | {"q_boom": 1.1, "q_stick": -1.3, "p_slew_a": 2e6}
    return seen | values


def after(periods: int, seen, wanted: Command = LARGE) -> tuple[Command, State]:
    """Command and state after some periods; `seen` is a function of the period's number."""
    command, state = NEUTRAL, State()
    for k in range(periods):
        jitter = {n: seen(k)[n] + 1e-6 * k for n in seen(k)}  # as noise does
        command, state = supervise(wanted, jitter, 0.0, state, LIMITS)
    return command, state


def test_a_command_within_the_limits_passes_unchanged():
    wanted = Command(0.5, 0.1, -0.05)
    command, state = supervise(wanted, at_rest(), 0.0, State(), LIMITS)
    assert command == pytest.approx(wanted, abs=1e-5)
    assert state.clipped == ()
    assert not state.aborted


def test_it_reads_sensors_only():
    assert set(WATCHED) | set(SATURATING) <= set(SENSED)
    assert not any(name.startswith("true_") for name in SENSED)


def test_joystick_and_references_are_held_to_their_ranges():
    command, _ = supervise(Command(7.0, -3.0, 3.0), at_rest(), 0.0, State(), LIMITS)
    assert command == pytest.approx((1.0, -0.2, 0.2))


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_above_the_speed_limit_the_joystick_may_brake_but_not_drive(direction):
    seen = at_rest(qd_slew=0.75 * direction, imu_cabin_rate_z=0.75 * direction)
    driven, state = supervise(Command(direction, 0.0, 0.0), seen, 0.0, State(), LIMITS)
    braked, _ = supervise(Command(-direction, 0.0, 0.0), seen, 0.0, State(), LIMITS)
    assert driven.u_slew == 0.0
    assert state.clipped == ("slew speed",)
    assert braked.u_slew == -direction


def test_a_speed_that_is_about_to_pass_the_limit_counts_already():
    first = supervise(LARGE, at_rest(qd_slew=0.5, imu_cabin_rate_z=0.55), 0.0, State(), LIMITS)[1]
    command, second = supervise(LARGE, at_rest(qd_slew=0.51, imu_cabin_rate_z=0.6), 0.0, first, LIMITS)
    assert command.u_slew == 0.0
    still, third = supervise(LARGE, at_rest(qd_slew=0.52, imu_cabin_rate_z=0.6), 0.0, second, LIMITS)
    assert still.u_slew == 0.0
    assert supervise(LARGE, at_rest(qd_slew=0.53, imu_cabin_rate_z=0.58), 0.0, third, LIMITS)[0].u_slew == 1.0


@pytest.mark.parametrize(
    ("pose", "out", "back"),
    [
        ({"q_boom": 1.399}, Command(0.0, 0.2, 0.0), Command(0.0, -0.2, 0.0)),
        ({"q_boom": 0.801}, Command(0.0, -0.2, 0.0), Command(0.0, 0.2, 0.0)),
        ({"q_stick": -0.301}, Command(0.0, 0.0, 0.2), Command(0.0, 0.0, -0.2)),
        ({"q_stick": -2.099}, Command(0.0, 0.0, -0.2), Command(0.0, 0.0, 0.2)),
        ({"q_boom": 0.85, "q_stick": -1.84}, Command(0.0, -0.2, 0.0), Command(0.0, 0.2, 0.0)),  # keep-out
    ],
)
def test_at_a_limit_the_arm_may_only_go_back(pose, out, back):
    seen = at_rest(**pose)
    assert supervise(out, seen, 0.0, State(), LIMITS)[0] == NEUTRAL
    assert supervise(back, seen, 0.0, State(), LIMITS)[0] == pytest.approx(back, abs=1e-5)


def test_outside_the_limits_the_arm_may_still_come_back():
    seen = at_rest(q_boom=1.43)
    assert supervise(Command(0.0, -0.1, 0.0), seen, 0.0, State(), LIMITS)[0].qd_boom_ref < 0.0
    assert supervise(Command(0.0, 0.1, 0.0), seen, 0.0, State(), LIMITS)[0].qd_boom_ref == 0.0


@pytest.mark.long
@example(
    delay=8, wanted=[(1.0, 0.0)] * 13 + [(0.16, 0.0), (-0.13, 0.0)] + [(0.0, 0.0)] * 7 + [(1.0, 0.0)] * 9
)
@given(
    delay=st.integers(0, 8),
    wanted=st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=30, max_size=150),
)
def test_an_arm_that_follows_late_stays_within_its_pose_limits(delay, wanted):
    """A pure dead time of up to 0.8 s: what it was built for; any excitation."""
    q, told, state = [1.1, -1.3], [NEUTRAL] * (delay + 1), State()
    for number, (boom, stick) in enumerate(wanted):
        jitter = 1e-9 * number
        seen = at_rest(q_boom=q[0], q_stick=q[1]) | dict.fromkeys(("qd_slew", "imu_cabin_rate_z"), jitter)
        seen |= dict.fromkeys(("qd_boom", "qd_stick", "imu_tool_roll", "imu_tool_pitch"), jitter)
        command, state = supervise(Command(0.0, boom, stick), seen, 0.0, state, LIMITS)
        assert not state.aborted
        told.append(command)
        q = [q[i] + PERIOD_S * told[-1 - delay][i + 1] for i in (0, 1)]
        assert LIMITS.boom_rad[0] - 1e-6 <= q[0] <= LIMITS.boom_rad[1] + 1e-6
        assert LIMITS.stick_rad[0] - 1e-6 <= q[1] <= LIMITS.stick_rad[1] + 1e-6


def test_a_swinging_tool_gets_rest_slowly():
    _, state = supervise(LARGE, at_rest(), 0.0, State(), LIMITS)
    pulls, k = [], 0
    while not pulls or pulls[-1] > 0.0:
        k += 1
        seen = {n: v + 1e-6 * k for n, v in at_rest(imu_tool_roll=0.65).items()}
        command, state = supervise(LARGE, seen, 0.0, state, LIMITS)
        pulls.append(command.u_slew)
    assert state.clipped[0] == "tool swing"
    assert pulls == sorted(pulls, reverse=True)
    assert 1.5 <= len(pulls) * PERIOD_S <= 2.5


def test_a_tool_that_swings_fast_through_the_middle_counts_as_swinging():
    _, state = supervise(LARGE, at_rest(imu_tool_rate_y=2.0), 0.0, State(), LIMITS)
    assert state.clipped[0] == "tool swing"


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"imu_tool_pitch": -1.25}, "tool swing"),
        ({"qd_slew": 0.9, "imu_cabin_rate_z": 0.9}, "slew speed"),
        ({"q_boom": 1.52}, "arm pose"),
        ({"q_stick": -2.3}, "arm pose"),
        ({"q_boom": 0.8, "q_stick": -2.05}, "keep-out"),
        ({"p_slew_a": 9e7}, "p_slew_a"),
        ({"q_slew": math.nan}, "q_slew"),
        ({"imu_tool_rate_x": math.inf}, "imu_tool_rate_x"),
    ],
)
def test_it_aborts_to_neutral_and_stays_there(values, said):
    command, state = supervise(LARGE, at_rest(**values), 0.0, State(), LIMITS)
    assert command == NEUTRAL
    assert said in state.aborted
    for k in range(3):
        command, state = supervise(LARGE, at_rest(qd_slew=1e-5 * k), 0.0, state, LIMITS)
        assert command == NEUTRAL
        assert said in state.aborted


def test_a_missing_sensor_aborts():
    seen = at_rest()
    del seen["q_stick"]
    assert "q_stick" in supervise(LARGE, seen, 0.0, State(), LIMITS)[1].aborted


def test_silence_aborts():
    assert "no sensor value" in supervise(LARGE, at_rest(), 0.6, State(), LIMITS)[1].aborted
    assert not supervise(LARGE, at_rest(), 0.4, State(), LIMITS)[1].aborted


@pytest.mark.parametrize("stuck", ["qd_slew", "qd_boom", "imu_cabin_rate_z", "imu_tool_pitch"])
def test_a_sensor_that_repeats_itself_to_the_last_digit_aborts(stuck):
    state = State()
    for k in range(10):
        seen = {n: v + (0.0 if n == stuck else 1e-6 * k) for n, v in at_rest().items()}
        _, state = supervise(LARGE, seen, 0.0, state, LIMITS)
        assert bool(state.aborted) == (k * PERIOD_S >= LIMITS.silence_s - 1e-9)
    assert stuck in state.aborted


def test_gyroscope_and_encoder_that_contradict_each_other_abort():
    contradiction = at_rest(qd_slew=0.0, imu_cabin_rate_z=0.5)
    assert not after(4, lambda k: contradiction)[1].aborted
    assert "contradict" in after(6, lambda k: contradiction)[1].aborted


def test_an_excitation_that_is_no_number_aborts():
    command, state = supervise(Command(math.nan, 0.0, 0.0), at_rest(), 0.0, State(), LIMITS)
    assert command == NEUTRAL
    assert "not a number" in state.aborted


def test_it_keeps_nothing_but_its_state():
    state = State()
    first = supervise(LARGE, at_rest(), 0.0, state, LIMITS)
    assert supervise(LARGE, at_rest(), 0.0, state, LIMITS) == first
    assert state == State()
    assert replace(first[1], speed=None) != State()
