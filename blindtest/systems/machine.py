"""The whole nominal machine: slew drive, arm and tool, each step on the others' values of the last one.

The plain model is the system specs/systems/nominal.toml without its controller: recorded are the joystick of
the slew and the two velocity references.  What the arm does sets the inertia of the slew; both move the tool.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from blindtest.systems import arm, slew, tool
from blindtest.systems.arm import Arm
from blindtest.systems.slew import Slew
from blindtest.systems.system import Base, Drive, Signal, Trace, around
from blindtest.systems.tool import Tool
from specs import parameters
from specs.errors import RunError

FURTHEST = 3.2  # rad: no joint turns further
REMEMBERED = 12  # runs of the slew, the slowest part: a fit that changes only the tool needs no new one
G = {name: p.value for name, p in parameters.load("geometry").items()}


def reach(boom: np.ndarray, stick: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radius and height of the arm tip, m, from the joints' angles."""
    over = boom + stick
    radius = G["boom_foot_x"] + G["boom_length"] * np.cos(boom) + G["stick_length"] * np.cos(over)
    height = G["boom_foot_z"] + G["boom_length"] * np.sin(boom) + G["stick_length"] * np.sin(over)
    return radius, height


def turning_inertia(boom: np.ndarray, stick: np.ndarray) -> np.ndarray:
    """Inertia about the slew axis, kg m2: two boxes, two slender rods, the tool as a point."""
    out, further = G["boom_length"] * np.cos(boom), G["stick_length"] * np.cos(boom + stick)
    foot = G["boom_foot_x"]
    whole = 0.0
    for part, y in (("carriage", 0.0), ("cabin", G["cabin_y"])):
        square = (G[f"{part}_length"] ** 2 + G[f"{part}_width"] ** 2) / 12.0
        whole += G[f"{part}_mass"] * (square + G[f"{part}_x"] ** 2 + y**2)
    boom_at = foot + G["boom_com"] * out
    stick_at = foot + out + G["stick_com"] * further
    rods = G["boom_mass"] * (boom_at**2 + out**2 / 12) + G["stick_mass"] * (stick_at**2 + further**2 / 12)
    return whole + rods + (G["tool_mass"] + G["load_mass"]) * (foot + out + further) ** 2


def rates(boom: np.ndarray, stick: np.ndarray, boom_rate: np.ndarray, stick_rate: np.ndarray):
    """Rates of radius (m/s) and inertia (kg m2/s): chain rule, exact to rounding by complex steps."""
    small = 1e-20
    moved = (boom + 1j * small * boom_rate, stick + 1j * small * stick_rate)
    return np.imag(reach(*moved)[0]) / small, np.imag(turning_inertia(*moved)) / small


def _true(values: Mapping[str, float]) -> dict[str, float]:
    """The same machine with perfect sensors: what the next part of it feels."""
    sensing = ("misalignment", "bias_a", "bias_b")
    return {
        k: v for k, v in values.items() if not k.rsplit(".", 1)[-1].startswith("out_") and k not in sensing
    }


@dataclass
class Memory:
    """The last runs of the slew by what went into them."""

    runs: dict[bytes, np.ndarray] = field(default_factory=dict)

    def get(self, key: bytes, make) -> np.ndarray:
        """The outputs under a key, made when they are not there."""
        if key not in self.runs:
            while len(self.runs) >= REMEMBERED:
                self.runs.pop(next(iter(self.runs)))
            self.runs[key] = make()
        return self.runs[key]


@dataclass(frozen=True)
class Machine:
    """All three; a disturbance is a torque on the carriage.  start: boom and stick angle, roll, pitch."""

    arm: Arm
    slew: Slew
    tool: Tool
    name: str = "machine"
    model: str = "specs/systems/nominal.toml"
    starts: int = 4
    disturbances: int = 1
    memory: Memory = field(default_factory=Memory, compare=False)

    @property
    def base(self) -> tuple[Base, ...]:
        """Parameters of all three."""
        return (*self.slew.base, *self.arm.base, *self.tool.base)

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Joystick and velocity references."""
        return (self.slew.inputs[0], *self.arm.inputs)

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """What all three measure."""
        return (*self.slew.outputs, *self.arm.outputs, *self.tool.outputs)

    def simulate(
        self,
        values: Mapping[str, float],
        drive: Drive,
        start: np.ndarray,
        disturbance: np.ndarray | None = None,
        noise: np.ndarray | None = None,
    ) -> Trace:
        """Run it open loop: commands [n, 3], outputs [n, 12]."""
        perfect, u = _true(values), drive.commands
        arm_start = np.array([start[0], start[1], 0.0, 0.0])
        joints = self.arm.simulate(perfect, Drive(u[:, 1:]), arm_start).outputs
        if np.abs(joints[:, :2]).max() > FURTHEST:
            raise RunError("machine: a joint runs away")
        radius_rate, inertia_rate = rates(*joints.T)
        radius, height = reach(joints[:, 0], joints[:, 1])
        driven = Drive(np.column_stack([u[:, 0], turning_inertia(joints[:, 0], joints[:, 1]), inertia_rate]))
        turned = self._turned(perfect, driven, disturbance)
        moved = Drive(np.column_stack([turned[:, 0], turned[:, 1], radius, radius_rate, height]))
        swing = self.tool.simulate(values, moved, np.array([start[2], start[3], 0.0, 0.0])).outputs
        if len(perfect) < len(values):
            joints = self.arm.simulate(values, Drive(u[:, 1:]), arm_start).outputs
            turned = self._turned(values, driven, disturbance)
        whole = np.hstack([turned, joints, swing])
        return Trace(u, whole if noise is None else whole + noise)

    def _turned(
        self, values: Mapping[str, float], driven: Drive, disturbance: np.ndarray | None
    ) -> np.ndarray:
        own = {k: v for k, v in values.items() if "." not in k and not k.startswith("tool_")}
        numbers = np.array([*own.values(), *driven.commands.ravel()])
        key = repr(list(own)).encode() + numbers.tobytes()
        key += b"" if disturbance is None else disturbance.tobytes()
        return self.memory.get(key, lambda: self.slew.simulate(own, driven, np.zeros(2), disturbance).outputs)


def draw(rng: np.random.Generator) -> Machine:
    """A machine beside the values of specs."""
    slew_base = tuple(around(name, rng, known=name not in slew.FREE) for name in slew.BASE)
    return Machine(arm.draw(rng), Slew(slew_base), tool.draw(rng))
