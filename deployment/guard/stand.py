"""A guarded core and the reference machine in one process, driven by a joystick of our own, tick by tick.

As `deployment/hil/lockstep.py`, with the controller's place free: what drives writes the commands of all
three axes at 50 Hz, which is more than any policy may.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from deployment.bundling import guard
from deployment.bundling.blocks import External
from deployment.bundling.build import assemble
from deployment.bundling.content import Content
from deployment.hil.machine import COMMANDS, Machine, signal_names
from deployment.hil.panel import ARMING_TICKS, CALM, HEARTBEATS, sensor_names
from runtime.bundle import Bundle
from runtime.control import ControlCore
from runtime.image import INPUT, OUTPUT, Status
from specs.scene import Scene
from specs.signals import signal

NAME = "joystick"
AXES = ("u_slew", "u_boom", "u_stick")
TRUE = (
    "true_q_slew",
    "true_q_boom",
    "true_q_stick",
    "true_q_tool_y",
    "true_q_tool_x",
)  # as specs.pose.ANGLES
RATES = ("true_qd_slew", "true_qd_boom", "true_qd_stick", "true_qd_tool_y", "true_qd_tool_x")
TARGET = {"target_x": 9.0, "target_y": 0.0, "target_z": 3.5, "target_valid": 1.0, "pace": 1.0}
SETTLED = 8  # ticks after which the guard remembers enough
JITTER = 1e-9  # rad
Look = Callable[[int, np.ndarray, np.ndarray], None]  # (tick, input image, commands wanted)
Driver = Callable[[int, "Stand"], np.ndarray]  # (tick, stand) -> commands of slew, boom, stick


@dataclass(frozen=True)
class Start:
    """How an episode begins: pose [rad], load [kg], and a drawn machine's parameters."""

    angles: tuple[float, float, float] = (0.0, 1.2, -1.7)
    load_kg: float = 0.0
    drawn: Mapping[str, float] = field(default_factory=dict)

    def parameters(self, seed: int) -> dict[str, float]:
        """Of the machine, by name."""
        names = ("start_q_slew", "start_q_boom", "start_q_stick")
        return {**self.drawn, "load_mass": self.load_kg, **dict(zip(names, self.angles, strict=True))}


@dataclass(frozen=True)
class Drive:
    """What came of an episode, a row a tick: true angles and rates, commands sent, guard_part, mode."""

    angles: np.ndarray
    rates: np.ndarray
    sent: np.ndarray
    part: np.ndarray
    mode: np.ndarray


def bundle(scene: Scene | None, out: Path, changes: Mapping[str, float] | None = None) -> Bundle:
    """A core without a controller, its guard keeping off a scene; None: never near anything."""
    joystick = External([], outputs=AXES, period=1)
    zones = guard.zones(scene) if scene else guard.nothing()
    return assemble(Content(NAME, joystick, guard=zones), out, changes=changes)


class Stand:
    """One core, for one episode after the other."""

    def __init__(self, made: Bundle) -> None:
        self.core = ControlCore(made)
        self.image = INPUT.new()
        self._offer = self.core.library.slr_offer
        self._offer.argtypes, self._offer.restype = [ctypes.c_void_p] * 2, None
        self._state = self.core.state_address
        names = signal_names()
        sensors = [n for n in sensor_names() if n in names]
        self._from = np.array([names.index(n) for n in sensors])
        self._to = np.array([INPUT.index[n] for n in sensors])
        self._low, self._high = (
            np.array([_bound(getattr(signal(n), side), sign) for n in sensors])
            for side, sign in (("min", -1.0), ("max", 1.0))
        )
        self.joints = np.array([INPUT.index[n] for n in ("q_slew", "q_boom", "q_stick")])
        self._true = np.array([names.index(n) for n in (*TRUE, *RATES)])
        self._out = np.array([OUTPUT.index[n] for n in (*COMMANDS, "guard_part", "control_mode")])

    def drive(
        self,
        start: Start,
        driver: Driver,
        ticks: int,
        seed: int = 1,
        look: Look | None = None,
        over: Mapping[str, float] | None = None,
    ) -> Drive:
        """An episode of `ticks` in automatic operation; `look` sees each; inputs `over` stay so."""
        self.core.reset()
        rows = np.empty((ticks, 15))
        commands = dict.fromkeys(COMMANDS, 0.0)
        with Machine(start, seed) as machine:
            for tick in range(-ARMING_TICKS, ticks):
                values = machine.values
                self._write(values, tick)
                for name, number in (over or {}).items() if tick >= 0 else ():
                    self.image["value"][INPUT.index[name]] = number
                wanted = np.ascontiguousarray(driver(tick, self) if tick >= 0 else np.zeros(3))
                out = self.step(self.image, wanted, tick)[self._out]
                if look:
                    look(tick, self.image, wanted)
                if tick < 0:
                    continue
                rows[tick, :10], rows[tick, 10:] = values[self._true], out
                machine.advance(commands)
                commands = dict(zip(COMMANDS, out[:3].tolist(), strict=True))
        return Drive(rows[:, :5], rows[:, 5:10], rows[:, 10:13], rows[:, 13], rows[:, 14])

    def step(self, image: np.ndarray, wanted: np.ndarray, tick: int) -> np.ndarray:
        """The outputs of a tick in which the joystick wants this."""
        self._offer(self._state, wanted.ctypes.data)
        self.last = self.core.step(image, tick)["value"]
        return self.last

    def room(self, angles: tuple[float, float, float]) -> float:
        """The guard's room [m] at rest in a pose."""
        self.core.reset()
        self._calm()
        value = self.image["value"]
        value[self._to] = np.clip(0.0, self._low, self._high)
        for tick in range(SETTLED):
            value[self.joints] = (
                np.array(angles) + JITTER * (-1.0) ** tick
            )  # noise: a value that rests is a stuck sensor
            self.image["tick"] = tick
            self.core.step(self.image, tick)
        return float(self.foreseen(np.zeros(3))[-1])

    def foreseen(self, commands: Sequence[float] | np.ndarray) -> np.ndarray:
        """What the guard foresees of these commands in this tick: ControlCore.foreseen."""
        return self.core.foreseen(self.image, list(commands))

    def _write(self, values: np.ndarray, tick: int) -> None:
        """The input image of a tick."""
        image, value = self.image, self.image["value"]
        if tick == -ARMING_TICKS:
            self._calm()
        image["tick"] = tick
        value[self._to] = np.clip(values[self._from], self._low, self._high)
        for name, every in HEARTBEATS.items():
            value[INPUT.index[name]] = tick // every % 251
        value[INPUT.index["operator_enable"]] = tick > -ARMING_TICKS + 1
        value[INPUT.index["automatic_request"]] = tick >= 0

    def _calm(self) -> None:
        """Everything around the controller is well, every message fresh."""
        for name, number in {**CALM, **TARGET}.items():
            self.image["value"][INPUT.index[name]] = number
        self.image["age"], self.image["status"] = 0, Status.OK


def _bound(value: float | None, sign: float) -> float:
    return sign * np.inf if value is None else value
