"""Model predictive controller for slew, arm and tool: estimator at 50 Hz, optimisation at 10 Hz.

Every tick    slew speed from gyro and encoder; inertia, as a load, from motor pressures; swing from the IMU
              of the tool; the valve's opening and the arm's rates from the commands on their way
Every fifth   the state is predicted to where a new command acts, the plan of the last time is moved on, the
              solver (solver.py) improves it; its first inputs are the commands until the next time

A plan that the solver did not get far enough with in its fixed budget is not used: the commands then are
those of a braking parabola with the arm at rest (`_fallback`), and `fallbacks` counts it; the unfinished plan
is where the next solve begins, no more.  All comes from nominal figures and sensors; equations: README.md.
"""

from typing import Any

import casadi as ca

from baselines.nmpc import cost, prediction, solver
from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals
from fmus.equations import kinematics, slew_control as control

STEP = control.STEP
PERIOD = 5  # ticks from solve to solve
WAY = 10  # ticks from a solve to the first effect of its commands: one to appear, the rest to the spool
PAIR = 2  # ticks of a step of the prediction over WAY
CHANNELS = ("opening", "boom", "stick")
SENSORS = (
    "imu_cabin_rate_z", "p_slew_a", "p_slew_b",
    "imu_tool_roll", "imu_tool_pitch", "imu_tool_rate_x", "imu_tool_rate_y",
)  # fmt: skip
CONTROL = {
    "control_observer_rate", "control_arm_margin", "control_inertia_extra", "control_displacement",
    "control_friction_viscous", "control_friction_dry", "control_ratio_rate",
}  # fmt: skip
LOADS = (-1000.0, 4000.0)  # kg, what is believed to hang at the arm tip: a lighter machine counts as less
SETTLED_S = 0.4  # after a change of sign, until the spool is out of its dead band
FILTER = 10.0  # 1/s, of the pressures' rates
FALLBACK_BRAKE = 0.1  # rad/s2, deceleration that the fallback counts on: at 2 t and far out there is more
FALLBACK_SLOPE = 0.5  # 1/s
FALLBACK_GAIN = 0.8  # opening for each rad/s of wanted speed


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    speed, angle, bias = control.observed(x.angle, x.bias, u, p)
    sent = {c: ca.vertcat(*(getattr(x, f"{c}_{i}") for i in range(WAY))) for c in CHANNELS}
    now = _state(x, u, speed, p)
    due = x.phase < 0.5
    plan = ca.vertcat(*(getattr(x, f"plan_{i:02d}") for i in range(solver.SIZE)))
    commands, plan, failed = _planned()(
        due, now, ca.vertcat(*sent.values()), plan, _task(x, u, p), p.nmpc_tolerance
    )
    commands = ca.if_else(due, commands, ca.vertcat(*(sent[c][-1] for c in CHANNELS)))
    opening = commands[0] * (1 - _resting(now, p))
    own = _step(STEP)(now, ca.vertcat(*(sent[c][0] for c in CHANNELS)), _load(x, u, p))
    learnt = _learnt(x, u, now, speed, sent["opening"][0], p)
    joystick = _joystick(opening, learnt["band"], p)
    return {
        "angle": angle,
        "bias": bias,
        "phase": ca.if_else(x.phase > PERIOD - 1.5, 0.0, x.phase + 1.0),
        **learnt,
        **control.weighed(x, u, speed, p),
        "opening": own[prediction.STATES.index("opening")],
        "boom_rate": own[prediction.STATES.index("boom_rate")],
        "stick_rate": own[prediction.STATES.index("stick_rate")],
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


def _planned() -> ca.Function:
    """(due, state, commands sent, plan, task, tolerance) -> (commands, plan, whether the fallback is on)."""
    names = (
        ("now", solver.NX),
        ("sent", 3 * WAY),
        ("plan", solver.SIZE),
        ("task", len(cost.TASK)),
        ("tol", 1),
    )
    now, sent, plan, task, tolerance = arguments = [ca.MX.sym(n, size) for n, size in names]  # type: ignore[call-arg]
    ahead = _ahead(now, sent, task[0])
    given = ca.vertcat(*(sent[(c + 1) * WAY - 1] for c in range(len(CHANNELS))))
    found, gain, _ = solver.solver()(ahead, solver.shifted(plan), given, task)
    failed = 1 - (gain < tolerance)  # a gain that is not a number fails, too
    commands = ca.if_else(failed, _fallback(ahead), solver.inputs(found, 0))
    due = ca.Function("due", arguments, [commands, found, failed])
    waiting = ca.Function("waiting", arguments, [ca.MX.zeros(3), plan, ca.MX(0)])
    return ca.Function.if_else("planned", due, waiting)


def _ahead(now: Any, sent: Any, load: Any) -> Any:
    """The state WAY ticks later, with the commands on their way."""
    step = _step(PAIR * STEP)
    for tick in range(0, WAY, PAIR):
        means = [(sent[c * WAY + tick] + sent[c * WAY + tick + 1]) / 2 for c in range(len(CHANNELS))]
        now = step(now, ca.vertcat(*means), load)
    return now


def _step(h: float) -> ca.Function:
    """(x, u, load) -> x after `h` s."""
    x, u, load = ca.SX.sym("x", solver.NX), ca.SX.sym("u", solver.NU), ca.SX.sym("load")  # type: ignore[call-arg]
    return ca.Function("nmpc_ahead", [x, u, load], [ca.cse(prediction.step(x, u, load, h))])


def _state(x: Namespace, u: Namespace, speed: Any, p: Namespace) -> Any:
    """Estimated state [13]; the slew angle counts from the target."""
    away = control.wrap(u.q_slew - control.target_angle(u))
    roll, pitch = u.imu_tool_roll - x.roll_zero, u.imu_tool_pitch - x.pitch_zero
    c, s = ca.cos(roll), ca.sin(roll)
    p_a, p_b = (ca.fmax(pressure / prediction.PRESSURE, 0.0) for pressure in (u.p_slew_a, u.p_slew_b))
    values = {
        "slew": away,
        "speed": speed,
        "p_sum": p_a + p_b,
        "p_difference": p_a - p_b,
        "opening": x.opening,
        "roll": roll,
        "pitch": pitch,
        # the IMU's axes turn with the tool: fmus/equations/multibody.py, tool_rate
        "roll_rate": u.imu_tool_rate_x + ca.sin(pitch) * speed,
        "pitch_rate": (u.imu_tool_rate_y - s * ca.cos(pitch) * speed) / c,
        "boom": u.q_boom,
        "stick": u.q_stick,
        "boom_rate": x.boom_rate,
        "stick_rate": x.stick_rate,
    }
    return ca.vertcat(*(values[name] for name in prediction.STATES))


def _load(x: Namespace, u: Namespace, p: Namespace) -> Any:
    """Load (kg) at the arm tip that makes the inertia what it was found to be."""
    radius, _ = kinematics.arm_tip(u.q_boom, u.q_stick, p)
    told = control.inertia(x, u, p) / x.ratio
    return control.clip(u.load_told + (x.ratio - 1.0) * told / radius**2, *LOADS)


def _task(x: Namespace, u: Namespace, p: Namespace) -> Any:
    _, boom, stick = kinematics.inverse(u.target_x, u.target_y, u.target_z, p)
    pace = control.clip(u.pace, 0.1, 2.0)
    values = {
        "load": _load(x, u, p),
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


def _learnt(x: Namespace, u: Namespace, now: Any, speed: Any, acting: Any, p: Namespace) -> dict[str, Any]:
    """Next dead band and zeros of the tool's IMU: what differs from machine to machine and stays.

    `acting`: the commanded opening at the valve.  While its sign changes, the spool crosses the dead band and
    tells nothing of it.
    """
    climbs = [FILTER * (u.p_slew_a - x.slow_p_a), FILTER * (u.p_slew_b - x.slow_p_b)]
    sizes = (u.p_slew_a, u.p_slew_b, *climbs)
    miss = _miss()(x.opening, *(v / prediction.PRESSURE for v in sizes), speed)
    same = ca.if_else(acting * x.opening > 0, ca.fmin(x.same + STEP, SETTLED_S), 0.0)
    miss = miss * (same > SETTLED_S - STEP / 2)
    standing = ca.fabs(speed) < prediction.STILL
    share = STEP * p.nmpc_zero_rate
    return {
        "band": control.clip(x.band - STEP * p.nmpc_band_rate * miss, -0.08, 0.12),
        "same": same,
        "slow_p_a": x.slow_p_a + STEP * climbs[0],
        "slow_p_b": x.slow_p_b + STEP * climbs[1],
        "roll_zero": x.roll_zero + share * standing * (u.imu_tool_roll - x.roll_zero),
        "pitch_zero": x.pitch_zero + share * standing * (u.imu_tool_pitch - x.pitch_zero),
    }


def _miss() -> ca.Function:
    """`prediction.opening_miss` as a function."""
    symbols = [ca.SX.sym(n) for n in ("opening", "p_a", "p_b", "climb_a", "climb_b", "speed")]  # type: ignore[call-arg]
    return ca.Function("nmpc_miss", symbols, [prediction.opening_miss(*symbols)])


def _joystick(opening: Any, band: Any, p: Namespace) -> Any:
    return prediction.joystick(opening, prediction.figures().slew_dead_band + band, p.nmpc_ramp)


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
        *control.INERTIA_STATES,
        Variable("band", "1", "Learnt part of the dead band"),
        Variable("same", "s", "Time since the valve's command last changed sign"),
        Variable("slow_p_a", "Pa", "Filtered motor pressure, side a", nominal=prediction.PRESSURE),
        Variable("slow_p_b", "Pa", "Filtered motor pressure, side b", nominal=prediction.PRESSURE),
        Variable("roll_zero", "rad", "Roll that the tool's IMU shows at rest"),
        Variable("pitch_zero", "rad", "Pitch that the tool's IMU shows at rest"),
        Variable("opening", "1", "Valve opening, from the commands"),
        Variable("boom_rate", "rad/s", "Boom rate, from the commands"),
        Variable("stick_rate", "rad/s", "Stick rate, from the commands"),
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
