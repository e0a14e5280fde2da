"""The equations of a period of 0.1 s as CasADi functions: those of the FMUs, and what they lack.

Arm and tool are those of their FMUs, five ticks of the nominal system's couplings (plant.py).  Beside what
the FMUs have, the joystick can be changed on its way to the networks (`warp`): one set of networks then
stands for machines with other dead bands and delays.  Boom and stick can rest on the oil of their cylinders
as on springs (`_ringing`) and lose small references in their valves' overlap, which the arm's FMU leaves out;
and the tool can be the reference machine's spatial pendulum (`spatial_tool`), with the couplings that the
paper's two plane ones leave out and `slewright reconcile` names (docs/results/showcases/tool.md).
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import casadi as ca

from fmus.equations import kinematics, multibody
from fmus.models.slew_nn.network import HISTORY, PERIOD_S
from fmus.toolchain.loader import load_model
from learning.policy.simulation.kernel import Kernel
from specs import parameters
from specs.policy import TICK_S

TICKS = round(PERIOD_S / TICK_S)
KEPT = 8  # commands kept for the arm's delays: (KEPT - 1) periods at most
ARM = ("boom", "stick", "boom_rate", "stick_rate")
TOOL = ("theta_x", "theta_y", "omega_x", "omega_y", "v_x", "v_y")
VARIED = (  # parameters of each simulated machine, by the FMUs' names
    "boom_response", "stick_response", "tool_length_x", "tool_length_y", "tool_damping_x", "tool_damping_y",
)  # fmt: skip

OWN_DEAD_BAND = parameters.load("control")["control_dead_band"].value  # of the machine of the recordings
STOP = parameters.load("machine")["grab_swing_limit"].value  # rad, of the tool's joint
OWN = (
    "latency",
    "dead_band",
    "gain",
    "load",
    "inertia_scale",
    "slew_delay",
    "edge",
)  # of a machine, beside VARIED
ARM_OWN = {  # what the arm's FMU leaves out, and the value that leaves it out here, too
    "boom_oil": 0.0, "stick_oil": 0.0,  # rad/s, of boom and stick on the oil of their cylinders
    "oil_damping": 0.0,
    "dead_rate": 0.0,  # rad/s: of references below it little arrives
    "arm_gain": 1.0,  # of the references
}  # fmt: skip


@cache
def equations(spatial: bool = False) -> dict[str, Kernel]:
    """What is carried over to torch: a period of five ticks, and what follows from the arm's pose.

    command: (sent, action, arm, OWN) -> sent, the joystick that the networks see, slew inertia;
    period: (arm, tool, references of each tick, speeds before, after, VARIED, angle, ringing, ARM_OWN)
        -> (arm, tool, angle, ringing);
    swing: the same without references and with the arm at rest -> (tool, angle);
    tip: arm -> radius, height; moment: (arm, load) -> slew inertia of the pose.
    """
    arm = _model("arm")
    x, t, r, v, q = (ca.SX.sym(n, k) for n, k in zip("xtrvq", (4, 6, 2 * TICKS, len(VARIED), 1), strict=True))
    before, after = ca.SX.sym("before", HISTORY), ca.SX.sym("after", HISTORY)
    w = (before[HISTORY - 1], after[HISTORY - 1])
    load, e, own = ca.SX.sym("load"), ca.SX.sym("e", len(ARM)), ca.SX.sym("own", len(ARM_OWN))
    poses, swings, still, rings = [x], [t], t, [e]
    turn = (w[1] - w[0]) / PERIOD_S
    tick = spatial_tool if spatial else plane_tool
    for i in range(TICKS):
        rate = w[0] + (i / TICKS) * (w[1] - w[0])
        pose, ring = _arm_tick(arm, poses[-1], rings[-1], own, ca.vertcat(r[i], r[TICKS + i]), v)
        swings.append(tick(swings[-1], poses[-1], pose, rate, turn, v))
        rest = ca.vertcat(x[:2], 0, 0)
        still = tick(still, rest, rest, rate, turn, v)
        poses, rings = [*poses, pose], [*rings, ring]
    angle = q + PERIOD_S * (w[0] + w[1]) / 2
    moment = kinematics.inertia_z(x[0], x[1], load, kinematics.geometry())
    inputs = [x, t, r, before, after, v, q, e, own]
    made = (
        _command(x),
        ca.Function("period", inputs, ca.cse([poses[-1], swings[-1], angle, rings[-1]])),
        ca.Function("swing", [x, t, before, after, v, q], ca.cse([still, angle])),
        tip_of(),
        ca.Function("moment", [x, load], [ca.cse(moment)]),
        _warp(),
    )
    return {f.name(): Kernel(f) for f in made}


@cache
def tip_of() -> ca.Function:
    """arm -> radius and height of its tip, as the arm's FMU says."""
    arm, x, v = _model("arm"), ca.SX.sym("x", len(ARM)), ca.SX.zeros(len(VARIED))
    at = arm.h(x, ca.SX.zeros(4), [], _parameters(arm, v, 0.0))
    out = {name.name: at[i] for i, name in enumerate(arm.outputs)}
    found: Any = ca.cse(ca.vertcat(out["radius"], out["height"]))
    return ca.Function("tip", [x], [found])


