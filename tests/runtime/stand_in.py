"""A control core and a port for tests that need none of the real ones."""

import struct

import numpy as np

from runtime.image import INPUT, OUTPUT
from runtime.recorder.feed import Feed
from runtime.ring import Ring

STATE = struct.Struct("<qd")
SLEW, COMMAND = INPUT.at("q_slew"), OUTPUT.at("u_slew")


class StandIn:
    """A core whose command remembers all inputs: a sum with a leak, and a count of its steps."""

    def __init__(self, gain: float = 0.25) -> None:
        self.gain, self.steps, self.sum = gain, 0, 0.0
        self.outputs = OUTPUT.new()
        self.seen: list[int] = []

    def step(self, inputs: np.ndarray, tick: int) -> np.ndarray:
        self.steps += 1
        self.seen.append(tick)
        self.sum = 0.99 * self.sum + self.gain * float(inputs["value"][SLEW])
        self.outputs["tick"], self.outputs["flags"] = tick, inputs["flags"]
        self.outputs["value"][COMMAND] = self.sum
        return self.outputs

    def snapshot(self) -> bytes:
        return STATE.pack(self.steps, self.sum)

    def restore(self, state: bytes) -> None:
        self.steps, self.sum = STATE.unpack(state)


class Noise:
    """A port that brings a seeded random slew angle each tick."""

    def __init__(self, seed: int = 1) -> None:
        self.random = np.random.default_rng(seed)
        self.sent: list[float] = []

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        inputs["value"][SLEW] = self.random.normal()
        inputs["age"][SLEW] = inputs["status"][SLEW] = 0

    def send(self, outputs: np.ndarray, tick: int) -> None:
        self.sent.append(float(outputs["value"][COMMAND]))

    def flags(self) -> int:
        return 0

    def received_ns(self) -> int:
        return 0


class Lockstep:
    """Core, port and queue without a clock: `run` feeds ticks as the cycle would."""

    def __init__(self, ring: Ring, snapshot_ticks: int = 50, core: StandIn | None = None) -> None:
        self.core, self.port = core or StandIn(), Noise()
        self.feed = Feed(ring, snapshot_ticks)
        self.inputs, self.next = INPUT.new(), 0

    def run(self, ticks: int) -> None:
        for tick in range(self.next, self.next + ticks):
            self.inputs["tick"] = tick
            self.port.receive(self.inputs, tick)
            self.feed.before(tick, self.core)
            outputs = self.core.step(self.inputs, tick)
            self.feed.tick(self.inputs, outputs, (tick * 20_000_000, 0, 0, 0, -1))
        self.next += ticks
