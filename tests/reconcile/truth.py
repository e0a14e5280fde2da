"""The rig's truth for tests: a carriage with effects in their non-smooth form, by an integrator of its own.

Speed by Euler steps of 0.1 ms, place by the mean of two speeds, with exact sticking: where the force cannot
break the friction at rest, the carriage stands.  Nothing of reconcile is used here.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from records.measurement import Channel, Measurement

DT = 1e-4
PERIOD = 0.02


@dataclass
class Truth:
    """What the carriage really does; `friction(v) -> (level at rest, kinetic level with sign of v)`."""

    mass: float = 2.0
    drag: float = 1.5
    inputs: Callable[[np.ndarray], np.ndarray] = field(default=lambda u: u)  # whole signal at DT
    force: Callable[[float, float, float], float] = field(default=lambda x, v, t: 0.0)
    static: tuple[float, float] = (0.0, 0.0)  # breakaway forwards, backwards
    kinetic: Callable[[float], float] = field(default=lambda v: 0.0)  # opposes, signed, v != 0
    position: Callable[[np.ndarray], np.ndarray] = field(default=lambda y: y)  # at DT
    velocity: Callable[[np.ndarray], np.ndarray] = field(default=lambda y: y)


def excitation(seconds: float, seed: int, size: float = 8.0) -> np.ndarray:
    """Force command at PERIOD: random steps and a swept sine."""
    rng = np.random.default_rng(seed)
    n = round(seconds / PERIOD)
    steps = np.repeat(rng.uniform(-1, 1, n // 25 + 1), 25)[:n]
    t = PERIOD * np.arange(n)
    sweep = np.sin(2 * np.pi * (0.15 + 0.01 * t) * t)
    return size * (0.6 * steps + 0.4 * sweep)


def simulate(truth: Truth, command: np.ndarray, start: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity at DT under a held command at PERIOD, from rest at a position."""
    per = round(PERIOD / DT)
    u = truth.inputs(np.repeat(command, per))
    x, v = start, 0.0
    xs, vs = np.empty(len(u)), np.empty(len(u))
    for k in range(len(u)):
        xs[k], vs[k] = x, v
        free = u[k] - truth.drag * v + truth.force(x, v, k * DT)
        if v == 0.0:
            if -truth.static[1] <= free <= truth.static[0]:
                continue
            after = v + DT * (free - (truth.static[0] if free > 0 else -truth.static[1])) / truth.mass
        else:
            after = v + DT * (free - truth.kinetic(v)) / truth.mass
            if after * v < 0.0 and (truth.static[0] > 0 or truth.static[1] > 0):
                after = 0.0
        v = after
        x += DT * 0.5 * (vs[k] + v)
    return xs, vs


def record(
    truth: Truth,
    seconds: float = 40.0,
    seed: int = 0,
    noise: tuple[float, float] = (2e-4, 2e-3),
    size: float = 8.0,
) -> Measurement:
    """A recording at PERIOD with white noise on position (m) and velocity (m/s)."""
    return record_driven(truth, excitation(seconds, seed, size), seed, noise)


def record_driven(
    truth: Truth,
    command: np.ndarray,
    seed: int = 0,
    noise: tuple[float, float] = (2e-4, 2e-3),
    start: float = 0.0,
) -> Measurement:
    """The same with a command of one's own [n] at PERIOD."""
    rng = np.random.default_rng(seed + 1000)
    x, v = simulate(truth, command, start)
    per = round(PERIOD / DT)
    t = PERIOD * np.arange(len(command))
    columns = {
        "force": ("N", command),
        "position": ("m", truth.position(x)[::per] + noise[0] * rng.standard_normal(len(t))),
        "velocity": ("m/s", truth.velocity(v)[::per] + noise[1] * rng.standard_normal(len(t))),
    }
    return Measurement({n: Channel(n, u, t, c) for n, (u, c) in columns.items()}, source="rig")


def coulomb(level: float) -> dict:
    """Coulomb friction."""
    return {"static": (level, level), "kinetic": lambda v: level * np.sign(v)}
