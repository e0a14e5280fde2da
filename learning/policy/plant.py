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
networks (`Variation`): one set of networks then stands for machines with other dead bands and delays.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import torch
from torch import Tensor

from fmus.equations import kinematics
from fmus.loader import load_model
from fmus.slew_nn.network import CELL_AXES, HISTORY, PERIOD_S, TOLERANCE, Mlp, SlewNetwork
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


class Drive:
    """Slew networks on [41, n]: machines are shared out among them in equal, contiguous groups."""

    def __init__(self, networks: Sequence[SlewNetwork], device: str = "cpu", dtype: Any = torch.float32):
        for network in networks:
            network.check_whole()
        self.networks = tuple(networks)
        self.symmetric = networks[0].symmetric
        kind = {"device": device, "dtype": dtype}
        self.parts = {
            name: [_stack(nets, kind) for nets in zip(*(getattr(n, name) for n in networks), strict=True)]
            for name in ("pressure", "velocity")
        }
        self.maps = [_visited(n, device) for n in networks]

    def __call__(
        self, u: Tensor, p_l: Tensor, p_r: Tensor, omega: Tensor, inertia: Tensor
    ) -> tuple[Tensor, ...]:
        """Next p_l, p_r, omega [n]; u [10, n] up to now, the others [10, n] up to the last instant."""
        found = self._one_way(u, p_l, p_r, omega, inertia)
        if not self.symmetric:
            return found
        left, right, speed = self._one_way(-u, p_r, p_l, -omega, inertia)
        return (found[0] + right) / 2, (found[1] + left) / 2, (found[2] - speed) / 2

    def _one_way(
        self, u: Tensor, p_l: Tensor, p_r: Tensor, omega: Tensor, inertia: Tensor
    ) -> tuple[Tensor, ...]:
        seen = inertia[None]
        p = self._mean("pressure", torch.cat([u, p_l, p_r, omega, seen]), torch.stack([p_l[-1], p_r[-1]]))
        newer = [p_l[1:], p[:1], p_r[1:], p[1:]]
        w = self._mean("velocity", torch.cat([u, *newer, omega, seen]), omega[-1:])
        return p[0], p[1], w[0]

    def _mean(self, part: str, x: Tensor, last: Tensor) -> Tensor:
        """Mean over the members [outputs, n] for raw inputs x [41, n]."""
        groups = len(self.networks)
        y = x.view(len(x), groups, -1).transpose(0, 1)  # [groups, 41, n / groups]
        total = sum(_forward(member, y) for member in self.parts[part]) / len(self.parts[part])
        found = total.transpose(0, 1).reshape(last.shape)  # type: ignore[union-attr]
        residual = getattr(self.networks[0], part)[0].residual
        return found + last if residual else found

    def outside(self, inertia: Tensor, u: Tensor, omega: Tensor) -> Tensor:
        """Which of n states lie where the networks saw no data, bool [n] (SlewNetwork.outside)."""
        groups = [v.view(len(self.maps), -1) for v in (inertia, u, omega)]
        return torch.cat([_outside(m, *(g[i] for g in groups)) for i, m in enumerate(self.maps)])


def _stack(nets: Sequence[Mlp], kind: Mapping[str, Any]) -> list[tuple[Tensor, Tensor]]:
    """Layers of one member of each network, stacked, with scaling folded into the first and the last."""
    layers: list[list[tuple[np.ndarray, np.ndarray]]] = []
    for net in nets:
        w = [np.asarray(a, np.float64) for a in net.weights]
        b = [np.asarray(a, np.float64) for a in net.biases]
        b[0] = b[0] - w[0] @ (net.mean_in / net.std_in)
        w[0] = w[0] / net.std_in
        w[-1], b[-1] = net.std_out[:, None] * w[-1], net.std_out * b[-1] + net.mean_out
        layers.append(list(zip(w, b, strict=True)))
    rows = [[np.stack(values) for values in zip(*row, strict=True)] for row in zip(*layers, strict=True)]
    return [(torch.tensor(w, **kind), torch.tensor(b[..., None], **kind)) for w, b in rows]


