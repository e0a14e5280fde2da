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

All of it can be differentiated.  The equations, and what of them is not in the FMUs: period.py.
"""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import torch
from torch import Tensor

from fmus.models.slew_nn.network import HISTORY
from learning.policy.simulation.drive import Drive
from learning.policy.simulation.period import (
    ARM,
    ARM_OWN,
    KEPT,
    OWN,
    OWN_DEAD_BAND,
    TICKS,
    TOOL,
    VARIED,
    equations,
)
from specs import parameters
from specs.policy import TICK_S


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
    slew_delay: Tensor  # ticks (float), of the slew drive alone
    edge: Tensor  # share of the joystick's change in a period that the drive sees beside it
    rate_filter: Tensor  # share of the last value in what gyro and tool IMU show of a rate
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

    def __init__(self, drive: Drive, still: bool = False, spatial: bool = False) -> None:
        self.drive = drive
        self.still = still  # the arm stays where it is: slew-only, and cheaper
        made = equations(spatial)
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
        u, p_l, p_r, omega = self.drive.onward(past, joystick.view(n), inertia.view(n))
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
    return equations()["warp"](u, band, torch.as_tensor(gain).expand_as(u))[0][0]


def nominal(n: int, device: str = "cpu", dtype: Any = torch.float32, **changed: Any) -> Machine:
    """n machines as the parameter files describe them, with parameters changed by name."""
    known = parameters.load("arm", "tool")
    full = lambda value: torch.as_tensor(value, device=device, dtype=dtype).expand(n).clone()  # noqa: E731
    ticks = lambda s: torch.full((n,), int(s / TICK_S + 0.5), device=device)  # noqa: E731
    added = [full(changed.get(name, 0.0)) for name in ("slew_delay", "edge", "rate_filter")]
    varied = torch.stack([full(changed.get(name, known[name].value)) for name in VARIED])
    boom, stick = (known[f"{j}_delay"].value for j in ("boom", "stick"))
    return Machine(
        varied, full(changed.get("load", 0.0)),
        ticks(changed.get("boom_delay", boom)), ticks(changed.get("stick_delay", stick)),
        full(changed.get("latency", 0.0)), full(changed.get("dead_band", OWN_DEAD_BAND)),
        full(changed.get("inertia_scale", 1.0)), full(changed.get("gain", 1.0)),
        added[0], added[1], added[2],
        torch.stack([full(changed.get(name, value)) for name, value in ARM_OWN.items()]),
    )  # fmt: skip
