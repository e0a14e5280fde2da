"""What the sensors tell of drive, arm and tool: estimated state, load, dead band, zeros of the tool's IMU.

Shared by who plans with `prediction`: pure functions of states `x` (`STATES` and the observer's in
`fmus/equations/slew_control.py`), sensors `u` and parameters `p`.
"""

from typing import Any

import casadi as ca

from baselines.nmpc import prediction
from fmus.definition import Namespace, Variable
from fmus.equations import kinematics, slew_control as control

STEP = control.STEP
PERIOD = 5  # ticks from solve to solve
WAY = 10  # ticks of the reference machine from a solve until the spool moves: one until a command appears
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
NX, NU = len(prediction.STATES), len(prediction.INPUTS)
STATES = (
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
)


def state(x: Namespace, u: Namespace, slew: Any, speed: Any) -> Any:
    """Estimated state [13], with the slew angle as it is to be counted."""
    roll, pitch = u.imu_tool_roll - x.roll_zero, u.imu_tool_pitch - x.pitch_zero
    c, s = ca.cos(roll), ca.sin(roll)
    p_a, p_b = (ca.fmax(pressure / prediction.PRESSURE, 0.0) for pressure in (u.p_slew_a, u.p_slew_b))
    values = {
        "slew": slew,
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


def load(x: Namespace, u: Namespace, p: Namespace) -> Any:
    """Load (kg) at the arm tip that makes the inertia what it was found to be."""
    radius, _ = kinematics.arm_tip(u.q_boom, u.q_stick, p)
    told = control.inertia(x, u, p) / x.ratio
    return control.clip(u.load_told + (x.ratio - 1.0) * told / radius**2, *LOADS)


def estimated(x: Namespace, u: Namespace, now: Any, speed: Any, acting: Any, p: Namespace) -> dict[str, Any]:
    """Next `STATES` at the estimated state `now`; `acting` [3]: the commands that are at valve and arm.

    Dead band and zeros of the tool's IMU differ from machine to machine and stay.  While the opening's
    sign changes, the spool crosses the dead band and tells nothing of it.
    """
    climbs = [FILTER * (u.p_slew_a - x.slow_p_a), FILTER * (u.p_slew_b - x.slow_p_b)]
    sizes = (u.p_slew_a, u.p_slew_b, *climbs)
    miss = _miss()(x.opening, *(v / prediction.PRESSURE for v in sizes), speed)
    same = ca.if_else(acting[0] * x.opening > 0, ca.fmin(x.same + STEP, SETTLED_S), 0.0)
    miss = miss * (same > SETTLED_S - STEP / 2)
    standing = ca.fabs(speed) < prediction.STILL
    share = STEP * p.nmpc_zero_rate
    own = step(STEP)(now, acting, load(x, u, p))
    return {
        **control.weighed(x, u, speed, p),
        "band": control.clip(x.band - STEP * p.nmpc_band_rate * miss, -0.08, 0.12),
        "same": same,
        "slow_p_a": x.slow_p_a + STEP * climbs[0],
        "slow_p_b": x.slow_p_b + STEP * climbs[1],
        "roll_zero": x.roll_zero + share * standing * (u.imu_tool_roll - x.roll_zero),
        "pitch_zero": x.pitch_zero + share * standing * (u.imu_tool_pitch - x.pitch_zero),
        **{name: own[prediction.STATES.index(name)] for name in ("opening", "boom_rate", "stick_rate")},
    }


def _miss() -> ca.Function:
    """`prediction.opening_miss` as a function."""
    symbols = [ca.SX.sym(n) for n in ("opening", "p_a", "p_b", "climb_a", "climb_b", "speed")]  # type: ignore[call-arg]
    return ca.Function("nmpc_miss", symbols, [prediction.opening_miss(*symbols)])


def step(h: float) -> ca.Function:
    """(x, u, load) -> x after `h` s."""
    x, u, load = ca.SX.sym("x", NX), ca.SX.sym("u", NU), ca.SX.sym("load")  # type: ignore[call-arg]
    return ca.Function("nmpc_ahead", [x, u, load], [ca.cse(prediction.step(x, u, load, h))])


def ahead(now: Any, sent: Any, load: Any, ticks: Any = None) -> Any:
    """The state as many ticks later as there are commands on their way, the oldest of each channel first.

    With `ticks` only that many of the last ones are counted on.
    """
    moved, way = step(PAIR * STEP), sent.numel() // len(CHANNELS)
    for tick in range(0, way, PAIR):
        means = [(sent[c * way + tick] + sent[c * way + tick + 1]) / 2 for c in range(len(CHANNELS))]
        later = moved(now, ca.vertcat(*means), load)
        now = later if ticks is None else ca.if_else(ticks > way - tick - 0.5, later, now)
    return now


def joystick(opening: Any, band: Any, p: Namespace) -> Any:
    """Joystick for a commanded `opening`, with the learnt part of the dead band."""
    return prediction.joystick(opening, prediction.figures().slew_dead_band + band, p.nmpc_ramp)