def _forward(layers: Sequence[tuple[Tensor, Tensor]], x: Tensor) -> Tensor:
    for number, (w, b) in enumerate(layers):
        x = torch.baddbmm(b, w, x)
        if number + 1 < len(layers):
            x = torch.relu(x)
    return x


def _visited(network: SlewNetwork, device: str) -> dict[str, Any]:
    if network.visited is None:
        return {}
    return {"cells": torch.tensor(network.visited, device=device), "region": network.region}


def _outside(known: Mapping[str, Any], inertia: Tensor, u: Tensor, omega: Tensor) -> Tensor:
    if not known:
        return torch.zeros_like(u, dtype=torch.bool)
    index, beyond = [], torch.zeros_like(u, dtype=torch.bool)
    for (name, count), value in zip(CELL_AXES.items(), (inertia, u, omega), strict=True):
        low, high = known["region"][name]
        share = (value - low) / (high - low)
        beyond |= (share < -TOLERANCE) | (share > 1 + TOLERANCE)
        index.append((share * count).long().clamp(0, count - 1))
    return beyond | ~known["cells"][tuple(index)]


@cache
def _equations() -> dict[str, Kernel]:
    """What is carried over to torch: a period of five ticks, and what follows from the arm's pose.

    period: (arm, tool, references of each tick, slew rate before and after, VARIED) -> (arm, tool);
    swing: (arm, tool, slew rate before and after, VARIED) -> tool, with the arm at rest;
    tip: arm -> radius, height; moment: (arm, load) -> slew inertia.
    """
    arm, tool = load_model("arm"), load_model("tool")
    x, t, r, w, v = (ca.SX.sym(n, k) for n, k in zip("xtrwv", (4, 6, 2 * TICKS, 2, len(VARIED)), strict=True))
    load = ca.SX.sym("load")
    poses, swings, still = [x], [t], t
    for i in range(TICKS):
        rate = w[0] + (i / TICKS) * (w[1] - w[0])
        references = ca.vertcat(r[i], r[TICKS + i])
        after = _tick(arm, tool, poses[-1], swings[-1], references, rate, v)
        still = _tick(arm, tool, ca.vertcat(x[:2], 0, 0), still, references, rate, v)[1]
        poses.append(after[0])
        swings.append(after[1])
    at = arm.h(x, ca.SX.zeros(4), [], _parameters(arm, v, 0.0))
    out = {name.name: at[i] for i, name in enumerate(arm.outputs)}
    made = (
        ca.Function("period", [x, t, r, w, v], ca.cse([poses[-1], swings[-1]])),
        ca.Function("swing", [x, t, w, v], [ca.cse(still)]),
        ca.Function("tip", [x], [ca.cse(ca.vertcat(out["radius"], out["height"]))]),
        ca.Function(
            "moment", [x, load], [ca.cse(kinematics.inertia_z(x[0], x[1], load, kinematics.geometry()))]
        ),
    )
    return {f.name(): Kernel(f) for f in made}


