"""From an observation to a network's inputs, and from its outputs to commands: CasADi, written once.

Torch (training), ONNX (export) and the FMU's C code are all made from these expressions.  Trigonometry is
kept to sine, cosine and root, which all three have in double precision: an angle D between two directions
enters as 2 tan(D / 2) = 2 sin D / (1 + cos D), which is D for small ones.

Scales are those of the authors' public training where it has them (slew speed 0.3, arm speeds 0.15 rad/s,
inertia 4e5 ± 2e5 kg m2, target 9 ± 2 m and 6 ± 2 m); the tool's are smaller (0.3 rad, 0.5 rad/s), because a
controller that is to keep it still sees less of it.
"""

from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from fmus.equations import kinematics
from specs import parameters
from specs.ahead import NOTHING, PARTS, PLACE, Ahead, odd, place_name, plane_names
from specs.policy import ACTIONS, ARM_LIMIT, CHANNELS, LIMITS, ONCE, SLEW_ERROR, size

SCALES = {  # of channels with their whole history
    "u_slew": 1.0, "qd_boom_ref": 0.2, "qd_stick_ref": 0.2,
    "imu_tool_roll": 0.3, "imu_tool_pitch": 0.3, "imu_cabin_rate_z": 0.3, "qd_boom": 0.15, "qd_stick": 0.15,
    "imu_tool_rate_x": 0.5, "imu_tool_rate_y": 0.5,
}  # fmt: skip
STEPS = {SLEW_ERROR: 0.1, "q_boom": 0.05, "q_stick": 0.05}  # rad, of older angles less the newest
NEAR = {SLEW_ERROR: 0.1, "q_boom": 0.05, "q_stick": 0.05}  # rad: errors are also seen through tanh(e / this)
FAR = {SLEW_ERROR: 1.5, "q_boom": 0.5, "q_stick": 0.5}
STEEP = 10.0  # m/rad of a distance's slope by an angle: about the reach
SLEW_CHANNELS = ("u_slew", "imu_cabin_rate_z")  # of the slew-only policy, with the slew error
HOLD_GAIN = 0.8  # 1/s: how the slew-only policy keeps the arm on its target
PD_GAIN, PD_DAMPING = 0.6, 0.3  # 1/s and 1 of the prior, at pace 1
PD_RAMP, PD_MOST = 0.03, 0.8  # rad/s over which the dead band is undone; largest joystick
BRAKE_SHARE, BRAKE_PREVIEW, BRAKE_SLOPE = 0.6, 0.4, 0.8  # 1, s and 1/s of the prior "parabola", at pace 1
BRAKE_SPEED, BRAKE_GAIN = 0.6, 2.0  # rad/s and 1
GENTLE_STEP = 0.25  # rad/s: how far ahead of the speed the prior "gentle" opens the valve, at pace 1
_CONTROL = parameters.load("control")
# change sign where left and right are exchanged
ODD = {"u_slew", SLEW_ERROR, "imu_tool_roll", "imu_cabin_rate_z", "imu_tool_rate_x"}
OUTPUTS = {"slew": 1, "full": 3}
ACTION_SCALE = {"u_slew": 1.0, "qd_boom_ref": ARM_LIMIT, "qd_stick_ref": ARM_LIMIT}


class Reader:
    """Entries of an observation [N] by name and age."""

    def __init__(self, observation: Any, history: int, ahead: Ahead = NOTHING) -> None:
        self.observation, self.history = observation, history
        self._single = (*ONCE, *ahead.names)

    def rows(self, channel: str) -> list[Any]:
        """A channel's values, oldest first."""
        first = CHANNELS.index(channel) * self.history
        return [self.observation[first + i] for i in range(self.history)]

    def now(self, channel: str) -> Any:
        """A channel's newest value, or one of what stands once."""
        if channel in self._single:
            return self.observation[len(CHANNELS) * self.history + self._single.index(channel)]
        return self.rows(channel)[-1]


@cache
def features(task: str, history: int, ahead: Ahead = NOTHING) -> ca.Function:
    """observation [N] -> the network's inputs [M], about -1 … 1; of what is `ahead` they come last."""
    observation = ca.SX.sym("observation", size(history, ahead))
    read = Reader(observation, history, ahead)
    joints = {SLEW_ERROR: read.now(SLEW_ERROR)}
    channels = SLEW_CHANNELS
    if task == "full":
        channels = tuple(SCALES)
        joints |= joint_errors(read)
    found = [row / SCALES[channel] for channel in channels for row in read.rows(channel)]
    for name, error in joints.items():
        found += [(row - read.now(name)) / STEPS[name] for row in read.rows(name)[:-1]]
        found += _near_and_far(name, error)
    found += [_inertia(read), (read.now("pace") - 1.0) / 0.5]
    if task == "full":
        found += [(read.now("q_boom") - 1.1) / 0.3, (read.now("q_stick") + 1.2) / 0.6]
        found += [(read.now("target_radius") - 9.0) / 2.0, (read.now("target_z") - 6.0) / 2.0]
    found += [*_way(read, ahead), *_field(read, ahead)]
    return ca.Function("features", [observation], [ca.cse(ca.vertcat(*found))])


