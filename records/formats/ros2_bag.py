"""ROS 2 bags (rosbag2, MCAP inside) of the paper's topics, written by way of rosbags.

    /joint_states    sensor_msgs/JointState      slew, boom, stick, tool_roll, tool_pitch: rad, rad/s
    /imu/cabin       sensor_msgs/Imu             frame cabin_imu: x forward, y left, z up
    /imu/tool        sensor_msgs/Imu             frame tool_imu: x outward, y left, z up along the tool
    /commands        sensor_msgs/Joy             axes slew, boom, stick, -1 to 1
    /arm_references  sensor_msgs/JointState      velocity of boom, stick: rad/s
    /operator        sensor_msgs/Joy             the joystick that the controller was shown
    /operator_seen   sensor_msgs/Joy             the real one, if it was recorded in shadow mode
    /target          geometry_msgs/PointStamped  frame base: x forward at slew 0, y left, z up

Stamps are the samples' own times of day.  A topic's messages come with the samples of its first channel,
other channels with their last sample at or before (no number where there is none).  REP 103: SI,
right-handed; slew is counter-clockwise from above.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from records.formats.metadata import to_ns
from records.measurement import Measurement
from records.tool import joint_rates
from specs.errors import InputError

READS = ()
WRITES = (".rosbag2",)
VERSION = 9  # of the bag's metadata: ROS 2 Iron and newer, and Humble with its MCAP plugin
JOINTS = ("slew", "boom", "stick", "tool_roll", "tool_pitch")
BASE = "base"
STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES: Mapping[str, Any] = STORE.types
Columns = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Topic:
    """A topic: its channels, the first one the clock, and the message of row k of their columns."""

    name: str
    type: str
    channels: tuple[str, ...]
    message: Callable[[Columns, int, Any], Any]


def write(measurement: Measurement, path: Path) -> list[str]:
    """Write every topic whose channels are all there; returns what the bag does not keep."""
    there = [t for t in TOPICS if not measurement.missing(t.channels)]
    if not there:
        raise InputError(
            f"{path}: the recording has the channels of none of {', '.join(t.name for t in TOPICS)}"
        )
    start = to_ns(measurement.start) if measurement.start else 0
    rows = [
        (start + round(1e9 * time), topic, k)
        for topic in there
        for k, time in enumerate(measurement[topic.channels[0]].time.tolist())
    ]
    if min(stamp for stamp, *_ in rows) < 0:
        raise InputError(f"{path}: ROS 2 has no times before 1970")
    columns = {t.name: _columns(measurement, t) for t in there}
    with Writer(path, version=VERSION, storage_plugin=StoragePlugin.MCAP) as bag:
        lines = {t.name: bag.add_connection(t.name, t.type, typestore=STORE) for t in there}
        for stamp, topic, k in sorted(rows, key=lambda row: row[0]):
            message = topic.message(columns[topic.name], k, _time(stamp))
            bag.write(lines[topic.name], stamp, STORE.serialize_cdr(message, topic.type))
    return _lost(measurement, there)


def _lost(measurement: Measurement, there: Sequence[Topic]) -> list[str]:
    used = {name for t in there for name in t.channels}
    others = [name for name in measurement.channels if name not in used]
    found = [f"{len(others)} channels that no topic holds: {', '.join(others[:6])} …"] if others else []
    return found + ([] if measurement.start else ["start: not known, stamps count from 1970"])


def _columns(measurement: Measurement, topic: Topic) -> Columns:
    """Each channel's values at the times of the first one [n]."""
    clock = measurement[topic.channels[0]]
    found = {}
    for name in topic.channels:
        index, fresh = measurement[name].held(clock.time, clock.period_s)
        values = measurement[name].values.astype(float)
        found[name] = np.where(fresh, values[np.maximum(index, 0)], np.nan)
    return found


