"""Plan by flatness at 50 Hz: a whole move that leaves no swing, made when its target comes, then tracked."""

from types import SimpleNamespace
from typing import Any

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals
from fmus.equations import kinematics, shaping, slew_control as control

NEW = 1e-6  # rad: a target that differs by more is a new one
SLOTS = ("last", "now")  # two moves at a time: one that ends while the next one begins
JOINTS = ("boom", "stick")
MOVE = ("speed", "rise", "brake", "coast", "stiffness", "arm_time")  # what a move is made of


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    speed, angle, bias = control.observed(x.angle, x.bias, u, p)
    radius, _ = kinematics.arm_tip(u.q_boom, u.q_stick, p)
    moment = control.inertia(x, u, p)
    move = _moves(x, u, moment, p)
    gains = shaping.Gains(p.plan_angle_gain, p.plan_brake_lead, p.plan_sway_gain)
    return {
        "angle": ca.if_else(x.started > 0.5, angle, u.q_slew),
        "bias": bias,
        "started": 1.0,
        **move,
        **control.weighed(x, u, speed, p),
        **shaping.track(x, u, reference(move), move["goal"], speed, moment, radius, gains, p),
        **_arm(move, u, p),
    }


def _moves(x: Namespace, u: Namespace, moment: Any, p: Namespace) -> dict[str, Any]:
    """Next states of both moves; a new target waits until the move before the last one has ended."""
    first = x.started < 0.5
    here = {"": u.q_slew, "_boom": u.q_boom, "_stick": u.q_stick}
    from_here = ca.if_else(first, u.q_slew, x.goal)
    goals = {"": from_here + control.wrap(control.target_angle(u) - from_here), **_joint_targets(u, p)}
    differs = sum(ca.fabs(goal - getattr(x, f"goal{joint}")) for joint, goal in goals.items())
    ended = x.clock_last > ca.fmax(x.coast_last + x.brake_last, x.arm_time_last)
    new = ca.fmax(first, (differs > NEW) * ended)
    states: dict[str, Any] = {}
    for joint, goal in goals.items():
        own, passed, begin = (getattr(x, f"{name}{joint}") for name in ("goal", "passed", "begin"))
        states |= {
            f"begin{joint}": ca.if_else(first, here[joint], ca.if_else(new, passed, begin)),
            f"passed{joint}": ca.if_else(first, here[joint], ca.if_else(new, own, passed)),
            f"goal{joint}": ca.if_else(new, goal, own),
        }
    made = _planned(states, x, u, moment, p)
    for name in MOVE:
        before = getattr(x, f"{name}_now")
        states[f"{name}_now"] = ca.if_else(new, made[name], before)
        states[f"{name}_last"] = ca.if_else(new, before, getattr(x, f"{name}_last"))
    for slot, start in (("now", 0.0), ("last", x.clock_now + control.STEP)):
        states[f"clock_{slot}"] = ca.if_else(new, start, getattr(x, f"clock_{slot}") + control.STEP)
    return states


def _planned(states: dict[str, Any], x: Namespace, u: Namespace, moment: Any, p: Namespace) -> dict[str, Any]:
    """The move from `passed` to `goal`, as MOVE says, within limits at the larger inertia of both ends."""
    way, *arm = (states[f"goal{joint}"] - states[f"passed{joint}"] for joint in ("", "_boom", "_stick"))
    pace = control.clip(u.pace, 0.1, 2.0)
    there = kinematics.inertia_z(states["goal_boom"], states["goal_stick"], u.load_told, p)
    brake = pace * control.braking(ca.fmax(moment, x.ratio * (there + p.control_inertia_extra)), p)
    up, down = p.plan_rise_share * brake, p.plan_brake_share * brake
    far = ca.fabs(way)
    speed = ca.fmin(p.plan_speed_limit * pace, ca.sqrt(2 * far / (1 / up + 1 / down)))
    rise, fall = (ca.fmax(speed / rate, p.plan_least_time) for rate in (up, down))
    speed = ca.fmin(speed, 2 * far / (rise + fall))
    level = (far - speed * (rise + fall) / 2) / ca.fmax(speed, 1e-6)
    steep = STEEPEST / p.plan_arm_rate
    return {
        "speed": ca.if_else(way < 0, -speed, speed),
        "rise": rise,
        "brake": fall,
        "coast": rise + level,
        "stiffness": 1 / (p.gravity * x.inverse_length),
        "arm_time": ca.fmax(steep * ca.fmax(*(ca.fabs(q) for q in arm)), p.plan_arm_time),
    }


