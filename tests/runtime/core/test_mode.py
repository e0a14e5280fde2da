"""The state machine: who may start what, and what stops it."""

import pytest

from runtime.image import INPUT, Flag, Group, Status, group
from specs.signals import signal
from tests.runtime.bench import ARMED, AUTOMATIC, FAULT, HOLD, MANUAL, OFF, STANDBY, STOPPING, Bench
from tests.runtime.bundles import core

NEUTRAL = [0.0, 0.0, 0.0]


@pytest.fixture
def bench() -> Bench:
    return Bench(core())


def test_off_until_operator_and_machine_are_heard(bench: Bench) -> None:
    bench.status = {"machine_ready": Status.NEVER}
    assert bench.tick(5).mode == OFF
    bench.status.clear()
    assert bench.tick().mode == STANDBY
    assert bench.out("control_enable") == 0.0


def test_a_switch_that_was_on_before_does_not_arm(bench: Bench) -> None:
    assert bench.set(operator_enable=1.0).tick(20).mode == STANDBY
    assert bench.set(operator_enable=0.0).tick().set(operator_enable=1.0).tick().mode == ARMED
    assert bench.out("control_enable") == 1.0
    assert bench.commands == NEUTRAL


@pytest.mark.parametrize("why", [{"machine_ready": 0.0}, {"emergency_stop": 1.0}, {"machine_fault": 3.0}])
def test_a_machine_that_is_not_ready_is_not_armed(bench: Bench, why: dict[str, float]) -> None:
    assert bench.set(**why).armed().mode == STANDBY
    assert bench.fault == "none"


def test_a_switch_between_off_and_on_is_off_and_so_is_half_a_fault(bench: Bench) -> None:
    bench.set(machine_fault=0.5).tick(2).set(operator_enable=0.5)
    assert bench.tick(3).mode == STANDBY
    assert bench.set(operator_enable=1.0).tick().mode == ARMED
    assert bench.set(automatic_request=0.5).tick(3).mode == ARMED


def test_automatic_by_the_switch_turned_on_anew(bench: Bench) -> None:
    bench.set(automatic_request=1.0).armed()
    assert bench.tick(20).mode == ARMED  # it was on before
    assert bench.set(automatic_request=0.0).tick().set(automatic_request=1.0).tick().mode == AUTOMATIC
    assert bench.tick(40).commands[0] != 0.0


def test_joystick_starts_manual_and_passes(bench: Bench) -> None:
    assert bench.manual(0.5).mode == MANUAL
    assert bench.commands == [0.5, 0.0, 0.0]
    bench.set(joystick_slew=-0.4, joystick_boom=0.2).tick(10)
    assert bench.commands == [-0.4, 0.2, 0.0]


def test_the_operator_takes_over_at_once_and_gives_back_by_the_switch_only(bench: Bench) -> None:
    bench.automatic()
    assert bench.set(joystick_boom=-0.3).tick().mode == MANUAL
    assert bench.set(joystick_boom=0.0).tick(50).mode == MANUAL
    assert bench.commands == NEUTRAL
    bench.set(automatic_request=0.0, joystick_boom=-0.3).tick().set(automatic_request=1.0)
    assert bench.tick(5).mode == MANUAL  # the joystick is not at rest
    bench.set(automatic_request=0.0, joystick_boom=0.0).tick().set(automatic_request=1.0)
    assert bench.tick().mode == AUTOMATIC


def test_letting_go_stops_and_then_rests(bench: Bench) -> None:
    bench.manual(1.0).set(operator_enable=0.0)
    assert bench.tick().mode == STOPPING
    assert 0.0 < bench.commands[0] < 1.0
    while any(bench.commands):
        assert bench.mode == STOPPING
        bench.tick()
    assert bench.tick().mode == STANDBY
    assert bench.commands == NEUTRAL


@pytest.mark.parametrize("why", [{"automatic_request": 0.0}, {"automatic_allowed": 0.0}])
def test_automatic_ends_armed_when_it_is_no_longer_asked_for_or_allowed(
    bench: Bench, why: dict[str, float]
) -> None:
    assert bench.automatic().set(**why).tick().mode == STOPPING
    assert bench.tick(5).mode == ARMED


def test_without_a_target_it_holds_and_goes_on_by_itself(bench: Bench) -> None:
    assert bench.automatic().set(target_valid=0.0).tick().mode == HOLD
    assert bench.tick(5).commands == NEUTRAL
    assert bench.fault == "none"
    assert bench.set(target_valid=1.0).tick().mode == AUTOMATIC


