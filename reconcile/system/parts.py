"""The parts of a system, in the order in which they are looked at, and what their signals are made of.

Every part keeps its own model (slew continuous, arm and tool in steps) and is fitted by itself; where it
feels another part, it is given that part's motion (neighbour_motion.py).  What one part lacks cannot turn up
in another, and an effect carries the name of its part.  Here is written, once, how the sensors of a machine
become the signals that the models speak of.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fmus.equations import kinematics
from fmus.models.tool import model as tool
from fmus.toolchain.loader import members_of
from records.measurement import Channel, Measurement
from records.tool import joint_rates
from specs.errors import InputError

JOINTS = ("q_boom", "q_stick")
RATES = ("qd_boom", "qd_stick")
# The tool's step moves its rate over the angle at the step's start, and then the angle with the new rate
# (leapfrog, Stoermer-Verlet): its rates are those of half a step before its angles, and what moves its
# suspension is seen between the rates, half a step after the angle.
HALF = 0.5 * tool.STEP


@dataclass(frozen=True)
class Part:
    """A part: its model, the signals of other parts that it feels, and what is made of them.

    `derive`: columns by name, each [n], and the load in kg [n] -> the part's inputs by name, each [n].
    `folder`: of its model, where that is not the project's own.
    `later`: by how much later (s) the model has an output than its other ones.
    `otherwise`: what `derive` is where the recordings have these outputs as late as the model (`ways.py`).
    """

    name: str
    feels: tuple[str, ...] = ()
    derive: Callable[[Mapping[str, np.ndarray]], dict[str, tuple[str, np.ndarray]]] | None = None
    later: Mapping[str, float] = field(default_factory=dict)
    otherwise: Callable[[Mapping[str, np.ndarray]], dict[str, tuple[str, np.ndarray]]] | None = None
    folder: str = ""

    @property
    def model(self) -> str:
        """Folder of its model, or the name of the project's."""
        return self.folder or self.name


def _turned(c: Mapping[str, np.ndarray]) -> dict[str, tuple[str, np.ndarray]]:
    """Inertia of the slew and its rate."""
    p, load = kinematics.geometry(), c["load"]
    boom, stick, boom_rate, stick_rate = (c[n] for n in (*JOINTS, *RATES))
    return {
        "inertia": ("kg.m2", kinematics.inertia_z(boom, stick, load, p)),
        "inertia_rate": ("kg.m2/s", kinematics.inertia_rate(boom, stick, boom_rate, stick_rate, load, p)),
    }


def _hung(c: Mapping[str, np.ndarray]) -> dict[str, tuple[str, np.ndarray]]:
    """Motion of the tool's suspension in the middle of the tool's step: see `HALF`."""
    return _hung_at_once({n: np.interp(c["time"] + HALF, c["time"], v) for n, v in c.items()})


def _hung_at_once(c: Mapping[str, np.ndarray]) -> dict[str, tuple[str, np.ndarray]]:
    """Motion of the tool's suspension."""
    p = kinematics.geometry()
    boom, stick, boom_rate, stick_rate = (c[n] for n in (*JOINTS, *RATES))
    radius, height = kinematics.arm_tip(boom, stick, p)
    radius_rate, _ = kinematics.arm_tip_rate(boom, stick, boom_rate, stick_rate, p)
    return {
        "q_slew": ("rad", c["q_slew"]),
        "qd_slew": ("rad/s", c["qd_slew"]),
        "radius": ("m", radius),
        "radius_rate": ("m/s", radius_rate),
        "height": ("m", height),
    }


SYSTEMS: dict[str, tuple[Part, ...]] = {
    "nominal": (
        Part("arm"),
        Part("slew", (*JOINTS, *RATES), _turned),
        Part(
            "tool",
            ("q_slew", "qd_slew", *JOINTS, *RATES),
            _hung,
            {"qd_tool_x": HALF, "qd_tool_y": HALF},
            _hung_at_once,
        ),
    )
}


def parts_of(model: str) -> tuple[Part, ...] | None:
    """Parts of a system by its name or the path of its file in specs/systems; None if it is no system.

    A folder of models that are parts of one, as an earlier answer left it, is that system with these in it.
    """
    if members := members_of(Path(model)):
        return next((_with(parts, members) for parts in SYSTEMS.values() if _hold(parts, members)), None)
    name = model.removesuffix(".toml").rsplit("/", 1)[-1]
    return SYSTEMS.get(name) if model in (name, f"specs/systems/{name}.toml") else None


def _hold(parts: Sequence[Part], members: Mapping[str, Path]) -> bool:
    return {*members} <= {p.name for p in parts}


def _with(parts: Sequence[Part], members: Mapping[str, Path]) -> tuple[Part, ...]:
    """The parts, those with a folder among the members modelled by it."""
    return tuple(replace(p, folder=str(members[p.name])) if p.name in members else p for p in parts)


def part_named(name: str) -> Part | None:
    """The part of a system that a model of this name is; None if it is none."""
    return next((part for parts in SYSTEMS.values() for part in parts if part.name == name), None)


def with_signals(measured: Measurement) -> Measurement:
    """The measurement with what its IMU says of the tool's angles and their rates, where they are not in it.

    On level ground the IMU's roll and pitch are the joint angles; its rates: `records.tool`.
    """
    names = [f"imu_tool_{n}" for n in ("roll", "pitch", "rate_x", "rate_y", "rate_z")]
    wanted = ("q_tool_x", "q_tool_y", "qd_tool_x", "qd_tool_y")
    if measured.missing(names) or not measured.missing(wanted):
        return measured
    roll, pitch, *rates = (measured[n] for n in names)
    if any(len(c.time) != len(roll.time) for c in (pitch, *rates)):
        raise InputError(f"{measured.source or 'the recording'}: the channels of imu_tool do not go together")
    rate_x, rate_y = joint_rates(roll.values, pitch.values, *(c.values for c in rates))
    found = {
        "q_tool_x": ("rad", roll.values),
        "q_tool_y": ("rad", pitch.values),
        "qd_tool_x": ("rad/s", rate_x),
        "qd_tool_y": ("rad/s", rate_y),
    }
    for n in ("x", "y"):
        found[f"qd_tool_{n}"] = (
            "rad/s",
            _zeroed(found[f"qd_tool_{n}"][1], found[f"q_tool_{n}"][1], roll.time),
        )
    made = {n: Channel(n, unit, roll.time, v) for n, (unit, v) in found.items()}
    said = (
        *measured.repairs,
        "angles and rates of the tool are made of imu_tool_*, the rates' zeros taken off",
    )
    return replace(measured, channels={**made, **measured.channels}, repairs=said)


def _zeroed(rate: np.ndarray, angle: np.ndarray, time: np.ndarray) -> np.ndarray:
    """A gyroscope's rate [n] less its zero: what its mean has more than the angle [n] beside it went."""
    ends = max(1, min(10, len(angle) // 4))
    went = np.mean(angle[-ends:]) - np.mean(angle[:ends])
    lasted = np.mean(time[-ends:]) - np.mean(time[:ends])
    inside = (time >= np.mean(time[:ends])) & (time <= np.mean(time[-ends:]))
    return rate - (np.mean(rate[inside]) - went / lasted)
