"""Wiring faults: each sensor and valve has its own, and the steps find them."""

from pathlib import Path

import pytest

from slewright.commissioning import matrix, wiring
from slewright.commissioning.procedure import WIRING
from slewright.commissioning.wiring import SENSORS, VALVES, Fault, Wiring
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
        assert wanted <= kinds, name


def test_wires_do_what_their_faults_say() -> None:
    values = {"q_slew": 0.1, "q_boom": 1.2, "brake_released": 0.0}
    assert Wiring((Fault("swapped", ("q_slew", "q_boom")),)).sensed(values)["q_slew"] == 1.2
    assert Wiring((Fault("sign", ("brake_released",)),)).sensed(values)["brake_released"] == 1.0
    frozen = Wiring((Fault("frozen", ("q_boom",)),))
    assert frozen.sensed(values) == values
    assert frozen.sensed({**values, "q_boom": 1.3})["q_boom"] == 1.2
    assert Wiring().sensed(values) == values


def test_an_unknown_fault_is_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean q_boom sign"):
        wiring.named("q_boom sigm")


@pytest.mark.parametrize(
    ("name", "step"),
    [
        ("ArmPosition missing", "bus"),
        ("imu_tool_roll error", "bus"),
        ("emergency_stop zero", "safety"),
        ("joystick_boom swapped joystick_stick", "safety"),
        ("q_boom+qd_boom sign", "rest"),
        ("p_boom_a scale 0.5", "rest"),
        ("imu_cabin_acc_x sign", "imus"),
        ("u_slew sign", "slew"),
    ],
)
def test_a_wrong_wire_is_found_by_its_step(bundle: Path, name: str, step: str) -> None:
    case = matrix.run_case(bundle, wiring.named(name))
    assert (case.found, case.step) == (True, step), case


@pytest.mark.slow
@pytest.mark.soak
@pytest.mark.parametrize(
    "name", ["u_boom swapped u_stick", "p_stick_b scale 2", "q_slew+qd_slew scale 0.5", "machine no watchdog"]
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