def _near_and_far(name: str, error: Any) -> list[Any]:
    return [error / FAR[name], ca.tanh(error / NEAR[name])]


def _way(read: Reader, ahead: Ahead) -> list[Any]:
    """Angles past those of each place of the way, as the errors to the target are seen."""
    found: list[Any] = []
    for seconds in ahead.waypoints_s:
        slew, radius, z = (read.now(place_name(what, seconds)) for what in PLACE)
        errors = {SLEW_ERROR: slew, **joint_errors(read, radius, z)}
        found += [part for name, error in errors.items() for part in _near_and_far(name, error)]
    return found


def _field(read: Reader, ahead: Ahead) -> list[Any]:
    """How near the nearest things are, 0 from `field_m` on and 1 at a contact, and that times each slope."""
    found: list[Any] = []
    for part in PARTS if ahead.field_m else ():
        distance, *slopes = (read.now(name) for name in plane_names(part))
        near = 1.0 - distance / ahead.field_m
        found += [near, *(near * slope / STEEP for slope in slopes)]
    return found


@cache
def mirrored(task: str, history: int, end: str, ahead: Ahead = NOTHING) -> tuple[float, ...]:
    """Signs of the network's inputs, or of its outputs, where left and right are exchanged."""
    if end == "outputs":
        return tuple(-1.0 if name in ODD else 1.0 for name in ACTIONS[: OUTPUTS[task]])
    turned = [-1.0 if name in ODD else 1.0 for name in CHANNELS for _ in range(history)] + [1.0] * len(ONCE)
    turned += [-1.0 if odd(name) else 1.0 for name in ahead.names]
    at = 0.01 * ca.linspace(1.0, 2.0, len(turned))  # any observation in which nothing is 0
    here, there = (np.array(features(task, history, ahead)(x)).ravel() for x in (at, at * ca.DM(turned)))
    return tuple(float(np.sign(a * b)) for a, b in zip(here, there, strict=True))


@cache
def commands(
    task: str, history: int, prior: str = "", change: float = 0.0, ahead: Ahead = NOTHING
) -> ca.Function:
    """(outputs of the network, observation) -> commands [3] in SI before they are limited.

    With a prior the answer is added to a plain law: slew by PD ("pd") or braking parabola ("parabola") with
    its dead band undone, arm to the target's pose.  With a `change` the joystick stays within it of the one
    that was held; the rounded limit leaves a slope to train through.
    """
    observation = ca.SX.sym("observation", size(history, ahead))
    y = ca.SX.sym("y", OUTPUTS[task])
    read = Reader(observation, history)
    arm = [-HOLD_GAIN * error for error in joint_errors(read).values()]
    law = [_SLEW[prior](read), *(ARM_LIMIT * ca.tanh(r / ARM_LIMIT) for r in arm)] if prior else [0.0] * 3
    found = [y[0] + law[0], *arm]
    if task == "full":
        found = [y[i] * ACTION_SCALE[name] + law[i] for i, name in enumerate(ACTIONS)]
    if change:
        held = read.now("u_slew")
        found[0] = held + change * ca.tanh((found[0] - held) / change)
    return ca.Function("commands", [y, observation], [ca.cse(ca.vertcat(*found))])


@cache
def limited() -> ca.Function:
    """Commands [3] -> commands [3] within LIMITS."""
    x = ca.SX.sym("x", len(ACTIONS))
    found = [ca.fmin(ca.fmax(x[i], LIMITS[n][0]), LIMITS[n][1]) for i, n in enumerate(ACTIONS)]
    return ca.Function("limited", [x], [ca.vertcat(*found)])


