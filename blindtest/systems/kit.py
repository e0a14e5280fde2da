"""What a case needs of each kind of machine: how to draw it, drive it, and which effects it can have."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from blindtest.effects import axis as axis_effects
from blindtest.effects.effect import Effect, Scale
from blindtest.excitation import KINDS, signal
from blindtest.systems import servo
from blindtest.systems.system import STEP, Drive, System

Driven = tuple[Drive, np.ndarray]  # a run's drive and the start of its motion


@dataclass(frozen=True)
class Kit:
    """One kind of machine."""

    name: str
    draw: Callable[[np.random.Generator], System]
    drives: Callable[[System, np.random.Generator], list[Driven]]
    scale: Callable[[System, list[Driven]], Scale]
    effects: tuple[Effect, ...]
    outside: tuple[Effect, ...]


def _value(system: System, name: str, default: float = 0.0) -> float:
    return next((b.value for b in system.base if b.name == name), default)


def _servo_drives(system: System, rng: np.random.Generator) -> list[Driven]:
    """Three to five runs of 12-20 s, open or closed loop, each of another kind."""
    samples, count = int(rng.integers(12, 21) / STEP), int(rng.integers(3, 6))
    kinds = [str(k) for k in rng.permutation(KINDS)[:count]]
    closed = rng.random() < 0.5
    found: list[Driven] = []
    for kind in kinds:
        start = np.array([rng.uniform(-0.3, 0.3), 0.0])
        wanted = signal(kind, samples, rng)
        if closed:
            found.append((_servo_loop(system, wanted, start, kind, rng), start))
        else:
            found.append((Drive(rng.uniform(0.5, 1.0) * wanted[:, None], kind=f"open loop, {kind}"), start))
    return found


def _servo_loop(
    system: System, wanted: np.ndarray, start: np.ndarray, kind: str, rng: np.random.Generator
) -> Drive:
    """A PD or PID position loop that the command's limit and the actuator's lag leave stable."""
    inertia = _value(system, "inertia")
    authority, damping = _value(system, "gain") / inertia, _value(system, "viscous") / inertia
    fast = rng.uniform(1.5, 3.0)
    kp, kd = fast**2 / authority, max(1.6 * fast - damping, 0.0) / authority
    gains = (kp, float(rng.choice([0.0, 0.3])) * kp, kd, 1.0)
    reference = start[0] + rng.uniform(0.4, 1.0) * wanted
    return Drive(np.zeros((len(wanted), 1)), reference, gains, kind=f"closed loop, {kind}")


def _servo_scale(system: System, drives: list[Driven]) -> Scale:
    """From runs without effects."""
    values = {b.name: b.value for b in system.base}
    traces = [system.simulate(values, drive, start) for drive, start in drives]
    speeds = np.concatenate([t.outputs[:, 1] for t in traces])
    travel = np.concatenate([t.outputs[:, 0] for t in traces])
    commands = np.concatenate([t.commands[:, 0] for t in traces])
    largest = float(np.abs(commands).max())
    return Scale(
        force=values["gain"] * largest,
        inertia=values["inertia"],
        speed=float(np.sqrt(np.mean(speeds**2))),
        travel=float(np.abs(travel).max()),
        command=largest,
    )


KITS = {
    "servo": Kit(
        "servo", servo.draw, _servo_drives, _servo_scale, axis_effects.EFFECTS, axis_effects.OUTSIDE
    ),
}
