"""Wiring faults: each sensor and valve has its own, and the steps find them."""

import math
from pathlib import Path

import pytest

from deployment.commissioning import matrix, wiring
from deployment.commissioning.procedure import WIRING
from deployment.commissioning.wiring import IMU, LOOSE_EVERY, LOOSE_FOR, SENSORS, VALVES, Fault, Wiring
from specs.errors import InputError
from tests.runtime.bundles import built


@pytest.fixture(scope="module")
def bundle() -> Path:
    return built("pi").folder


def test_every_sensor_and_every_valve_has_each_fault() -> None:
    cases = wiring.cases()
    assert len({c.name for c in cases}) == len(cases)
    for name in (*SENSORS, *VALVES):
        kinds = {c.kind for c in cases if name in c.signals}
        wanted = {"sign", "zero"} if name == "brake_released" else {"sign", "scale", "zero", "swapped"}
        wanted |= {"noisy", "loose contact", "full scale"} if "scale" in wanted and name in SENSORS else set()
        wanted |= {"late"} if name.startswith(("q", "imu", "u_")) else set()
        assert wanted <= kinds, name


def test_wires_do_what_their_faults_say() -> None:
    values = {"q_slew": 0.1, "q_boom": 1.2, "brake_released": 0.0}
    assert Wiring((Fault("swapped", ("q_slew", "q_boom")),)).sensed(values)["q_slew"] == 1.2
    assert Wiring((Fault("sign", ("brake_released",)),)).sensed(values)["brake_released"] == 1.0
    frozen = Wiring((Fault("frozen", ("q_boom",)),))
    assert frozen.sensed(values) == values
    assert frozen.sensed({**values, "q_boom": 1.3})["q_boom"] == 1.2
    assert Wiring().sensed(values) == values


def test_wires_do_what_comes_with_time() -> None:
    late, loose = Wiring((Fault("late", ("q_slew",), 0.06),)), Wiring((Fault("loose contact", ("q_slew",)),))
    seen = [late.sensed({"q_slew": float(k)})["q_slew"] for k in range(6)]
    assert seen == [0.0, 0.0, 0.0, 0.0, 1.0, 2.0]
    gone = [math.isnan(loose.sensed({"q_slew": 1.0})["q_slew"]) for _ in range(2 * LOOSE_EVERY)]
    assert sum(gone) == 2 * LOOSE_FOR


def test_an_imu_that_is_turned_shows_its_axes_turned() -> None:
    values = {f"imu_tool_{n}": float(k + 1) for k, n in enumerate(IMU)}
    turned = Wiring((wiring.named("imu_tool turned 90"),)).sensed(values)
    assert [turned[f"imu_tool_{n}"] for n in IMU] == pytest.approx([2, -1, 3, 5, -4, 6, 8, -7])
    once, back = wiring.named("imu_tool turned 90"), wiring.named("imu_tool turned -90")
    assert Wiring((once, back)).sensed(values) == pytest.approx(values)
    down = Wiring((wiring.named("imu_tool upside down"),)).sensed({**values, "imu_tool_acc_z": 9.8})
    assert (down["imu_tool_acc_z"], down["imu_tool_rate_x"]) == (-9.8, 1.0)


def test_an_unknown_fault_is_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean q_boom sign"):
        wiring.named("q_boom sigm")


@pytest.mark.parametrize(
    ("name", "step"),
    [
        ("ArmPosition missing", "bus"),
        pytest.param("imu_tool_roll error", "bus", marks=pytest.mark.long),
        pytest.param("q_slew loose contact", "bus", marks=pytest.mark.long),
        pytest.param("emergency_stop zero", "safety", marks=pytest.mark.long),
        ("joystick_boom swapped joystick_stick", "safety"),
        ("q_boom+qd_boom sign", "rest"),
        pytest.param("p_boom_a scale 0.5", "rest", marks=pytest.mark.long),
        pytest.param("imu_cabin_acc_x sign", "imus", marks=pytest.mark.long),
        ("imu_tool turned 180", "imus"),
        ("u_slew sign", "slew"),
    ],
)
def test_a_wrong_wire_is_found_by_its_step(bundle: Path, name: str, step: str) -> None:
    case = matrix.run_case(bundle, wiring.named(name))
    assert (case.found, case.step) == (True, step), case


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "q_boom+qd_boom late 0.5",
        pytest.param("u_slew late 0.5", marks=pytest.mark.soak),
        "u_boom swapped u_stick",
        pytest.param("p_stick_b scale 2", marks=pytest.mark.soak),
        pytest.param("q_slew+qd_slew scale 0.5", marks=pytest.mark.soak),
        pytest.param("machine no watchdog", marks=pytest.mark.soak),
    ],
)
def test_one_that_shows_in_motion_is_found_by_a_machine_that_moves(bundle: Path, name: str) -> None:
    assert matrix.run_case(bundle, wiring.named(name)).step in WIRING[4:]


def quiet(what: str, done: float | None = None, total: float | None = None) -> None:
    """No progress lines."""


@pytest.mark.slow
@pytest.mark.soak
def test_all_are_found_and_none_is_passed(bundle: Path, tmp_path: Path) -> None:
    cases = matrix.run(bundle, wiring.cases(), tmp_path, quiet, workers=2)
    assert [c.name for c in cases if not c.found] == []


def test_cases_that_are_done_are_not_run_again(bundle: Path, tmp_path: Path) -> None:
    chosen = [wiring.named("SlewPosition missing")]
    first = matrix.run(bundle, chosen, tmp_path, quiet)
    (tmp_path / "not a bundle").mkdir()
    assert matrix.run(tmp_path / "not a bundle", chosen, tmp_path, quiet) == first
