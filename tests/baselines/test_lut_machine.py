"""Sweeps of the simulated reference machine, the tables they give, and what these are worth on it."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from baselines.arm_velocity import lut, sweep, tracking
from baselines.arm_velocity.lut import GRID
from baselines.arm_velocity.model import JOINTS
from baselines.bench import arm_loop
from fmus.equations import kinematics
from records.formats import read_measurement
from specs.errors import InputError

LEVELS = (0.08, 0.15, 0.19, 0.26, 0.34, 0.42, 0.5, 0.56, 0.62, 0.68, 0.74, 0.8, 0.88)
CONDITIONS = sweep.CONDITIONS[1:3]
DRAWN = "tuning:3"


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("sweeps")
    return sweep.sweep(folder, JOINTS, 1, "nominal", CONDITIONS, LEVELS)


@pytest.fixture(scope="module")
def tables(files: list[Path]) -> dict[str, lut.Table]:
    return lut.calibrate([read_measurement(file) for file in files], JOINTS, bootstraps=20)


def test_recordings_hold_commands_and_sensors_only(files: list[Path]) -> None:
    for file in files:
        names = pq.read_schema(file).names
        assert names == ["time", *sweep.COMMANDS, *sweep.SENSED]
        assert not any("true" in name for name in names)
    assert read_measurement(files[0]).meta["origin"] == "simulated reference machine"


def test_sweeps_stay_inside_the_limits_and_above_the_keep_out_height(files: list[Path]) -> None:
    g = kinematics.geometry()
    for file in files:
        recording = read_measurement(file)
        boom, stick = (recording[f"q_{joint}"].values for joint in JOINTS)
        for joint, q in zip(JOINTS, (boom, stick), strict=True):
            assert getattr(g, f"{joint}_min") < q.min()
            assert q.max() < getattr(g, f"{joint}_max")
        radius, height = kinematics.arm_tip(boom, stick, g)
        assert np.min(height) - g.tool_length > 2.0
        assert np.min(radius) > 2.0


def test_every_level_is_held_both_ways(files: list[Path]) -> None:
    for file, joint in zip(files, [j for j in JOINTS for _ in CONDITIONS], strict=True):
        held = set(np.round(read_measurement(file)[f"u_{joint}"].values, 3))
        assert {way * level for way in (1, -1) for level in LEVELS} <= held


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    one, same, other = (
        sweep.sweep(tmp_path, ["boom"], seed, "nominal", CONDITIONS[:1], (0.2, 0.5))[0].read_bytes()
        for seed in (1, 1, 2)
    )
    assert one == same != other


def test_unknown_machines_are_refused_and_the_sealed_ones(tmp_path: Path) -> None:
    for name in ("tuning", "test:0", "real", "validation:99999"):
        with pytest.raises(InputError, match="valid"):
            sweep.sweep(tmp_path, machine=name)
    assert not list(tmp_path.iterdir())


def test_tables_are_whole_monotone_and_know_the_dead_band(tables: dict[str, lut.Table]) -> None:
    """The spool's overlap is 0.12; friction and leakage add a little before anything moves."""
    for table in tables.values():
        assert table.lacking == ()
        assert np.all(np.diff(table.command) > 0)
        for band in table.dead_band.values():
            assert 0.12 <= band.value <= 0.16
            assert band.low <= band.value <= band.high


def test_pose_load_and_swing_are_taken_out(tables: dict[str, lut.Table]) -> None:
    """Little is left of the spread of speeds at one joystick."""
    for table in tables.values():
        for way, (_, curve) in table.curves.items():
            fast = curve.corrected > 0.05
            left = 1.4826 * np.median(np.abs(curve.residual[fast] / curve.corrected[fast]))
            assert left < 0.35 * table.spread[way]


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two speeds, one pose and load each."""
    monkeypatch.setattr(tracking, "SPEEDS", (0.02, 0.09))
    one = {joint: some[2:] for joint, some in tracking.SITUATIONS.items()}
    monkeypatch.setattr(tracking, "SITUATIONS", one)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("channel", ["qd", "true_qd"])
def test_tables_and_pi_hold_the_speed(tables: dict[str, lut.Table], channel: str) -> None:
    """As the encoder has it, and as it is: the truth judges here, nothing is made of it."""
    luts = {joint: table.command for joint, table in tables.items()}
    errors = tracking.track(arm_loop(), luts, channel=channel)
    for joint in JOINTS:
        assert errors[joint]["ff_pi"].rms < tracking.TARGET
        assert errors[joint]["ff"].rms < 0.02
        assert len(errors[joint]["ff"].runs) == 4


@pytest.mark.usefixtures("few")
def test_a_table_of_its_own_serves_a_drawn_machine_better(tmp_path: Path) -> None:
    files = sweep.sweep(tmp_path, ["boom"], 1, DRAWN, CONDITIONS[:1], LEVELS)
    table = lut.calibrate([read_measurement(file) for file in files], ["boom"], bootstraps=5)["boom"]
    loop = arm_loop()
    before = tracking.track(loop, None, DRAWN, joints=["boom"])["boom"]
    after = tracking.track(loop, {"boom": table.command}, DRAWN, joints=["boom"])["boom"]
    assert after["ff"].rms < before["ff"].rms


@pytest.mark.usefixtures("few")
def test_without_dead_band_feed_forward_does_not_move_slowly(tables: dict[str, lut.Table]) -> None:
    """What the table is for: with a straight line through the same ends the joint stands still."""
    line = {joint: np.linspace(t.command[0], t.command[-1], len(GRID)) for joint, t in tables.items()}
    loop = arm_loop()
    straight = tracking.track(loop, line, joints=["stick"])["stick"]["ff"].by_speed()["0.02"]
    table = tracking.track(loop, {j: t.command for j, t in tables.items()}, joints=["stick"])["stick"]["ff"]
    assert straight == pytest.approx(0.02, abs=0.002)
    assert table.by_speed()["0.02"] < 0.7 * straight
