"""Sweeps of the simulated reference machine: recordings from which `calibrate lut` makes its tables.

One recording a joint and condition: the joystick is held at each level in turn, in random order and both
ways, while the joint goes to and fro between turning points inside its limits and above the keep-out height.
What is held ends early at a turning point.  The machine is driven as a person would drive it, from its
sensors; the recordings hold commands and sensors, with their noise, and nothing else.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from baselines.arm_velocity.model import JOINTS
from baselines.bench import STEP_S, bare_machine
from fmus.equations import kinematics
from orchestrator.run.master import Master, Options
from orchestrator.system.layout import lay_out
from orchestrator.system.system import System
from records.recording import RecordWriter
from specs import draws, keys
from specs.progress import Report

LABEL = "simulated reference machine"
ALL = ("slew", "boom", "stick")
COMMANDS = tuple(f"u_{joint}" for joint in ALL)
SENSED = (
    *(f"{kind}_{joint}" for kind in ("q", "qd") for joint in ALL),
    *(f"p_{joint}_{side}" for joint in ALL for side in "ab"),
    "p_pump",
)
LEVELS = (*(0.01 * k for k in range(6, 21, 2)), *(0.01 * k for k in range(24, 101, 4)))  # joystick
TICKS = 5  # between two looks at the sensors: 0.1 s
HOLD_S = 4.0  # that a level is held, if there is room
AHEAD_S = 0.6  # the encoder's delay, the valve's, and the way the arm takes to stop
EDGE = 0.06  # rad, kept off the joint limits
LOWEST = 2.0 + 0.5  # m, of the hanging tool: keep-out and a little
SWAY = 0.12  # rad to both sides, by which the other joint moves where it does
SLEW_S = 6.0  # until the slew, where it is in use, turns back
ROOM = 0.35  # share of the way that must be left for a level to begin, else the other direction is taken


@dataclass(frozen=True)
class Condition:
    """Under what a recording is made: pose of the other joint [rad], load [kg], joysticks of the others."""

    name: str
    other: Mapping[str, float]  # by swept joint
    load_kg: float = 0.0
    slew: float = 0.0  # joystick of the slew, to and fro
    moving: float = 0.0  # joystick of the other joint, to and fro


CONDITIONS = (
    Condition("middle, empty", {"boom": -1.25, "stick": 1.05}),
    Condition("folded, 2 t", {"boom": -1.8, "stick": 1.25}, load_kg=2000.0),
    Condition("stretched, 1 t, slewing", {"boom": -0.8, "stick": 0.9}, load_kg=1000.0, slew=0.45),
    Condition("middle, 0.5 t, both joints", {"boom": -1.3, "stick": 1.1}, load_kg=500.0, moving=0.35),
)


def sweep(
    folder: Path,
    joints: Sequence[str] = JOINTS,
    seed: int = 1,
    machine: str = "nominal",
    conditions: Sequence[Condition] = CONDITIONS,
    levels: Sequence[float] = LEVELS,
    report: Report | None = None,
) -> list[Path]:
    """Record a sweep of each joint in each condition to `folder`; return the files.

    `machine` is "nominal" or a draw ("validation:0"); the same arguments give the same bytes.
    """
    system = bare_machine(list(SENSED))
    todo = [(joint, number) for joint in joints for number in range(len(conditions))]
    files = []
    for done, (joint, number) in enumerate(todo):
        if report:
            report(f"sweep of the {joint}, {conditions[number].name}", done, len(todo))
        path = folder / f"lut_{joint}_{number}.parquet"
        _record(system, path, joint, conditions[number], levels, (seed, machine, number))
        files.append(path)
    return files


def _record(
    system: System,
    path: Path,
    joint: str,
    condition: Condition,
    levels: Sequence[float],
    key: tuple[int, str, int],
) -> None:
    """One recording; `key` is (seed, machine, number of the condition)."""
    seed, machine, _ = key
    other, pose = _other(joint), condition.other[joint]
    way = turning_points(joint, pose, SWAY if condition.moving else 0.0)
    noise = 1 + int(keys.uniform("lut noise", joint, *key) * (2**31 - 2))
    start = {f"start_q_{joint}": sum(way) / 2, f"start_q_{other}": pose, "load_mass": condition.load_kg}
    values = {**draws.named(machine), **start, "noise_seed": float(noise)}
    meta = {
        "origin": LABEL,
        "machine": machine,
        "parameters": values,
        "fmus": {name: component.sha256 for name, component in system.components.items()},
        "seed": seed,
        "joint": joint,
        "condition": condition.name,
        "load_kg": condition.load_kg,
    }
    driver = Driver(joint, condition, way, shuffled(levels, "lut order", joint, *key))
    columns = ("time", *COMMANDS, *SENSED)
    with RecordWriter(path, columns, meta) as writer:
        for rows in _run(system, {f"machine.{n}": v for n, v in values.items()}, driver):
            writer.append(rows)


def _run(system: System, values: Mapping[str, Any], driver: "Driver") -> Iterator[np.ndarray]:
    """Rows [TICKS, 1 + commands + sensors] until the driver has nothing more to do."""
    layout = lay_out(system, [*COMMANDS, *SENSED])
    with Master(system, layout, system.start_values(values), Options()) as master:
        master.plan.log(64 * TICKS)
        master.initialise()
        seen: dict[str, float] = {}
        while (commands := driver(seen)) is not None:
            for name, value in commands.items():
                master.set_input(name, value)
            master.run(master.tick + TICKS)
            rows = master.take(TICKS, 4 * TICKS, 0)
            rows[:, 0] = rows[:, 0].view(np.int64) * STEP_S
            seen = dict(zip((*COMMANDS, *SENSED), rows[-1, 1:].tolist(), strict=True))
            yield rows
        master.log_finish()


class Driver:
    """Holds level after level, to and fro between the turning points; looks at sensors only."""

    def __init__(
        self, joint: str, condition: Condition, way: tuple[float, float], levels: Mapping[int, list[float]]
    ) -> None:
        """`way` [rad]: the turning points; `levels`: joystick values still to be held, by direction."""
        self.joint, self.other, self.condition, self.way = joint, _other(joint), condition, way
        self.left = {direction: list(values) for direction, values in levels.items()}
        self.command, self.until, self.period = 0.0, 10, 0  # a second of rest to begin with
        self.sway, self.turn = 1.0, 1.0

    def __call__(self, seen: Mapping[str, float]) -> dict[str, float] | None:
        """Commands for the next 0.1 s, given the newest sensor values; None when all levels were held."""
        if seen and (self.period >= self.until or self._at_turning_point(seen)):
            if not any(self.left.values()):
                return None
            self._next(seen)
        self.period += 1
        commands = {f"u_{self.joint}": self.command, f"u_{self.other}": self._other(seen)}
        return {"u_slew": self._slew(), **commands}

    def _at_turning_point(self, seen: Mapping[str, float]) -> bool:
        ahead = seen[f"q_{self.joint}"] + AHEAD_S * seen[f"qd_{self.joint}"]
        return ahead >= self.way[1] if self.command > 0 else self.command < 0 and ahead <= self.way[0]

    def _next(self, seen: Mapping[str, float]) -> None:
        """The next level, in the direction that has room; where only the other has levels left, go back."""
        low, high = self.way
        place = (seen[f"q_{self.joint}"] - low) / (high - low)  # 0 at the low turning point, 1 at the high
        direction = 1 if place < 0.5 else -1
        room = 1 - place if direction < 0 else place
        if not self.left[direction] and room >= ROOM:  # enough left the other way, too
            direction = -direction
        level = self.left[direction].pop() if self.left[direction] else 0.5
        self.command = direction * level
        self.until = self.period + round(HOLD_S / (TICKS * STEP_S))

    def _other(self, seen: Mapping[str, float]) -> float:
        if not self.condition.moving or not seen:
            return 0.0
        off = seen[f"q_{self.other}"] - self.condition.other[self.joint]
        ahead = off + AHEAD_S * seen[f"qd_{self.other}"]
        if ahead * self.sway >= SWAY:
            self.sway = -self.sway
        return self.sway * self.condition.moving

    def _slew(self) -> float:
        periods = round(SLEW_S / (TICKS * STEP_S))
        return self.condition.slew * (1.0 if self.period // periods % 2 == 0 else -1.0)


def shuffled(levels: Sequence[float], *key: object) -> dict[int, list[float]]:
    """`levels` for both directions (1, -1), each in an order that the key decides."""
    return {
        direction: sorted(levels, key=lambda level: keys.uniform(*key, direction, f"{level:.3f}"))
        for direction in (1, -1)
    }


def turning_points(joint: str, other: float, sway: float = 0.0) -> tuple[float, float]:
    """Where a sweep of `joint` turns back [rad]: off its limits, the tool above the keep-out height.

    The other joint stands at `other` [rad], or moves by `sway` to both sides of it.
    """
    g = kinematics.geometry()
    low, high = getattr(g, f"{joint}_min") + EDGE, getattr(g, f"{joint}_max") - EDGE
    q = np.linspace(low, high, 201)
    allowed = np.ones(len(q), dtype=bool)
    for stands in (other - sway, other, other + sway):
        boom, stick = (q, stands) if joint == "boom" else (stands, q)
        radius, height = kinematics.arm_tip(boom, stick, g)
        allowed &= (height - g.tool_length >= LOWEST) & (radius >= 3.0)
    inside = q[allowed]
    return float(inside[0]), float(inside[-1])


def _other(joint: str) -> str:
    return "stick" if joint == "boom" else "boom"
