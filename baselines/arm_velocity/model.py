"""The machine's own arm velocity controller at 50 Hz: 25-point table feed-forward and PI, position limits.

For boom and stick each:

    ref    = clip(qd_ref, +-limit), slowed towards the joint limits and zero at them
    model  = ref through two first-order lags (T/2 each): what the late measurement should read by now
    u      = clip(table(ref) + K e + I, +-1),   e = model - qd,   I += dt K r e, clamped, leaking at rest

The measured velocity is some 0.2 s late.  Comparing it with the reference itself would wind up the integral
in every transient; it is compared with the lagged reference, so the PI corrects what the table gets wrong and
leaves the transients to the table.  Commands are held in the state (one step after their inputs).
The table is written by `slewright calibrate lut`: 25 joystick values at even velocities -0.2..0.2 rad/s.
"""

from collections.abc import Sequence

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals

STEP = 0.02  # s
POINTS = 25
JOINTS = ("boom", "stick")
USED = {"boom_min", "boom_max", "stick_min", "stick_max"}  # of specs/parameters/geometry.toml


def table(reference: ca.SX, values: Sequence[ca.SX], limit: ca.SX) -> ca.SX:
    """Piecewise linear through `values` at even references -limit..limit, held beyond: exact, no branches."""
    place = (reference / limit + 1) * (len(values) - 1) / 2
    result = values[0]
    for i in range(1, len(values)):
        share = ca.fmin(ca.fmax(place - (i - 1), 0), 1)
        result = result + share * (values[i] - values[i - 1])
    return result


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, ca.SX]:
    return {name: value for joint in JOINTS for name, value in _joint(joint, x, u, p).items()}


def _joint(joint: str, x: Namespace, u: Namespace, p: Namespace) -> dict[str, ca.SX]:
    def of(group: Namespace, before: str, after: str) -> ca.SX:
        return getattr(group, before + joint + after)

    values = [of(p, "lut_", f"_{i:02d}") for i in range(POINTS)]
    low, high = of(p, "", "_min"), of(p, "", "_max")
    reference = _limited(of(u, "qd_", "_ref"), of(u, "q_", ""), low, high, p)
    lagged, model, integral = of(x, "", "_lagged"), of(x, "", "_model"), of(x, "", "_integral")
    error = model - of(u, "qd_", "")
    wanted = table(reference, values, p.arm_velocity_limit) + p.arm_velocity_gain * error + integral
    share = 2 * STEP / p.arm_velocity_lag  # of each lag, in one step
    return {
        f"{joint}_lagged": lagged + share * (reference - lagged),
        f"{joint}_model": model + share * (lagged - model),
        f"{joint}_integral": _integrated(integral, error, wanted, model, p),
        f"{joint}_command": _clip(wanted, -1, 1),
    }


def _limited(reference: ca.SX, q: ca.SX, low: ca.SX, high: ca.SX, p: Namespace) -> ca.SX:
    """Clip the reference; near a joint limit, slow down in proportion to the distance left."""
    reference = _clip(reference, -p.arm_velocity_limit, p.arm_velocity_limit)
    up = p.arm_velocity_stop_gain * ca.fmax(high - p.arm_velocity_margin - q, 0)
    down = p.arm_velocity_stop_gain * ca.fmax(q - low - p.arm_velocity_margin, 0)
    return _clip(reference, -down, up)


def _integrated(integral: ca.SX, error: ca.SX, wanted: ca.SX, model: ca.SX, p: Namespace) -> ca.SX:
    """Next integral: held when it would push further into saturation, leaking away at rest."""
    into_limit = (wanted > 1) * (error > 0) + (wanted < -1) * (error < 0)
    growth = p.arm_velocity_gain * p.arm_velocity_reset_rate * error * (1 - into_limit)
    at_rest = ca.fabs(model) < p.arm_velocity_rest
    rate = ca.if_else(at_rest, -p.arm_velocity_leak * integral, growth)
    return _clip(integral + STEP * rate, -p.arm_velocity_integral_limit, p.arm_velocity_integral_limit)


def _clip(value: ca.SX, low: ca.SX | float, high: ca.SX | float) -> ca.SX:
    return ca.fmin(ca.fmax(value, low), high)


def _outputs(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, ca.SX]:
    return {"u_boom": x.boom_command, "u_stick": x.stick_command}


MODEL = Model(
    name="arm_velocity",
    description="Arm velocity controller: 25-point table feed-forward, PI, position limits",
    kind="discrete",
    step=STEP,
    states=tuple(
        Variable(f"{joint}_{name}", unit, f"{joint.capitalize()}: {what}")
        for joint in JOINTS
        for name, unit, what in (
            ("lagged", "rad/s", "reference after the first lag"),
            ("model", "rad/s", "velocity the sensor should read"),
            ("integral", "1", "integral part of the command"),
            ("command", "1", "command"),
        )
    ),
    inputs=from_signals("qd_boom_ref", "qd_stick_ref", "q_boom", "q_stick", "qd_boom", "qd_stick"),
    outputs=from_signals("u_boom", "u_stick"),
    parameters=(
        *(v for v in from_parameters("geometry") if v.name in USED),
        *from_parameters("arm_velocity"),
    ),
    rhs=_next_state,
    out=_outputs,
)
