"""The paper's mixed simulation, batched in torch: slew networks, arm, tool; an `advance` is 0.1 s.

State and parameters are tensors [rows, n] or [n], so that each quantity lies together in memory.  The
equations of arm and tool are those of their FMUs, carried over by `graph.to_torch`; the couplings are those
of the nominal system, where all components step on the values of the last tick:

    tick t -> t+1   arm:   references of t - delay                 tool: arm and slew as they are at t
    every 5 ticks   slew:  networks, with the slew inertia of t and the joystick that is held from t on

The networks' speed is the encoder's, about 0.2 s late, and so would be the tool that swings with it, while
angle, gyro and IMU of the machine are not late.  `ahead` periods take this off again: the networks are run
that far ahead of the clock, on the present command for what is still to come (the drive's own delay is
nearly as long, so that it hardly matters); their speed is then the gyro's.  With 0 everything is as in the
FMUs.

All of it can be differentiated.  Beside what the FMUs have, the joystick can be changed on its way to the
networks (`warped`): one set of networks then stands for machines with other dead bands and delays.  Boom and
stick can rest on the oil of their cylinders as on springs (`_ringing`) and lose small references in their
valves' overlap, which the arm's FMU leaves out; and the tool can be the reference machine's spatial pendulum
(`_spatial`), with the couplings that the paper's two plane ones leave out and `slewright reconcile` names
(docs/showcases/tool.md).
"""

from dataclasses import dataclass, fields
from functools import cache, cached_property
from types import SimpleNamespace
from typing import Any

import casadi as ca
import torch
from torch import Tensor

from fmus.equations import kinematics, multibody
from fmus.loader import load_model
from fmus.slew_nn.network import HISTORY, PERIOD_S
from learning.policy.drive import Drive
from learning.policy.kernel import Kernel
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
OWN = ("latency", "dead_band", "gain", "load", "inertia_scale")  # of a machine, beside VARIED
ARM_OWN = {  # what the arm's FMU leaves out, and the value that leaves it out here, too
    "boom_oil": 0.0, "stick_oil": 0.0,  # rad/s, of boom and stick on the oil of their cylinders
    "oil_damping": 0.0,
    "dead_rate": 0.0,  # rad/s: of references below it little arrives
    "arm_gain": 1.0,  # of the references
}  # fmt: skip


@cache
def _equations(spatial: bool = False) -> dict[str, Kernel]:
    """What is carried over to torch: a period of five ticks, and what follows from the arm's pose.

    command: (sent, action, arm, OWN) -> sent, the joystick that the networks see, slew inertia;
    period: (arm, tool, references of each tick, speeds before, after, VARIED, angle, ringing, ARM_OWN)
        -> (arm, tool, angle, ringing);
    swing: the same without references and with the arm at rest -> (tool, angle);
    tip: arm -> radius, height; moment: (arm, load) -> slew inertia of the pose.
    """
    arm = load_model("arm")
    x, t, r, v, q = (ca.SX.sym(n, k) for n, k in zip("xtrvq", (4, 6, 2 * TICKS, len(VARIED), 1), strict=True))
    before, after = ca.SX.sym("before", HISTORY), ca.SX.sym("after", HISTORY)
    w = (before[HISTORY - 1], after[HISTORY - 1])
    load, e, own = ca.SX.sym("load"), ca.SX.sym("e", len(ARM)), ca.SX.sym("own", len(ARM_OWN))
    poses, swings, still, rings = [x], [t], t, [e]
    turn = (w[1] - w[0]) / PERIOD_S
    tick = _spatial if spatial else _plane
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
    arm, x, v = load_model("arm"), ca.SX.sym("x", len(ARM)), ca.SX.zeros(len(VARIED))
    at = arm.h(x, ca.SX.zeros(4), [], _parameters(arm, v, 0.0))
    out = {name.name: at[i] for i, name in enumerate(arm.outputs)}
    found: Any = ca.cse(ca.vertcat(out["radius"], out["height"]))
    return ca.Function("tip", [x], [found])


