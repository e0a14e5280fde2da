"""Model predictive controller for slew, arm and tool: estimator at 50 Hz, optimisation at 10 Hz.

Every tick    slew speed from gyro and encoder; inertia, as a load, from motor pressures; swing from the IMU
              of the tool; the valve's opening and the arm's rates from the commands on their way; whether
              the speed is late behind the pressures (lateness.py)
Every fifth   the state is predicted to where a new command acts, the plan of the last time is moved on, the
              solver (solver.py) improves it; its first inputs are the commands until the next time

A plan that the solver did not get far enough with in its fixed budget is not used: the commands then are
those of a braking parabola with the arm at rest (`_fallback`), and `fallbacks` counts it; the unfinished plan
is where the next solve begins, no more.  All comes from nominal figures and sensors; equations: README.md.
"""

from typing import Any

import casadi as ca

from baselines.nmpc import cost, estimator, lateness, solver
from baselines.nmpc.estimator import CHANNELS, CONTROL, PERIOD, SENSORS, STEP, WAY
from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals
from fmus.equations import kinematics, slew_control as control

SOONEST = (
    6  # ticks that commands are counted on to be on their way, at least: README.md, "How late the drive is"
)
FALLBACK_BRAKE = 0.1  # rad/s2, deceleration that the fallback counts on: at 2 t and far out there is more
FALLBACK_SLOPE = 0.5  # 1/s
FALLBACK_GAIN = 0.8  # opening for each rad/s of wanted speed


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    speed, angle, bias = control.observed(x.angle, x.bias, u, p)
    sent = {c: ca.vertcat(*(getattr(x, f"{c}_{i}") for i in range(WAY))) for c in CHANNELS}
    away = control.wrap(u.q_slew + p.nmpc_late * speed - control.target_angle(u))
    now = estimator.state(x, u, away, speed)
    due = x.phase < 0.5
    plan = ca.vertcat(*(getattr(x, f"plan_{i:02d}") for i in range(solver.SIZE)))
    commands, plan, failed = _planned()(
        due, now, ca.vertcat(*sent.values()), _ticks(x, p), plan, _task(x, u, p), p.nmpc_tolerance
    )
    commands = ca.if_else(due, commands, ca.vertcat(*(sent[c][-1] for c in CHANNELS)))
    opening = commands[0] * (1 - _resting(now, p))
    acting = ca.vertcat(*(sent[c][WAY - SOONEST] for c in CHANNELS))
    known = estimator.estimated(x, u, now, speed, acting, p)
    joystick = estimator.joystick(opening, known["band"], p)
    return {
        "angle": angle,
        "bias": bias,
        "phase": ca.if_else(x.phase > PERIOD - 1.5, 0.0, x.phase + 1.0),
        **known,
        **lateness.told(x, u, speed, p),
        "solves": x.solves + due,
        "fallbacks": x.fallbacks + failed,
        "slew_command": joystick,
        "boom_reference": commands[1],
        "stick_reference": commands[2],
        **{
            f"{c}_{i}": sent[c][i + 1] if i + 1 < WAY else new
            for c, new in zip(CHANNELS, (opening, commands[1], commands[2]), strict=True)
            for i in range(WAY)
        },
        **{f"plan_{i:02d}": plan[i] for i in range(solver.SIZE)},
    }


def _ticks(x: Namespace, p: Namespace) -> Any:
    """Ticks of commands that are counted on: more where the speed is late."""
    return SOONEST + lateness.ticks(x, p)


def _planned() -> ca.Function:
    """(due, state, commands sent, ticks of them, plan, task, tolerance) -> (commands, plan, fallback on)."""
    names = (
        ("now", solver.NX),
        ("sent", 3 * WAY),
        ("ticks", 1),
        ("plan", solver.SIZE),
        ("task", len(cost.TASK)),
        ("tol", 1),
    )
    now, sent, ticks, plan, task, tolerance = arguments = [ca.MX.sym(n, size) for n, size in names]  # type: ignore[call-arg]
    ahead = estimator.ahead(now, sent, task[0], ticks)
    given = ca.vertcat(*(sent[(c + 1) * WAY - 1] for c in range(len(CHANNELS))))
    found, gain, _ = solver.solver()(ahead, solver.shifted(plan), given, task)
    failed = 1 - (gain < tolerance)  # a gain that is not a number fails, too
    commands = ca.if_else(failed, _fallback(ahead), solver.inputs(found, 0))
    due = ca.Function("due", arguments, [commands, found, failed])
    waiting = ca.Function("waiting", arguments, [ca.MX.zeros(3), plan, ca.MX(0)])
    return ca.Function.if_else("planned", due, waiting)


def _task(x: Namespace, u: Namespace, p: Namespace) -> Any:
    _, boom, stick = kinematics.inverse(u.target_x, u.target_y, u.target_z, p)
    pace = control.clip(u.pace, 0.1, 2.0)
    values = {
        "load": estimator.load(x, u, p),
        "boom": control.within_joint(boom, p.boom_min, p.boom_max, p),
        "stick": control.within_joint(stick, p.stick_min, p.stick_max, p),
        "speed_limit": p.nmpc_speed_limit * pace,
        **{name: getattr(p, f"nmpc_{name}") for name in cost.TASK[4:]},
    }
    return ca.vertcat(*(values[name] for name in cost.TASK))


def _fallback(x: Any) -> Any:
    """Opening of a braking parabola at the predicted state, arm at rest."""
    away, speed = x[0], x[1]
    wanted = control.parabola(-away - 0.5 * speed, FALLBACK_BRAKE, FALLBACK_SLOPE)
    wanted = control.clip(wanted, -0.3, 0.3)
    opening = FALLBACK_GAIN * wanted + 0.5 * (wanted - speed)
    return ca.vertcat(control.clip(opening, -1.0, 1.0), 0.0, 0.0)


def _resting(now: Any, p: Namespace) -> Any:
    """Whether slew and tool stand at the target."""
    return (
        (ca.fabs(now[0]) < p.nmpc_rest_band)
        * (ca.fabs(now[1]) < 2 * p.nmpc_rest_band)
        * (ca.fabs(now[5]) + ca.fabs(now[7]) < 8 * p.nmpc_rest_band)
    )


MODEL = Model(
    name="nmpc",
    description="Model predictive control of slew, arm and swinging tool",
    kind="discrete",
    step=STEP,
    states=(
        Variable("angle", "rad", "Slew angle of the observer"),
        Variable("bias", "rad/s", "Bias of the cabin's gyro"),
        Variable("phase", "1", "Ticks since the last solve, 0 to 4"),
        *estimator.STATES,
        *lateness.STATES,
        Variable("solves", "1", "Solves so far"),
        Variable("fallbacks", "1", "Solves whose plan was not used"),
        *control.COMMAND_STATES,
        *(
            Variable(f"{c}_{i}", "1" if c == "opening" else "rad/s", f"Command {c}, {WAY - 1 - i} ticks old")
            for c in CHANNELS
            for i in range(WAY)
        ),
        *(
            Variable(f"plan_{i:02d}", "1" if i < solver.STAGES else "rad/s", "Of the plan")
            for i in range(solver.SIZE)
        ),
    ),
    inputs=from_signals(*control.TARGETS, *control.ENCODERS, *SENSORS),
    outputs=from_signals(*control.COMMANDS),
    parameters=(
        *(v for v in from_parameters("geometry") if v.name in control.GEOMETRY),
        *(v for v in from_parameters("control") if v.name in CONTROL),
        *from_parameters("nmpc"),
    ),
    rhs=_next_state,
    out=control.commands,
    symbolic="MX",
)  # fmt: skip
