"""The messages that go out, made from the images: live, the topics of a bag (records/formats/ros2_bag.py)."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from records.tool import joint_rates
from runtime.interfaces.view import INDEX, Seen
from runtime.ros2.wire import message
from specs import ros2, urdf

JOINTS = ("slew", "boom", "stick", "tool_roll", "tool_pitch", "tool_level")  # those of the URDF
SIGNALS = [s.name for s in ros2.wired()]
PLACES = [INDEX[name] for name in SIGNALS]
HEADING = [0.0] * 8 + [math.pi**2]  # the IMUs do not know their heading
UNKNOWN_COVARIANCE = [0.0] * 9


@dataclass(frozen=True)
class Topic:
    """A topic that is published, its type, and how its message is made."""

    name: str
    type: str
    made: Callable[[Seen], Any]
    every: int = 1  # ticks


def time_of(ns: int) -> Any:
    """`builtin_interfaces/Time`."""
    return message("builtin_interfaces/msg/Time")(sec=ns // 10**9, nanosec=ns % 10**9)


def header(ns: int, frame: str) -> Any:
    """`std_msgs/Header`."""
    return message("std_msgs/msg/Header")(stamp=time_of(ns), frame_id=frame)


def joint_states(seen: Seen) -> Any:
    """Measured joints; the tool's rates follow from its IMU."""
    roll, pitch = seen.of("imu_tool_roll"), seen.of("imu_tool_pitch")
    rates = [float(v) for v in joint_rates(roll, pitch, *(seen.of(f"imu_tool_rate_{a}") for a in "xyz"))]  # type: ignore[arg-type]
    arm = [seen.of(name) for name in ("q_slew", "q_boom", "q_stick")]
    speeds = [seen.of(name) for name in ("qd_slew", "qd_boom", "qd_stick")]
    position = [*arm, roll, pitch, arm[1] + arm[2]]
    return _joints(seen, JOINTS, position, [*speeds, *rates, speeds[1] + speeds[2]])


def arm_references(seen: Seen) -> Any:
    """What the controller asks of the arm's loops."""
    return _joints(seen, ("boom", "stick"), [], [seen.of("qd_boom_ref"), seen.of("qd_stick_ref")])


def _joints(seen: Seen, names: tuple[str, ...], position: list[float], velocity: list[float]) -> Any:
    return message("sensor_msgs/msg/JointState")(
        header=header(seen.time_ns, urdf.BASE),
        name=list(names),
        position=position,
        velocity=velocity,
        effort=[],
    )


def imu(which: str) -> Callable[[Seen], Any]:
    """The cabin's or the tool's."""
    vector = message("geometry_msgs/msg/Vector3")

    def made(seen: Seen) -> Any:
        rate, acc = ([seen.of(f"imu_{which}_{kind}_{a}") for a in "xyz"] for kind in ("rate", "acc"))
        return message("sensor_msgs/msg/Imu")(
            header=header(seen.time_ns, f"{which}_imu"),
            orientation=_turn(seen.of(f"imu_{which}_roll"), seen.of(f"imu_{which}_pitch")),
            orientation_covariance=HEADING,
            angular_velocity=vector(*rate), angular_velocity_covariance=UNKNOWN_COVARIANCE,
            linear_acceleration=vector(*acc), linear_acceleration_covariance=UNKNOWN_COVARIANCE,
        )  # fmt: skip

    return made


def _turn(roll: float, pitch: float) -> Any:
    """Roll about x, pitch about y, no heading (REP 103)."""
    sr, cr, sp, cp = math.sin(roll / 2), math.cos(roll / 2), math.sin(pitch / 2), math.cos(pitch / 2)
    return message("geometry_msgs/msg/Quaternion")(x=sr * cp, y=cr * sp, z=-sr * sp, w=cr * cp)


def joy(names: tuple[str, ...]) -> Callable[[Seen], Any]:
    """Three axes from -1 to 1."""

    def made(seen: Seen) -> Any:
        axes = [seen.of(name) for name in names]
        return message("sensor_msgs/msg/Joy")(header=header(seen.time_ns, urdf.BASE), axes=axes, buttons=[])

    return made


def target(seen: Seen) -> Any:
    """The target that the controller knows of; no number without one."""
    point = message("geometry_msgs/msg/Point")(*(seen.of(f"target_{axis}") for axis in "xyz"))
    return message("geometry_msgs/msg/PointStamped")(header=header(seen.time_ns, urdf.BASE), point=point)


def signals(seen: Seen) -> Any:
    """Every signal, and how good it is."""
    values = [float(v) for v in seen.value[PLACES]]
    status = [int(v) for v in seen.status[PLACES]]
    return message(ros2.SIGNALS)(header(seen.time_ns, urdf.BASE), seen.tick, *values, *status)


def clock(seen: Seen) -> Any:
    """`/clock`: the time of the images."""
    return message("rosgraph_msgs/msg/Clock")(clock=time_of(seen.time_ns))


TOPICS = (
    Topic("/joint_states", "sensor_msgs/msg/JointState", joint_states),
    Topic("/imu/cabin", "sensor_msgs/msg/Imu", imu("cabin")),
    Topic("/imu/tool", "sensor_msgs/msg/Imu", imu("tool")),
    Topic("/commands", "sensor_msgs/msg/Joy", joy(("u_slew", "u_boom", "u_stick"))),
    Topic("/arm_references", "sensor_msgs/msg/JointState", arm_references),
    Topic("/operator", "sensor_msgs/msg/Joy", joy(("joystick_slew", "joystick_boom", "joystick_stick"))),
    Topic("/target", "geometry_msgs/msg/PointStamped", target, 5),
    Topic("/slewright/signals", ros2.SIGNALS, signals),
)
CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", clock)
COMMAND = "/slewright/target"  # of type ros2.TARGET: what is subscribed to
POLICY = "/slewright/policy"  # of type ros2.POLICY: likewise
