"""ROS 2 bags: what rosbags reads back is what was recorded, with stamps, frames and units."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from records.formats import read_measurement, write_measurement
from records.formats.ros2_bag import IMU, TOPICS
from records.measurement import Channel, Measurement
from specs.errors import InputError
from specs.signals import signal

START = datetime(2026, 3, 1, 12, 0, 0, 250_000, tzinfo=UTC)
STORE = get_typestore(Stores.ROS2_HUMBLE)
N = 20


def recording(*without: str, start: datetime | None = START) -> Measurement:
    """Every channel of every topic, k samples of 50 Hz; targets at 10 Hz."""
    channels = {}
    for i, name in enumerate(dict.fromkeys(n for t in TOPICS for n in t.channels)):
        every = 5 if name.startswith("target") else 1
        time = 0.02 * np.arange(0, N, every)
        unit = signal(name.removeprefix("seen_")).unit
        channels[name] = Channel(name, unit, time, 0.01 * i + 0.001 * np.arange(len(time)))
    return Measurement({n: c for n, c in channels.items() if n not in without}, start)


def read_back(path: Path) -> dict[str, list]:
    """Messages by topic, with their stamps [ns]."""
    found: dict[str, list] = {}
    with Reader(path) as bag:
        for line, stamp, data in bag.messages():
            found.setdefault(line.topic, []).append((stamp, STORE.deserialize_cdr(data, line.msgtype)))
    return found


def test_topics_values_stamps_and_frames(tmp_path: Path):
    made = recording()
    lost = write_measurement(made, tmp_path / "run.rosbag2")
    assert lost == []
    found = read_back(tmp_path / "run.rosbag2")
    assert set(found) == {t.name for t in TOPICS}
    stamp, joints = found["/joint_states"][7]
    assert stamp == round(START.timestamp() * 1e6) * 1000 + 140_000_000
    assert (joints.header.stamp.sec * 10**9 + joints.header.stamp.nanosec, joints.header.frame_id) == (
        stamp,
        "base",
    )
    assert list(joints.name) == ["slew", "boom", "stick", "tool_roll", "tool_pitch"]
    angles = [made[n].values[7] for n in ("q_slew", "q_boom", "q_stick", "imu_tool_roll", "imu_tool_pitch")]
    assert joints.position.tolist() == angles
    assert joints.velocity[0] == made["qd_slew"].values[7]
    _, imu = found["/imu/tool"][3]
    assert imu.header.frame_id == "tool_imu"
    assert imu.angular_velocity.y == made["imu_tool_rate_y"].values[3]
    assert imu.linear_acceleration.z == made["imu_tool_acc_z"].values[3]
    assert imu.orientation_covariance[8] > 9.0  # no heading
    _, joy = found["/commands"][2]
    assert joy.axes.tolist() == pytest.approx([made[n].values[2] for n in ("u_slew", "u_boom", "u_stick")])
    assert len(found["/target"]) == N // 5
    assert found["/target"][1][1].point.x == made["target_x"].values[1]


def test_orientation_is_roll_and_pitch(tmp_path: Path):
    write_measurement(recording(), tmp_path / "run.rosbag2")
    q = read_back(tmp_path / "run.rosbag2")["/imu/cabin"][0][1].orientation
    made = recording()
    pitch = np.arcsin(2.0 * (q.w * q.y - q.z * q.x))
    roll = np.arctan2(2.0 * (q.w * q.x + q.y * q.z), 1.0 - 2.0 * (q.x**2 + q.y**2))
    assert pitch == pytest.approx(made["imu_cabin_pitch"].values[0])
    assert roll == pytest.approx(made["imu_cabin_roll"].values[0])


def test_what_is_missing_leaves_its_topic_out_and_says_so(tmp_path: Path):
    made = recording("imu_cabin_rate_x", start=None)
    lost = write_measurement(made, tmp_path / "run.rosbag2")
    assert "/imu/cabin" not in read_back(tmp_path / "run.rosbag2")
    assert any("imu_cabin" in line for line in lost)
    assert "start: not known, stamps count from 1970" in lost


def test_a_recording_without_any_topic_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="/joint_states"):
        write_measurement(recording(*(n for t in TOPICS for n in t.channels if n != "imu_tool_acc_x")),
                          tmp_path / "run.rosbag2")  # fmt: skip
    assert list(tmp_path.iterdir()) == []
    assert len(IMU) == 8


def test_a_bag_is_read_by_the_definitions_in_it(tmp_path: Path):
    sent = recording()
    write_measurement(sent, tmp_path / "run.rosbag2")
    found = read_measurement(tmp_path / "run.rosbag2")
    np.testing.assert_allclose(found["joint_states.position[0]"].values, sent["q_slew"].values)
    np.testing.assert_allclose(found["joint_states.position[0]"].time, sent["q_slew"].time, atol=1e-9)
    assert found.start == START