def _tick(
    arm: Any, tool: Any, x: ca.SX, t: ca.SX, references: ca.SX, rate: ca.SX, v: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Arm and tool a tick later: both on what the others are now."""
    p_arm, p_tool = _parameters(arm, v, 0.0), _parameters(tool, v, 0.0)
    u_arm = ca.vertcat(references, ca.SX(2, 1))
    at = arm.h(x, u_arm, [], p_arm)
    out = {name.name: at[i] for i, name in enumerate(arm.outputs)}
    u_tool = ca.vertcat(0, rate, out["radius"], out["radius_rate"], out["height"], ca.SX(8, 1))
    names = [s.name for s in tool.states]
    whole = ca.vertcat(*(t[TOOL.index(n)] if n in TOOL else ca.SX(0) for n in names))
    after = tool.f(whole, u_tool, [], p_tool)
    return arm.f(x, u_arm, [], p_arm), ca.vertcat(*(after[names.index(n)] for n in TOOL))


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

    def take(self, other: "Machine", where: Tensor) -> "Machine":
        """This machine, but `other`'s parameters where the mask [n] says so."""
        pairs = {name: (value, getattr(other, name)) for name, value in self.__dict__.items()}
        return Machine(**{name: torch.where(where, b, a) for name, (a, b) in pairs.items()})

    def named(self, name: str) -> Tensor:
        """One of VARIED [n]."""
        return self.varied[VARIED.index(name)]


OWN_DEAD_BAND = parameters.load("control")["control_dead_band"].value  # of the machine of the recordings


class Plant:
    """The simulation; holds no state of its own but the equations."""

    def __init__(self, drive: Drive, ahead: int = 0, still: bool = False) -> None:
        self.drive, self.ahead = drive, ahead
        self.still = still  # the arm stays where it is: slew-only, and cheaper
        made = _equations()
        self.period, self.swing, self.tip = made["period"], made["swing"], made["tip"]
        self.moment = made["moment"]

    def start(self, q: Tensor, boom: Tensor, stick: Tensor, pressure: float = 0.0) -> State:
        """At rest at these angles [n], the tool hanging, histories as the slew model's FMU starts them."""
        zero = torch.zeros_like(q)
        rows = zero.expand(HISTORY, -1)
        p = rows + pressure
        return State(
            rows[1:].clone(), p.clone(), p.clone(), rows.clone(), q.clone(),
            torch.stack([boom, stick, zero, zero]), torch.stack([zero] * len(TOOL)),
            torch.zeros(KEPT, 3, len(q), device=q.device, dtype=q.dtype),
        )  # fmt: skip

    def inertia(self, state: State, machine: Machine) -> Tensor:
        """True slew inertia [n], kg m2."""
        return self.moment(state.arm, machine.load[None])[0][0] * machine.inertia_scale

    def advance(self, state: State, action: Tensor, machine: Machine) -> State:
        """0.1 s on with the commands `action` [3, n] (u_slew, qd_boom_ref, qd_stick_ref), already limited."""
        sent = torch.cat([state.sent[1:], action[None]])
        share = machine.latency / TICKS
        joystick = (1.0 - share) * sent[-1, 0] + share * sent[-2, 0]
        joystick = warped(joystick, machine.dead_band, machine.gain)
        now = joystick.expand(self.ahead + 1, -1)
        inertia = self.inertia(state, machine)
        known = torch.cat([state.u[self.ahead :], now])
        left, right, speed = self.drive(known, state.p_l, state.p_r, state.omega, inertia)
        before = state.omega[-1]
        rates, varied = torch.stack([before, speed]), machine.varied
        if self.still:
            arm, (tool,) = state.arm, self.swing(state.arm, state.tool, rates, varied)
        else:
            arm, tool = self.period(state.arm, state.tool, self._references(sent, machine), rates, varied)
        return State(
            torch.cat([state.u[1:], now[:1]]), torch.cat([state.p_l[1:], left[None]]),
            torch.cat([state.p_r[1:], right[None]]), torch.cat([state.omega[1:], speed[None]]),
            state.q + PERIOD_S * (before + speed) / 2, arm, tool, sent,
        )  # fmt: skip

    def _references(self, sent: Tensor, machine: Machine) -> Tensor:
        """What boom and stick are told at each tick of a period [2 TICKS, n]: late by delay and latency."""
        ticks = torch.arange(TICKS, device=sent.device)[:, None]
        found = []
        for which, delay in ((1, machine.boom_delay), (2, machine.stick_delay)):
            back = torch.div(ticks - (delay + machine.latency), TICKS, rounding_mode="floor").long()
            found.append(sent[:, which].gather(0, (len(sent) - 1 + back).clamp(min=0)))
        return torch.cat(found)


def warped(u: Tensor, band: Tensor, gain: Tensor | float = 1.0) -> Tensor:
    """The joystick for the drive's own dead band that does what `u` does with `band`: two straight lines."""
    size = u.abs()
    inner = size * (OWN_DEAD_BAND / band)
    outer = OWN_DEAD_BAND + gain * (size - band) * ((1.0 - OWN_DEAD_BAND) / (1.0 - band))
    outer = outer.clamp(max=1.0)
    return torch.copysign(torch.where(size < band, inner, outer), u)


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
    )  # fmt: skip