def test_a_target_out_of_reach_holds_and_says_why(bench: Bench) -> None:
    assert bench.automatic().set(target_x=20.0, target_y=0.0).tick(5).mode == HOLD
    assert (bench.fault, bench.out("target_in_reach")) == ("target_out_of_reach", 0.0)
    assert bench.commands == NEUTRAL
    assert bench.set(target_x=6.0, target_y=7.0).tick().mode == AUTOMATIC
    assert (bench.fault, bench.out("target_in_reach")) == ("none", 1.0)


def test_emergency_stop_is_neutral_in_the_same_tick(bench: Bench) -> None:
    bench.manual(1.0).set(emergency_stop=1.0).tick()
    assert (bench.mode, bench.fault, bench.commands) == (FAULT, "emergency_stop", NEUTRAL)
    assert bench.out("control_enable") == 0.0


def test_a_fault_is_latched_and_left_by_the_switch_pressed_anew(bench: Bench) -> None:
    bench.automatic().set(machine_ready=0.0).tick(5)
    assert (bench.mode, bench.fault) == (FAULT, "machine_not_ready")
    bench.set(operator_enable=0.0).tick().set(operator_enable=1.0).tick()
    assert bench.mode == FAULT  # the cause is still there
    bench.set(machine_ready=1.0).tick(50)
    assert bench.mode == FAULT  # the switch was not pressed since
    assert bench.set(operator_enable=0.0).tick(5).mode == FAULT
    assert bench.set(operator_enable=1.0).tick().mode == STANDBY
    assert bench.fault == "none"
    assert bench.tick(20).mode == STANDBY  # and arming takes another press
    assert bench.set(operator_enable=0.0).tick().set(operator_enable=1.0).tick().mode == ARMED


def test_a_deflected_joystick_does_not_acknowledge(bench: Bench) -> None:
    bench.manual().set(emergency_stop=1.0).tick(5).set(emergency_stop=0.0, operator_enable=0.0).tick()
    assert bench.set(operator_enable=1.0).tick().mode == FAULT


CAUSES = {
    "machine_fault": ("machine_fault", 2.0),
    "machine_not_ready": ("machine_ready", 0.0),
    "emergency_stop": ("emergency_stop", 1.0),
}


@pytest.mark.parametrize("fault", CAUSES)
@pytest.mark.parametrize("way", ["manual", "automatic", "armed"])
def test_the_machines_word_stops_every_mode(bench: Bench, fault: str, way: str) -> None:
    name, value = CAUSES[fault]
    getattr(bench, way)().set(**{name: value}).tick()
    assert (bench.mode, bench.fault, bench.out("fault_signal")) == (FAULT, fault, signal(name).vr)
    assert bench.tick(5).commands == NEUTRAL


GROUPS = {
    Group.OPERATOR: "operator_timeout",
    Group.MACHINE: "machine_timeout",
    Group.PLANNER: "target_timeout",
}


@pytest.mark.parametrize("name", [s.name for s in INPUT.signals if group(s) in GROUPS])
def test_a_signal_of_operator_machine_or_planner_that_ages_stops_automatic(name: str) -> None:
    bench = Bench(core()).automatic()
    found = signal(name)
    timeout = round((found.timeout_s or 0.0) / 0.02)
    bench.age[name] = timeout - 1
    assert bench.tick().mode == AUTOMATIC
    bench.age[name] = timeout
    bench.tick()
    assert (bench.mode, bench.fault) == (FAULT, GROUPS[group(found)])
    assert bench.out("fault_signal") == found.vr


@pytest.mark.parametrize(
    ("name", "fault"),
    [(f"{w}_heartbeat", GROUPS[g]) for w, g in zip(("operator", "machine", "planner"), GROUPS, strict=True)],
)
def test_a_heartbeat_that_stands_still_is_a_loss(name: str, fault: str) -> None:
    bench = Bench(core()).automatic()
    bench.silent.add(name)
    within = round((signal(name).timeout_s or 0.0) / 0.02) + 1
    assert bench.tick(within).mode == FAULT
    assert bench.fault == fault


def test_by_hand_planner_and_sensors_may_be_lost_but_the_axis_only_creeps(bench: Bench) -> None:
    bench.manual(1.0)
    bench.status = {"target_x": Status.TIMEOUT, "imu_cabin_rate_z": Status.TIMEOUT}
    assert bench.tick(10).mode == MANUAL
    assert bench.commands[0] == 0.3  # gate_creep
    assert bench.set(joystick_boom=0.8).tick(10).commands[1] == 0.8  # its sensors are well
    bench.set(automatic_request=1.0, joystick_slew=0.0, joystick_boom=0.0).tick(5)
    assert bench.mode == MANUAL  # automatic operation is not started without them