def _command(arm: ca.SX) -> ca.Function:
    """The commands that are under way, what of them the networks see, and the slew inertia."""
    sent, action, own = ca.SX.sym("sent", 3 * KEPT), ca.SX.sym("action", 3), ca.SX.sym("own", len(OWN))
    latency, band, gain, load, scale, delay, edge = (own[i] for i in range(len(OWN)))
    levers = [action[0], *(sent[3 * (KEPT - 1 - k)] for k in range(KEPT))]  # the newest first
    back = (latency + delay) / TICKS
    now, before = (_between(levers, back + periods) for periods in (0, 1))
    joystick = now + edge * (now - before)
    inertia = scale * kinematics.inertia_z(arm[0], arm[1], load, kinematics.geometry())
    found: list[Any] = [ca.vertcat(sent[3:], action), _warped(joystick, band, gain), inertia]
    made: Any = ca.cse(found)
    return ca.Function("command", [sent, action, arm, own], made)


def _between(values: list[ca.SX], back: ca.SX) -> Any:
    """The value `back` places from the first, on straight lines between them."""
    return sum(ca.fmax(0.0, 1.0 - ca.fabs(back - k)) * value for k, value in enumerate(values))


def _warped(u: ca.SX, band: ca.SX, gain: ca.SX) -> ca.SX:
    size = ca.fabs(u)
    inner = size * (OWN_DEAD_BAND / band)
    outer = OWN_DEAD_BAND + gain * (size - band) * ((1.0 - OWN_DEAD_BAND) / (1.0 - band))
    return ca.sign(u) * ca.if_else(size < band, inner, ca.fmin(outer, 1.0))


def _warp() -> ca.Function:
    u, band, gain = (ca.SX.sym(n) for n in ("u", "band", "gain"))
    return ca.Function("warp", [u, band, gain], [_warped(u, band, gain)])