def joint_errors(read: Reader, radius: Any = None, z: Any = None) -> dict[str, Any]:
    """Angle past the one that hangs the grab on a place, as 2 tan(D / 2), of boom and stick, rad.

    `radius`, `z`: where that is, m; the target without them.
    """
    g = kinematics.geometry()
    radius, z = (read.now("target_radius"), read.now("target_z")) if radius is None else (radius, z)
    dx, dz = radius - g.boom_foot_x, z + g.tool_length - g.boom_foot_z
    cosine = (dx * dx + dz * dz - g.boom_length**2 - g.stick_length**2) / (2 * g.boom_length * g.stick_length)
    cosine = ca.fmin(ca.fmax(cosine, -1.0), 1.0)
    sine = ca.sqrt(1.0 - cosine * cosine)
    along, across = g.boom_length + g.stick_length * cosine, g.stick_length * sine
    size = ca.sqrt((dx * dx + dz * dz) * (along * along + across * across))
    boom = ((dz * along + dx * across) / size, (dx * along - dz * across) / size)  # sine, cosine of the goal
    return {
        "q_boom": _past(read.now("q_boom"), *boom),
        "q_stick": _past(read.now("q_stick"), -sine, cosine),
    }


def _pd(read: Reader) -> Any:
    """Joystick for a speed in proportion to error and pace, less a share of the speed; PD_MOST at most."""
    speed = -PD_GAIN * read.now("pace") * read.now(SLEW_ERROR) - PD_DAMPING * read.now("imu_cabin_rate_z")
    return _joystick(speed, PD_MOST)


def _braking(read: Reader) -> tuple[Any, Any]:
    """(speed from which a share of the braking torque, by pace, stops at the target; speed now), rad/s.

    baselines/parabola, with every corner rounded: a network is trained through it.
    """
    rate = read.now("imu_cabin_rate_z")
    pose = read.now("q_boom"), read.now("q_stick"), read.now("load_told")
    moment = kinematics.inertia_z(*pose, kinematics.geometry()) + _CONTROL["control_inertia_extra"].value
    brake = BRAKE_SHARE * read.now("pace") * _CONTROL["control_brake_torque"].value / moment
    error = read.now(SLEW_ERROR) + BRAKE_PREVIEW * rate
    knee = 2.0 * brake / BRAKE_SLOPE**2
    speed = -error * ca.sqrt(2.0 * brake / ca.sqrt(error * error + knee * knee))
    speed = BRAKE_SPEED * ca.tanh(speed / BRAKE_SPEED)
    return speed, rate


def _parabola(read: Reader) -> Any:
    """Joystick that comes to the parabola's speed as fast as the drive can."""
    speed, rate = _braking(read)
    return _joystick(speed + BRAKE_GAIN * (speed - rate), 1.0)


def _gentle(read: Reader) -> Any:
    """Joystick that comes to the parabola's speed by no more than a step beyond the present one, by pace."""
    speed, rate = _braking(read)
    step = GENTLE_STEP * read.now("pace")
    return _joystick(rate + step * ca.tanh((1.0 + BRAKE_GAIN) * (speed - rate) / step), 1.0)


def _joystick(speed: Any, most: float) -> Any:
    """Joystick that settles at a speed: dead band undone over PD_RAMP, `most` at most."""
    band, slope = (_CONTROL[f"control_{n}"].value for n in ("dead_band", "valve_slope"))
    return most * ca.tanh((band * ca.tanh(speed / PD_RAMP) + slope * speed) / most)


_SLEW = {"pd": _pd, "parabola": _parabola, "gentle": _gentle}


def _past(q: Any, sine: Any, cosine: Any) -> Any:
    s, c = ca.sin(q) * cosine - ca.cos(q) * sine, ca.cos(q) * cosine + ca.sin(q) * sine
    return 2.0 * s / (1.0 + c)


def _inertia(read: Reader) -> Any:
    """I_z of the newest pose with the told load."""
    pose = read.now("q_boom"), read.now("q_stick"), read.now("load_told")
    return (kinematics.inertia_z(*pose, kinematics.geometry()) - 4e5) / 2e5


@cache
def errors() -> ca.Function:
    """(slew error, radius, height, roll, pitch, target radius, target z) -> grab point less target [3], m.

    In the target's own frame: x outward through the target, y left, z up; the tool hangs `tool_length` below.
    """
    e, radius, height, roll, pitch, x, z = inputs = [ca.SX.sym(f"i{i}") for i in range(7)]
    length = kinematics.geometry().tool_length
    arm = length * ca.cos(roll)
    radial, tangential = radius - arm * ca.sin(pitch), length * ca.sin(roll)
    point = ca.vertcat(
        radial * ca.cos(e) - tangential * ca.sin(e) - x,
        radial * ca.sin(e) + tangential * ca.cos(e),
        height - arm * ca.cos(pitch) - z,
    )
    return ca.Function("errors", [ca.vertcat(*inputs)], [ca.cse(point)])