def _time(stamp: int) -> Any:
    return TYPES["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)


def _header(frame: str, time: Any) -> Any:
    return TYPES["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def _joint_states(c: Columns, k: int, time: Any) -> Any:
    rates = [float(v) for v in joint_rates(*(c[f"imu_tool_{n}"][k] for n in ("roll", "pitch", *RATES)))]
    angles = [c[n][k] for n in ("q_slew", "q_boom", "q_stick", "imu_tool_roll", "imu_tool_pitch")]
    speeds = [c[n][k] for n in ("qd_slew", "qd_boom", "qd_stick")]
    return _joints(JOINTS, time, angles, [*speeds, *rates])


def _joints(names: Sequence[str], time: Any, position: Sequence[float], velocity: Sequence[float]) -> Any:
    return TYPES["sensor_msgs/msg/JointState"](
        header=_header(BASE, time), name=list(names), position=np.array(position, dtype=np.float64),
        velocity=np.array(velocity, dtype=np.float64), effort=np.zeros(0),
    )  # fmt: skip


def _imu(which: str) -> Callable[[Columns, int, Any], Any]:
    def message(c: Columns, k: int, time: Any) -> Any:
        name, vector = f"imu_{which}_", TYPES["geometry_msgs/msg/Vector3"]
        rate, acc = ([float(c[f"{name}{kind}_{a}"][k]) for a in "xyz"] for kind in ("rate", "acc"))
        heading = np.zeros(9)
        heading[8] = np.pi**2  # about the vertical it does not know
        return TYPES["sensor_msgs/msg/Imu"](
            header=_header(f"{which}_imu", time),
            orientation=_quaternion(float(c[f"{name}roll"][k]), float(c[f"{name}pitch"][k])),
            orientation_covariance=heading,
            angular_velocity=vector(*rate), angular_velocity_covariance=np.zeros(9),
            linear_acceleration=vector(*acc), linear_acceleration_covariance=np.zeros(9),
        )  # fmt: skip

    return message


def _quaternion(roll: float, pitch: float) -> Any:
    """Roll about x, pitch about y, no heading (REP 103)."""
    sr, cr, sp, cp = np.sin(roll / 2), np.cos(roll / 2), np.sin(pitch / 2), np.cos(pitch / 2)
    return TYPES["geometry_msgs/msg/Quaternion"](
        x=float(sr * cp), y=float(cr * sp), z=float(-sr * sp), w=float(cr * cp)
    )


def _joy(names: tuple[str, ...]) -> Callable[[Columns, int, Any], Any]:
    def message(c: Columns, k: int, time: Any) -> Any:
        axes = np.array([c[n][k] for n in names], dtype=np.float32)
        return TYPES["sensor_msgs/msg/Joy"](
            header=_header(BASE, time), axes=axes, buttons=np.zeros(0, np.int32)
        )

    return message


def _references(c: Columns, k: int, time: Any) -> Any:
    return _joints(("boom", "stick"), time, [], [c[n][k] for n in REFERENCES])


def _target(c: Columns, k: int, time: Any) -> Any:
    point = TYPES["geometry_msgs/msg/Point"](*(float(c[n][k]) for n in TARGET))
    return TYPES["geometry_msgs/msg/PointStamped"](header=_header(BASE, time), point=point)


RATES = ("rate_x", "rate_y", "rate_z")
IMU = (*RATES, "acc_x", "acc_y", "acc_z", "roll", "pitch")
STATES = (
    *(f"{kind}_{joint}" for kind in ("q", "qd") for joint in ("slew", "boom", "stick")),
    *(f"imu_tool_{n}" for n in ("roll", "pitch", *RATES)),
)
COMMANDS, REFERENCES = ("u_slew", "u_boom", "u_stick"), ("qd_boom_ref", "qd_stick_ref")
JOYSTICK = tuple(f"joystick_{axis}" for axis in ("slew", "boom", "stick"))
SEEN = tuple(f"seen_{name}" for name in JOYSTICK)  # of a recording in shadow mode (docs/how-to/shadow.md)
TARGET = ("target_x", "target_y", "target_z")
TOPICS = (
    Topic("/joint_states", "sensor_msgs/msg/JointState", STATES, _joint_states),
    Topic("/imu/cabin", "sensor_msgs/msg/Imu", tuple(f"imu_cabin_{n}" for n in IMU), _imu("cabin")),
    Topic("/imu/tool", "sensor_msgs/msg/Imu", tuple(f"imu_tool_{n}" for n in IMU), _imu("tool")),
    Topic("/commands", "sensor_msgs/msg/Joy", COMMANDS, _joy(COMMANDS)),
    Topic("/arm_references", "sensor_msgs/msg/JointState", REFERENCES, _references),
    Topic("/operator", "sensor_msgs/msg/Joy", JOYSTICK, _joy(JOYSTICK)),
    Topic("/operator_seen", "sensor_msgs/msg/Joy", SEEN, _joy(SEEN)),
    Topic("/target", "geometry_msgs/msg/PointStamped", TARGET, _target),
)