STEEPEST = 35 / 16  # largest slope of the step below


def step(time: Any, length: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Integral, value and three derivatives of a step from 0 to 1 in `length` s, seven times differentiable.

    Its first three derivatives are 0 at both ends: 35 t^4 - 84 t^5 + 70 t^6 - 20 t^7.
    """
    t = control.clip(time / length, 0.0, 1.0)
    area = length * (7 * t**5 - 14 * t**6 + 10 * t**7 - 2.5 * t**8) + ca.fmax(time - length, 0.0)
    value = 35 * t**4 - 84 * t**5 + 70 * t**6 - 20 * t**7
    first = 140 * t**3 * (1 - t) ** 3
    second = 420 * t**2 * (1 - t) ** 2 * (1 - 2 * t)
    third = 840 * t * (1 - t) * (1 - 5 * t + 5 * t**2)
    return area, value, first / length, second / length**2, third / length**3


def reference(move: dict[str, Any]) -> tuple[Any, Any, Any]:
    """Angle, speed and acceleration of the slew: q = z + l/g z'', z the sum of both moves."""
    r, v, a = move["begin"], 0.0, 0.0
    for slot in SLOTS:
        now = SimpleNamespace(**{name: move[f"{name}_{slot}"] for name in (*MOVE, "clock")})
        up, down = step(now.clock, now.rise), step(now.clock - now.coast, now.brake)
        z = [now.speed * (one - other) for one, other in zip(up, down, strict=True)]
        r, v, a = (
            r + z[0] + now.stiffness * z[2],
            v + z[1] + now.stiffness * z[3],
            a + z[2] + now.stiffness * z[4],
        )
    return r, v, a


def _arm(move: dict[str, Any], u: Namespace, p: Namespace) -> dict[str, Any]:
    """Velocity references of boom and stick, which follow smooth steps."""
    found = {}
    for name in JOINTS:
        begin, passed, goal = (move[f"{end}_{name}"] for end in ("begin", "passed", "goal"))
        angle, speed = begin, 0.0
        for slot, way in (("last", passed - begin), ("now", goal - passed)):
            _, value, slope, *_ = step(move[f"clock_{slot}"], move[f"arm_time_{slot}"])
            angle, speed = angle + way * value, speed + way * slope
        found[f"{name}_reference"] = shaping.joint_reference(angle, speed, getattr(u, f"q_{name}"), p)
    return found


def _joint_targets(u: Namespace, p: Namespace) -> dict[str, Any]:
    _, *wanted = kinematics.inverse(u.target_x, u.target_y, u.target_z, p)
    return {
        f"_{name}": control.within_joint(q, getattr(p, f"{name}_min"), getattr(p, f"{name}_max"), p)
        for name, q in zip(JOINTS, wanted, strict=True)
    }


MODEL = Model(
    name="plan",
    description="Plan by flatness of slew and swing, tracked, with sway feedback",
    kind="discrete",
    step=control.STEP,
    states=(
        *control.OBSERVER_STATES,
        *control.INERTIA_STATES,
        Variable("band", "1", "Learnt part of the dead band"),
        Variable("started", "1", "1 after the first step"),
        *(
            Variable(f"{name}{joint}", "rad", f"{joint.strip('_').capitalize() or 'Slew'}: {text}")
            for joint in ("", *(f"_{name}" for name in JOINTS))
            for name, text in (
                ("begin", "where the last move began"),
                ("passed", "where it ends and the present one begins"),
                ("goal", "where the present one ends"),
            )
        ),
        *(
            Variable(f"{name}_{slot}", unit, f"{text}, {slot} move", start=start)
            for slot in SLOTS
            for name, unit, text, start in (
                ("clock", "s", "Time since it began", 0.0),
                ("speed", "rad/s", "Speed between rise and fall", 0.0),
                ("rise", "s", "Length of the rise", 1.0),
                ("brake", "s", "Length of the fall", 1.0),
                ("coast", "s", "When the fall begins", 1.0),
                ("stiffness", "s2", "Pendulum's length over gravity", 0.2),
                ("arm_time", "s", "Length of the arm's move", 1.0),
            )
        ),
        *shaping.TRACKING_STATES,
        *control.COMMAND_STATES,
    ),
    inputs=control.inputs(*control.TOOL),
    outputs=from_signals(*control.COMMANDS),
    parameters=(
        *control.parameters("plan", with_gravity=True),
        *(v for v in from_parameters("shaper") if v.name in shaping.TRACKING_PARAMETERS),
    ),
    rhs=_next_state,
    out=control.commands,
)