def _command(arm: ca.SX) -> ca.Function:
    """The commands that are under way, what of them the networks see, and the slew inertia."""
    sent, action, own = ca.SX.sym("sent", 3 * KEPT), ca.SX.sym("action", 3), ca.SX.sym("own", len(OWN))
    latency, band, gain, load, scale = (own[i] for i in range(len(OWN)))
    share = latency / TICKS
    joystick = (1.0 - share) * action[0] + share * sent[3 * (KEPT - 1)]
    inertia = scale * kinematics.inertia_z(arm[0], arm[1], load, kinematics.geometry())
    found: list[Any] = [ca.vertcat(sent[3:], action), _warped(joystick, band, gain), inertia]
    made: Any = ca.cse(found)
    return ca.Function("command", [sent, action, arm, own], made)


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


def _plane(t: ca.SX, pose: ca.SX, after: ca.SX, rate: ca.SX, turn: ca.SX, v: ca.SX) -> ca.SX:
    """The tool of the FMU a tick later, on what the others are now."""
    arm, tool = load_model("arm"), load_model("tool")
    at = arm.h(pose, ca.SX(4, 1), [], _parameters(arm, v, 0.0))
    out = {name.name: at[i] for i, name in enumerate(arm.outputs)}
    u_tool = ca.vertcat(0, rate, out["radius"], out["radius_rate"], out["height"], ca.SX(8, 1))
    names = [s.name for s in tool.states]
    whole = ca.vertcat(*(t[TOOL.index(n)] if n in TOOL else ca.SX(0) for n in names))
    found = tool.f(whole, u_tool, [], _parameters(tool, v, 0.0))
    return ca.vertcat(*(found[names.index(n)] for n in TOOL))


def _spatial(t: ca.SX, pose: ca.SX, after: ca.SX, rate: ca.SX, turn: ca.SX, v: ca.SX) -> ca.SX:
    """A point mass on the machine's universal joint a tick later, semi-implicit; v_x and v_y unused.

    At its stops it rests, as the arm's FMU does at the arm's: a shock there would be no more but large.
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


def _parameters(model: Any, varied: ca.SX, load: float) -> ca.SX:
    """The model's parameters: VARIED as symbols, the rest as numbers."""
    values = [
        varied[VARIED.index(v.name)] if v.name in VARIED else load if v.name == "load_mass" else v.start
        for v in model.parameters
    ]
    return ca.vertcat(*(ca.SX(value) for value in values))


@dataclass
class State:
    """Where n machines are; tensors [rows, n] or [n]."""

    u: Tensor  # [9, n] joystick as the networks see it
    p_l: Tensor  # [10, n]
    p_r: Tensor
    omega: Tensor  # [10, n]
    q: Tensor  # [n] slew angle
    arm: Tensor  # [4, n]
    tool: Tensor  # [6, n]
    ring: Tensor  # [4, n] of `arm`: what of it is ringing on the oil
    sent: Tensor  # [KEPT, 3, n] commands, the newest last

    def copy(self) -> "State":
        """Another one with the same numbers, cut off from what they were computed from."""
        return State(**{name: value.detach().clone() for name, value in self.__dict__.items()})

    def take(self, other: "State", where: Tensor) -> "State":
        """This state, but `other`'s where the mask [n] says so."""
        pairs = {name: (getattr(other, name), value) for name, value in self.__dict__.items()}
        return State(**{name: torch.where(where, new, old) for name, (new, old) in pairs.items()})


@dataclass
class Machine:
    """Parameters of n machines, tensors [n]; delays and latency in ticks."""

    varied: Tensor  # [6, n] VARIED
    load: Tensor  # kg
    boom_delay: Tensor  # ticks (int64)
    stick_delay: Tensor
    latency: Tensor  # ticks (float) from the network's answer to the command, 0..5
    dead_band: Tensor  # of the joystick: the drive's own is moved to this
    inertia_scale: Tensor  # slew inertia of the machine over that of its pose
    gain: Tensor  # of the joystick beyond the dead band: more or less flow than the networks' machine
    of_arm: Tensor  # [5, n] ARM_OWN

    def take(self, other: "Machine", where: Tensor) -> "Machine":
        """This machine, but `other`'s parameters where the mask [n] says so."""
        pairs = {f.name: (getattr(self, f.name), getattr(other, f.name)) for f in fields(self)}
        return Machine(**{name: torch.where(where, b, a) for name, (a, b) in pairs.items()})

    @cached_property
    def own(self) -> Tensor:
        """What the machine makes of a command [OWN, n]."""
        return torch.stack([getattr(self, name).to(self.load.dtype) for name in OWN])

    @cached_property
    def places(self) -> Tensor:
        """Row of the commands under way [3 KEPT, n] at each tick of a period [2 TICKS, n]: boom, stick."""
        ticks = torch.arange(TICKS, device=self.load.device)[:, None]
        found = []
        for which, delay in ((1, self.boom_delay), (2, self.stick_delay)):
            back = torch.div(ticks - (delay + self.latency), TICKS, rounding_mode="floor").long()
            found.append(3 * (KEPT - 1 + back).clamp(min=0) + which)
        return torch.cat(found)

    def named(self, name: str) -> Tensor:
        """One of VARIED [n]."""
        return self.varied[VARIED.index(name)]


