"""A model of an operator at the joysticks, 50 Hz: delay, looks now and then, noise, precision, slow hand."""

from typing import Any

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_signals
from fmus.equations import kinematics, slew_control as control

PERCEIVED = ("q_slew", "q_boom", "q_stick", "imu_cabin_rate_z")
NOISES = ("noise_a", "noise_b")


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    own = {name: _mixed(name, p) for name in _PAIRS}
    looks = x.clock + control.STEP >= own["interval"] - control.STEP / 2
    noises = {name: ca.if_else(looks, _chaos(getattr(x, name)), getattr(x, name)) for name in NOISES}
    wanted = ca.if_else(looks, _wanted(x, u, p, own), x.wanted)
    hand = control.STEP / (own["lag"] + control.STEP)
    joystick = control.joystick(wanted, p)
    return {
        "clock": ca.if_else(looks, 0.0, x.clock + control.STEP),
        "wanted": wanted,
        "slew_command": x.slew_command + hand * (joystick - x.slew_command),
        **noises,
        **_arm(u, p, own),
    }


def _wanted(x: Namespace, u: Namespace, p: Namespace, own: dict[str, Any]) -> Any:
    """Slew speed that the operator wants after a look; 0 when it is good enough."""
    told = kinematics.inertia_z(u.q_boom, u.q_stick, u.load_told, p) + p.control_inertia_extra
    noise = (x.noise_a - 0.5 + x.noise_b - 0.5) * 2.0  # of variance 1: a logistic map has 1/8
    seen = control.wrap(control.target_angle(u) - u.q_slew) * (1.0 + own["noise"] * noise)
    ahead = seen - own["preview"] * u.imu_cabin_rate_z
    limit = own["speed"] * control.clip(u.pace, 0.1, 2.0)
    brake = own["braking"] * control.braking(told, p)
    wanted = control.clip(control.parabola(ahead, brake, 1.0), -limit, limit)
    wanted = wanted + own["correction"] * (wanted - u.imu_cabin_rate_z)
    enough = (ca.fabs(ahead) < own["precision"]) * (ca.fabs(u.imu_cabin_rate_z) < own["precision"])
    return wanted * (1 - enough)


def _arm(u: Namespace, p: Namespace, own: dict[str, Any]) -> dict[str, Any]:
    """Velocity references of boom and stick: slower than a controller's, and left alone when near enough."""
    references = control.arm(u, p)
    rest = own["arm_precision"] * p.control_arm_gain
    limited = {n: control.clip(v, -own["arm_rate"], own["arm_rate"]) for n, v in references.items()}
    return {n: v * (ca.fabs(references[n]) > rest) for n, v in limited.items()}


def _chaos(value: Any) -> Any:
    """The next number of a logistic map: uncorrelated, bounded, the same bits everywhere."""
    return 4.0 * value * (1.0 - value)


def _mixed(name: str, p: Namespace) -> Any:
    expert, novice = getattr(p, f"operator_{name}"), getattr(p, f"operator_{name}_novice")
    return novice + p.operator_skill * (expert - novice)


def _start(p: Namespace) -> dict[str, Any]:
    return {
        "noise_a": p.operator_seed,
        "noise_b": _chaos(0.37 + 0.5 * p.operator_seed * (1.0 - p.operator_seed)),
    }


_PAIRS = (
    "lag", "preview", "noise", "precision", "speed", "braking", "interval", "arm_rate", "arm_precision",
    "correction",
)  # fmt: skip

MODEL = Model(
    name="operator",
    description="Model of an operator at the joysticks: delay, intermittent looks, noise, precision",
    kind="discrete",
    step=control.STEP,
    states=(
        Variable("clock", "s", "Time since the last look"),
        Variable("wanted", "rad/s", "Slew speed that the operator wants"),
        Variable("noise_a", "1", "Noise sequence"),
        Variable("noise_b", "1", "Another noise sequence"),
        *control.COMMAND_STATES,
    ),
    inputs=control.inputs(),
    outputs=from_signals(*control.COMMANDS),
    parameters=control.parameters("operator", without=control.OBSERVER_ONLY),
    rhs=_next_state,
    out=control.commands,
    initial=_start,
    delays=dict.fromkeys(PERCEIVED, "operator_delay"),
)