def test_two_overruns_in_a_row_are_not_yet_a_fault_however_often(bench: Bench) -> None:
    bench.automatic()
    for _ in range(4):
        for _ in range(2):
            bench.image["overruns"] += 1
            bench.tick()
        assert bench.tick().mode == AUTOMATIC


def test_without_a_fault_no_signal_is_named(bench: Bench) -> None:
    for way in (bench.tick, bench.armed, bench.automatic):
        way()
        assert (bench.fault, bench.out("fault_signal")) == ("none", 0.0)
    bench.set(machine_ready=0.0).tick()
    assert bench.out("fault_signal") == signal("machine_ready").vr
    bench.set(machine_ready=1.0, operator_enable=0.0).tick(5).set(operator_enable=1.0).tick()
    assert (bench.fault, bench.out("fault_signal")) == ("none", 0.0)


def test_overruns_in_a_row_are_a_fault_single_ones_are_counted(bench: Bench) -> None:
    bench.automatic()
    for _ in range(4):
        bench.image["overruns"] += 1
        bench.tick().tick()
    assert (bench.mode, bench.out("cycle_overruns")) == (AUTOMATIC, 4.0)
    for _ in range(3):
        bench.image["overruns"] += 1
        bench.tick()
    assert (bench.mode, bench.fault, bench.out("fault_signal")) == (FAULT, "task_overrun", 0.0)


def test_bus_off_stops_and_every_flag_is_shown(bench: Bench) -> None:
    bench.automatic()
    bench.image["flags"] = Flag.NO_REALTIME | Flag.STOLEN_TIME
    bench.tick()
    assert int(bench.out("runtime_flags")) & ~Flag.GATE_LIMITED == Flag.NO_REALTIME | Flag.STOLEN_TIME
    assert bench.mode == AUTOMATIC
    bench.image["flags"] = Flag.BUS_OFF
    assert bench.tick().mode == FAULT
    assert bench.fault == "bus_off"


def test_another_controller_on_the_bus_is_a_fault_until_it_has_gone() -> None:
    bench = Bench(core()).automatic()
    bench.image["flags"] = int(Flag.OTHER_CONTROLLER)
    assert (bench.tick().mode, bench.fault) == (FAULT, "other_controller")
    assert bench.out("fault_signal") == 0.0
    bench.set(operator_enable=0.0, automatic_request=0.0).tick(5).set(operator_enable=1.0)
    assert bench.tick().mode == FAULT
    bench.image["flags"] = 0
    assert bench.set(operator_enable=0.0).tick().set(operator_enable=1.0).tick().mode == STANDBY


@pytest.mark.parametrize("name", ["machine_ready", "operator_enable", "q_slew"])
def test_two_senders_of_a_message_stop_the_machine_until_one_is_left(name: str) -> None:
    bench = Bench(core()).automatic()
    bench.status[name] = Status.TWO_SENDERS
    assert (bench.tick().mode, bench.fault) == (FAULT, "two_senders")
    assert bench.out("fault_signal") == signal(name).vr
    bench.set(operator_enable=0.0, automatic_request=0.0).tick(5).set(operator_enable=1.0)
    assert bench.tick().mode == FAULT
    bench.status.clear()
    bench.set(operator_enable=0.0).tick(5).set(operator_enable=1.0)
    assert bench.tick().mode == STANDBY


@pytest.mark.parametrize(
    ("first", "code"), [({"machine_ready": Status.CHECKSUM}, "two_senders"), ({}, "emergency_stop")]
)
def test_two_senders_name_the_fault_that_their_refused_frames_made(first: dict, code: str) -> None:
    bench = Bench(core()).automatic()
    bench.status.update(first)
    bench.set(emergency_stop=float(not first)).tick(8)
    assert bench.fault == ("machine_timeout" if first else "emergency_stop")
    bench.set(emergency_stop=0.0)
    bench.status["machine_ready"] = Status.TWO_SENDERS
    assert (bench.tick().mode, bench.fault) == (FAULT, code)


@pytest.mark.parametrize("axis", ["joystick_slew", "joystick_boom", "joystick_stick"])
def test_every_axis_of_the_joystick_takes_over(axis: str) -> None:
    bench = Bench(core()).automatic()
    assert bench.set(**{axis: -0.5}).tick().mode == MANUAL


def test_a_fault_that_no_input_is_to_blame_for_names_none() -> None:
    bench = Bench(core()).automatic()
    bench.image["flags"] = int(Flag.BUS_OFF)
    assert (bench.tick().fault, bench.out("fault_signal")) == ("bus_off", 0.0)