class Plant:
    """The simulation; holds no state of its own but the equations."""

    def __init__(self, drive: Drive, ahead: int = 0, still: bool = False, spatial: bool = False) -> None:
        self.drive, self.ahead = drive, ahead
        self.still = still  # the arm stays where it is: slew-only, and cheaper
        made = _equations(spatial)
        self.command, self.period, self.swing = made["command"], made["period"], made["swing"]
        self.tip, self.moment = made["tip"], made["moment"]

    def start(self, q: Tensor, boom: Tensor, stick: Tensor, pressure: float = 0.0) -> State:
        """At rest at these angles [n], the tool hanging, histories as the slew model's FMU starts them."""
        zero = torch.zeros_like(q)
        rows = zero.expand(HISTORY, -1)
        p = rows + pressure
        return State(
            rows[1:].clone(), p.clone(), p.clone(), rows.clone(), q.clone(),
            torch.stack([boom, stick, zero, zero]), torch.stack([zero] * len(TOOL)),
            torch.stack([zero] * len(ARM)),
            torch.zeros(KEPT, 3, len(q), device=q.device, dtype=q.dtype),
        )  # fmt: skip

    def inertia(self, state: State, machine: Machine) -> Tensor:
        """True slew inertia [n], kg m2."""
        return self.moment(state.arm, machine.load[None])[0][0] * machine.inertia_scale

    def advance(self, state: State, action: Tensor, machine: Machine) -> State:
        """0.1 s on with the commands `action` [3, n] (u_slew, qd_boom_ref, qd_stick_ref), already limited."""
        n = action.shape[1]
        sent, joystick, inertia = self.command(
            state.sent.reshape(3 * KEPT, n), action, state.arm, machine.own
        )
        past = (state.u, state.p_l, state.p_r, state.omega)
        u, p_l, p_r, omega = self.drive.onward(past, joystick.view(n), inertia.view(n), self.ahead)
        if self.still:
            arm, ring = state.arm, state.ring
            tool, q = self.swing(arm, state.tool, state.omega, omega, machine.varied, state.q)
        else:
            told = sent.gather(0, machine.places)
            now = (state.arm, state.tool, told, state.omega, omega, machine.varied, state.q)
            arm, tool, q, ring = self.period(*now, state.ring, machine.of_arm)
        return State(u, p_l, p_r, omega, q.view(n), arm, tool, ring, sent.view(KEPT, 3, n))


def warped(u: Tensor, band: Tensor, gain: Tensor | float = 1.0) -> Tensor:
    """The joystick for the drive's own dead band that does what `u` does with `band`: two straight lines."""
    return _equations()["warp"](u, band, torch.as_tensor(gain).expand_as(u))[0][0]


def nominal(n: int, device: str = "cpu", dtype: Any = torch.float32, **changed: Any) -> Machine:
    """n machines as the parameter files describe them, with parameters changed by name."""
    known = parameters.load("arm", "tool")
    full = lambda value: torch.as_tensor(value, device=device, dtype=dtype).expand(n).clone()  # noqa: E731
    ticks = lambda s: torch.full((n,), int(s / TICK_S + 0.5), device=device)  # noqa: E731
    varied = torch.stack([full(changed.get(name, known[name].value)) for name in VARIED])
    boom, stick = (known[f"{j}_delay"].value for j in ("boom", "stick"))
    return Machine(
        varied, full(changed.get("load", 0.0)),
        ticks(changed.get("boom_delay", boom)), ticks(changed.get("stick_delay", stick)),
        full(changed.get("latency", 0.0)), full(changed.get("dead_band", OWN_DEAD_BAND)),
        full(changed.get("inertia_scale", 1.0)), full(changed.get("gain", 1.0)),
        torch.stack([full(changed.get(name, value)) for name, value in ARM_OWN.items()]),
    )  # fmt: skip
