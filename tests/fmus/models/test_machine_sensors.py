"""The machine's sensors against the true motion, and their noise."""

import numpy as np
import pytest

from fmus.models.machine import sensors
from fmus.models.machine.model import MODEL
from fmus.toolchain.build import build_fmu
from fmus.toolchain.stepper import Stepper
from tests.fmus.importer import Imported
from tests.fmus.models.machine_runs import PARAMETERS, start, working

ACCURATE = {f"imu_{imu}_mount_{a}": 0.0 for imu in ("cabin", "tool") for a in "xyz"}
FINE = 0.002  # s between samples


def turn(axis: int, angle: float) -> np.ndarray:
    """Rotation matrix about a coordinate axis."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


@pytest.fixture(scope="module")
def run() -> dict[str, np.ndarray]:
    """Three seconds of work on level ground, the tool IMU at the grab point, without mounting errors."""
    distance = PARAMETERS.tool_length - PARAMETERS.grab_offset
    machine = Stepper(MODEL, start(1.0, -1.3) | ACCURATE | {"imu_tool_distance": distance})
    return machine.run(working, 3.0, every=FINE)


def tool_axes(run: dict[str, np.ndarray], k: int) -> np.ndarray:
    """Rotation from the tool's axes to the ground at sample `k`."""
    slew, pitch, roll = (run[f"true_q_{n}"][k] for n in ("slew", "tool_y", "tool_x"))
    return turn(2, slew) @ turn(1, pitch) @ turn(0, roll)


def vector(run: dict[str, np.ndarray], name: str, k: int) -> np.ndarray:
    return np.array([run[f"{name}_{a}"][k] for a in "xyz"])


def test_tool_imu_feels_the_acceleration_of_the_grab_point(run: dict[str, np.ndarray]) -> None:
    """Against second differences of the true position, gravity taken off."""
    place = np.column_stack([run[f"true_tool_{a}"] for a in "xyz"])
    for k in range(250, 1490, 31):
        seen = tool_axes(run, k) @ vector(run, "imu_tool_acc", k) - [0, 0, PARAMETERS.gravity]
        moved = (place[k + 1] - 2 * place[k] + place[k - 1]) / FINE**2
        np.testing.assert_allclose(seen, moved, atol=0.1)


def test_tool_imu_rates_turn_the_tool(run: dict[str, np.ndarray]) -> None:
    """R' = R (rate x) by central differences."""
    for k in range(250, 1490, 31):
        change = (tool_axes(run, k + 1) - tool_axes(run, k - 1)) / (2 * FINE)
        skew = tool_axes(run, k).T @ change
        seen = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
        np.testing.assert_allclose(vector(run, "imu_tool_rate", k), seen, atol=5e-3)


def test_tool_imu_angles_are_the_tools_on_level_ground(run: dict[str, np.ndarray]) -> None:
    np.testing.assert_allclose(run["imu_tool_roll"], run["true_q_tool_x"], atol=1e-12)
    np.testing.assert_allclose(run["imu_tool_pitch"], run["true_q_tool_y"], atol=1e-12)
    assert np.abs(run["imu_tool_roll"]).max() > 0.02


def test_cabin_imu_feels_gravity_slope_and_turning(run: dict[str, np.ndarray]) -> None:
    np.testing.assert_allclose(run["imu_cabin_rate_z"], run["true_qd_slew"])
    level = Stepper(MODEL, ACCURATE).outputs()
    assert level["imu_cabin_acc_z"] == pytest.approx(PARAMETERS.gravity)
    assert level["imu_cabin_pitch"] == 0
    sloping = Stepper(MODEL, ACCURATE | {"slope_pitch": 0.02, "slope_roll": 0.03}).outputs()
    assert sloping["imu_cabin_pitch"] == pytest.approx(0.02, abs=1e-6)
    assert sloping["imu_cabin_roll"] == pytest.approx(0.03, abs=1e-6)


def test_mounting_error_tips_the_axes() -> None:
    tipped = Stepper(MODEL, ACCURATE | {"imu_tool_mount_y": 0.05}).outputs()
    assert tipped["imu_tool_acc_x"] == pytest.approx(-0.05 * PARAMETERS.gravity)
    assert tipped["imu_tool_pitch"] == pytest.approx(0.05, abs=1e-4)


def test_every_sensor_but_the_brakes_switch_has_noise() -> None:
    silent = {n for n, s in sensors.declarations().items() if s.noise is None}
    assert silent == {"brake_released"}
    for sensor in sensors.declarations().values():
        assert sensor.noise is None or getattr(PARAMETERS, sensor.noise) > 0


def test_noise_has_its_standard_deviation_and_quiet_machine_none() -> None:
    """At rest, over ten seconds of samples from the FMU."""
    path, names = build_fmu("machine", 2), ["p_boom_a", "imu_tool_rate_x", "qd_slew", "imu_tool_roll"]
    with Imported(path, seed=3) as machine:
        noisy = np.array(machine.run(500, {}, names))
    with Imported(path, seed=3, **dict.fromkeys(sensors.NOISE_PARAMETERS, 0.0)) as machine:
        quiet = np.array(machine.run(50, {}, names))
    wanted = [getattr(PARAMETERS, str(sensors.declarations()[n].noise)) for n in names]
    np.testing.assert_allclose(noisy.std(axis=0), wanted, rtol=0.15)
    assert np.all(np.ptp(quiet, axis=0) < 1e-9)


def test_velocity_comes_late_and_angle_does_not() -> None:
    with Imported(build_fmu("machine", 2), seed=0) as machine:
        machine.set(u_stick=-1.0)
        rows = []
        for _ in range(80):
            machine.step()
            rows.append(machine.get("qd_stick", "true_qd_stick", "q_stick", "true_q_stick"))
    late, true, angle, true_angle = np.array(rows).T
    back = round(PARAMETERS.encoder_velocity_delay / 0.02)
    np.testing.assert_allclose(late[back:], true[:-back], atol=1e-12)
    assert np.abs(angle - true_angle).max() <= PARAMETERS.encoder_quantum / 2 + 1e-12
