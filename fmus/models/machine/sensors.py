"""What the machine's sensors see, before sampling, delay, noise and resolution; and its true states.

IMU axes: x forward (radial), y left, z up along the cabin or the tool.  Accelerations are specific forces (at
rest +g upwards), turned by the mounting error.  Roll and pitch are those of the gravity vector, so that on
level ground the tool IMU's are q_tool_x and q_tool_y.
"""

from typing import Any

import casadi as ca

from fmus.definition import Sensor
from fmus.equations import multibody
from fmus.models.machine.dynamics import Instant, evaluate

Namespace = Any
AXES = ("x", "y", "z")
JOINTS = ("slew", "boom", "stick")

# Set all of these to 0 for a machine without sensor noise (biases and resolution remain).
NOISE_PARAMETERS = (
    "encoder_noise", "encoder_velocity_noise", "pressure_noise",
    "imu_rate_noise", "imu_acc_noise", "imu_angle_noise",
)  # fmt: skip


def outputs(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    """All outputs by name."""
    now = evaluate(x, u, m, p)
    encoders = {
        "q_slew": x.slew_angle, "q_boom": x.boom_angle, "q_stick": x.stick_angle,
        "qd_slew": x.slew_rate, "qd_boom": x.boom_rate, "qd_stick": x.stick_rate,
    }  # fmt: skip
    pressures = {
        f"p_{j}_{s}": getattr(x, f"{j}_pressure_{s}") for j in ("slew", "boom", "stick") for s in "ab"
    }
    pressures["p_pump"] = x.pump_pressure
    grab = now.motion.grab
    c, s = ca.cos(x.slew_angle), ca.sin(x.slew_angle)
    tool = {
        "q_tool_x": x.tool_roll, "q_tool_y": x.tool_pitch,
        "qd_tool_x": x.tool_roll_rate, "qd_tool_y": x.tool_pitch_rate,
        "tool_x": c * grab[0] - s * grab[1], "tool_y": s * grab[0] + c * grab[1], "tool_z": grab[2],
    }  # fmt: skip
    true = {f"true_{name}": value for name, value in {**encoders, **tool, **pressures}.items()}
    imus = _cabin(now, p) | _tool(now, p)
    return encoders | pressures | imus | {"brake_released": m.brake_is_released} | true


def declarations() -> dict[str, Sensor]:
    """How each sensor samples: encoders, pressures, IMUs, and the brake's switch without noise."""
    found = {"brake_released": Sensor()}
    for j in JOINTS:
        found[f"q_{j}"] = Sensor(None, f"encoder_{j}_bias", "encoder_noise", "encoder_quantum")
        found[f"qd_{j}"] = Sensor("encoder_velocity_delay", None, "encoder_velocity_noise", None)
        for s in "ab":
            found[f"p_{j}_{s}"] = Sensor(None, f"pressure_{j}_{s}_bias", "pressure_noise", "pressure_quantum")
    found["p_pump"] = Sensor(None, "pressure_pump_bias", "pressure_noise", "pressure_quantum")
    for imu in ("cabin", "tool"):
        for kind, axes in (("rate", AXES), ("acc", AXES)):
            for a in axes:
                found[f"imu_{imu}_{kind}_{a}"] = Sensor(
                    None, f"imu_{imu}_{kind}_{a}_bias", f"imu_{kind}_noise", None
                )
        for angle in ("roll", "pitch"):
            found[f"imu_{imu}_{angle}"] = Sensor(None, f"imu_{imu}_{angle}_bias", "imu_angle_noise", None)
    return found


def _cabin(now: Instant, p: Namespace) -> dict[str, Any]:
    place = ca.vertcat(p.imu_cabin_x, p.imu_cabin_y, 0)
    rate = ca.vertcat(0, 0, now.motion.v[multibody.SLEW])
    at = multibody.fixed(place, now.motion.q, now.motion.v)
    force = at.jacobian @ now.acceleration + at.bias - now.gravity
    return _imu("cabin", rate, force, now.gravity, p)


def _tool(now: Instant, p: Namespace) -> dict[str, Any]:
    q, v = now.motion.q, now.motion.v
    line = now.motion.lines[-1]
    base, direction = line.base, line.direction
    motion_jacobian = base.jacobian + p.imu_tool_distance * direction.jacobian
    bias = base.bias + p.imu_tool_distance * direction.bias
    force = motion_jacobian @ now.acceleration + bias + now.shaking - now.gravity
    turn = multibody.tool_rotation(q)
    rate = multibody.tool_rate(q, v)
    return _imu("tool", turn.T @ rate, turn.T @ force, turn.T @ now.gravity, p)


def _imu(name: str, rate: ca.SX, force: ca.SX, gravity: ca.SX, p: Namespace) -> dict[str, Any]:
    """Outputs of one IMU from body rate, specific force and gravity in its nominal axes."""
    mount = ca.vertcat(*(getattr(p, f"imu_{name}_mount_{a}") for a in AXES))
    rate, force, gravity = (v - ca.cross(mount, v) for v in (rate, force, gravity))
    found = {f"imu_{name}_rate_{a}": rate[i] for i, a in enumerate(AXES)}
    found |= {f"imu_{name}_acc_{a}": force[i] for i, a in enumerate(AXES)}
    found[f"imu_{name}_roll"] = ca.atan2(-gravity[1], -gravity[2])
    found[f"imu_{name}_pitch"] = ca.atan2(gravity[0], ca.sqrt(gravity[1] ** 2 + gravity[2] ** 2))
    return found