def _arm_tick(arm: Any, x: ca.SX, e: ca.SX, own: ca.SX, references: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The arm and what of it is ringing, a tick later; small references are lost in its valves' overlap."""
    dead, gain = own[3], own[4]
    arriving = gain * references**3 / (references**2 + dead**2 + 1e-12)
    rigid = arm.f(x - e, ca.vertcat(arriving, ca.SX(2, 1)), [], _parameters(arm, v, 0.0))
    ring = _ringing(e, rigid[2:] - (x - e)[2:], own)
    return rigid + ring, ring


def plane_tool(t: ca.SX, pose: ca.SX, after: ca.SX, rate: ca.SX, turn: ca.SX, v: ca.SX) -> ca.SX:
    """The tool of the FMU a tick later, on what the others are now."""
    arm, tool = _model("arm"), _model("tool")
    at = arm.h(pose, ca.SX(4, 1), [], _parameters(arm, v, 0.0))
    out = {name.name: at[i] for i, name in enumerate(arm.outputs)}
    u_tool = ca.vertcat(0, rate, out["radius"], out["radius_rate"], out["height"], ca.SX(8, 1))
    names = [s.name for s in tool.states]
    whole = ca.vertcat(*(t[TOOL.index(n)] if n in TOOL else ca.SX(0) for n in names))
    found = tool.f(whole, u_tool, [], _parameters(tool, v, 0.0))
    return ca.vertcat(*(found[names.index(n)] for n in TOOL))


def spatial_tool(t: ca.SX, pose: ca.SX, after: ca.SX, rate: ca.SX, turn: ca.SX, v: ca.SX) -> ca.SX:
    """A point mass on the machine's universal joint a tick later, semi-implicit; v_x and v_y unused.

    At its stops it rests, as the arm's FMU does at the arm's.
    """
    length, damping = v[VARIED.index("tool_length_x")], v[VARIED.index("tool_damping_x")]
    moved = ca.vertcat(turn, (after[2:] - pose[2:]) / TICK_S)
    pitch, roll = t[TOOL.index("omega_y")], t[TOOL.index("omega_x")]
    angles = ca.vertcat(0, pose[:2], t[TOOL.index("theta_y")], t[TOOL.index("theta_x")])
    swing: Any = _swing()(angles, ca.vertcat(rate, pose[2:], pitch, roll), moved, length)
    rates = ca.vertcat(roll, pitch) + TICK_S * (swing[::-1] - damping * ca.vertcat(roll, pitch))
    stopped = ca.fmin(ca.fmax(t[:2] + TICK_S * rates, -STOP), STOP)
    return ca.vertcat(stopped, (stopped - t[:2]) / TICK_S, ca.SX(2, 1))


@cache
def _swing() -> ca.Function:
    """(angles [5], rates [5], accelerations of slew, boom, stick, length) -> those of pitch and roll."""
    q, v, a, length = (ca.SX.sym(n, k) for n, k in zip("qval", (5, 5, 3, 1), strict=True))
    known = {name: p.value for name, p in parameters.load("geometry", "machine").items()}
    alone = {"tool_mass": 1.0, "load_mass": 0.0, "grab_com": length, "grab_gyration": 0.0}
    p = SimpleNamespace(**known | alone)
    motion = multibody.motion(ca.vertsplit(q), ca.vertsplit(v), p)
    found = multibody.tool_swing(motion, ca.vertcat(0, 0, -p.gravity), a)
    return ca.Function("swing", [q, v, a, length], [ca.cse(found)])


def _ringing(e: ca.SX, change: ca.SX, own: ca.SX) -> ca.SX:
    """Angles and rates of boom and stick beyond where their cylinders hold them, a tick later.

    e'' = -r' - 2 d w e' - w^2 e: a mass on the spring of its oil, whose foot has the rate r (`change`: of r
    in a tick).  Semi-implicit; w = 0 is an arm without oil, on which e stays 0.
    """
    w, d = own[:2], own[2]
    force = -ca.sign(w) * change - TICK_S * (2.0 * d * w * e[2:] + w * w * e[:2])
    rates = e[2:] + force
    return ca.vertcat(e[:2] + TICK_S * rates, rates)


_model = cache(load_model)  # a tick is written ten times


def _parameters(model: Any, varied: ca.SX, load: float) -> ca.SX:
    """The model's parameters: VARIED as symbols, the rest as numbers."""
    values = [
        varied[VARIED.index(v.name)] if v.name in VARIED else load if v.name == "load_mass" else v.start
        for v in model.parameters
    ]
    return ca.vertcat(*(ca.SX(value) for value in values))
