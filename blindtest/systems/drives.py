"""How each kind of machine is driven in its runs, and what is usual in them."""

from dataclasses import replace

import numpy as np

from blindtest.effects.effect import Scale
from blindtest.excitation import KINDS, signal
from blindtest.systems.arm import LIMIT, Arm
from blindtest.systems.machine import Machine
from blindtest.systems.system import STEP, Drive, System
from specs.errors import RunError

MOST_SWING = 0.5  # rad: the range in which the plain model is meant to hold
Driven = tuple[Drive, np.ndarray]  # a run's drive and the start of its motion


def value(system: System, name: str, default: float = 0.0) -> float:
    """A base parameter of the truth."""
    return next((b.value for b in system.base if b.name == name), default)


def _plan(rng: np.random.Generator, shortest: int, longest: int) -> tuple[int, list[str]]:
    """Samples of each run and the kinds of three to five runs."""
    samples, count = int(rng.integers(shortest, longest + 1) / STEP), int(rng.integers(3, 6))
    return samples, [str(k) for k in rng.permutation(KINDS)[:count]]


def _traces(system: System, drives: list[Driven]):
    values = {b.name: b.value for b in system.base}
    return [system.simulate(values, drive, start) for drive, start in drives]


def servo(system: System, rng: np.random.Generator) -> list[Driven]:
    """Open or closed loop, each run of another kind."""
    samples, kinds = _plan(rng, 12, 20)
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
    inertia = value(system, "inertia")
    authority, damping = value(system, "gain") / inertia, value(system, "viscous") / inertia
    fast = rng.uniform(1.5, 3.0)
    kp, kd = fast**2 / authority, max(1.6 * fast - damping, 0.0) / authority
    gains = (kp, float(rng.choice([0.0, 0.3])) * kp, kd, 1.0)
    reference = start[0] + rng.uniform(0.4, 1.0) * wanted
    return Drive(np.zeros((len(wanted), 1)), reference, gains, kind=f"closed loop, {kind}")


def servo_scale(system: System, drives: list[Driven]) -> Scale:
    """From runs without effects."""
    traces = _traces(system, drives)
    outputs = np.concatenate([t.outputs for t in traces])
    largest = float(max(np.abs(t.commands).max() for t in traces))
    return Scale(
        force=value(system, "gain") * largest,
        inertia=value(system, "inertia"),
        speed=float(np.sqrt(np.mean(outputs[:, 1] ** 2))),
        travel=float(np.abs(outputs[:, 0]).max()),
        command=largest,
    )


def arm(system: System, rng: np.random.Generator) -> list[Driven]:
    """Velocity references of both joints, or a position loop around them; poses stay inside the limits."""
    samples, kinds = _plan(rng, 14, 20)
    closed = rng.random() < 0.4
    found: list[Driven] = []
    for kind in kinds:
        start = np.array([rng.uniform(1.0, 1.1), rng.uniform(-1.5, -1.1), 0.0, 0.0])
        wanted = np.column_stack([signal(kind, samples, rng), 0.5 * signal("multisine", samples, rng)])
        if system.active == 1:  # type: ignore[attr-defined]
            wanted = wanted[:, ::-1]
        if closed:
            reference = start[:2] + 0.15 * wanted
            kp = float(rng.uniform(0.5, 1.0))  # stable with the loop's delay of a third of a second
            found.append(
                (Drive(np.zeros_like(wanted), reference, (kp, 0, 0, LIMIT), f"closed, {kind}"), start)
            )
        else:
            found.append((Drive(_kept(0.9 * LIMIT * wanted), kind=f"open loop, {kind}"), start))
    return found


def _kept(rates: np.ndarray, most: float = 0.3) -> np.ndarray:
    """Rates [n, axes] pulled back so that their integral stays within about `most`."""
    found, angle = rates.copy(), np.zeros(rates.shape[1])
    for k in range(len(rates)):
        leaving = rates[k] * angle > 0
        found[k] = np.where(
            leaving, rates[k] * np.clip(2.0 * (1.0 - np.abs(angle) / most), 0.0, 1.0), rates[k]
        )
        angle += STEP * found[k]
    return found


def arm_scale(system: Arm, drives: list[Driven]) -> Scale:
    """From runs without effects, of the joint that has them."""
    joint = ("boom", "stick")[system.active]
    inertia, response = value(system, f"{joint}_joint_inertia"), value(system, f"{joint}_response")
    outputs = np.concatenate([t.outputs for t in _traces(system, drives)])
    q = outputs[:, system.active]
    return Scale(
        force=inertia * response * LIMIT / STEP,
        inertia=inertia,
        speed=float(np.sqrt(np.mean(outputs[:, 2 + system.active] ** 2))),
        travel=float(np.ptp(q)),
        command=LIMIT,
    )


def tool(system: System, rng: np.random.Generator) -> list[Driven]:
    """A suspension that slews and luffs from rest, the swing below MOST_SWING."""
    samples, kinds = _plan(rng, 16, 22)
    values = {b.name: b.value for b in system.base}
    found: list[Driven] = []
    for kind in kinds:
        rate = 0.35 * rng.uniform(0.5, 1.0) * _smooth(signal(kind, samples, rng), 0.5)
        luff = 0.8 * rng.uniform(0.5, 1.0) * _kept(signal("random", samples, rng)[:, None], 2.0)[:, 0]
        radius = rng.uniform(9.0, 14.0)
        start = np.array([rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), 0.0, 0.0])
        for gentler in 0.8 ** np.arange(20):
            drive = Drive(
                _suspension(gentler * rate, gentler * _smooth(luff, 0.4), radius), kind=f"moved, {kind}"
            )
            swing, smallest = _swing(system, values, drive, start), drive.commands[:, 2].min()
            if swing < MOST_SWING and smallest > 5.0:
                break
        found.append((drive, start))
    return found


def _suspension(rate: np.ndarray, luff: np.ndarray, radius: float) -> np.ndarray:
    """Slew angle and rate, radius and its rate, height [n, 5]."""
    radii = radius + STEP * np.cumsum(luff)
    return np.column_stack([STEP * np.cumsum(rate), rate, radii, luff, np.full(len(rate), 8.0)])


def _swing(system: System, values: dict[str, float], drive: Drive, start: np.ndarray) -> float:
    """Largest angle; infinite when it goes over the top."""
    try:
        return float(np.abs(system.simulate(values, drive, start).outputs[:, :2]).max())
    except RunError:
        return np.inf


def _smooth(values: np.ndarray, lag: float) -> np.ndarray:
    """Through two lags (s), as a machine follows."""
    keep, found = np.exp(-STEP / lag), values.copy()
    for _ in range(2):
        state = 0.0
        for k in range(len(found)):
            state = keep * state + (1.0 - keep) * found[k]
            found[k] = state
    return found


def tool_scale(system: System, drives: list[Driven]) -> Scale:
    """From runs without effects; forces are angular accelerations."""
    outputs = np.concatenate([t.outputs for t in _traces(system, drives)])
    travel = float(np.abs(outputs[:, :2]).max())
    return Scale(
        force=value(system, "gravity") / value(system, "tool_length_y") * travel,
        inertia=1.0,
        speed=float(np.sqrt(np.mean(outputs[:, 2:] ** 2))),
        travel=travel,
        command=1.0,
    )


def slew(system: System, rng: np.random.Generator) -> list[Driven]:
    """Joystick open loop, or a speed loop; the inertia changes with an arm that moves in some runs."""
    samples, count = int(rng.integers(12, 19) / STEP), int(rng.integers(3, 5))
    closed = rng.random() < 0.3
    found: list[Driven] = []
    for kind in [str(k) for k in rng.permutation(KINDS)[:count]]:
        wanted = signal(kind, samples, rng)
        commands = np.column_stack([rng.uniform(0.6, 1.0) * wanted, *_inertia(samples, rng)])
        start = np.array([rng.uniform(-1.0, 1.0), 0.0])
        if closed:
            gains = (float(rng.uniform(2.0, 4.0)), 0.0, 0.0, 1.0)
            found.append((Drive(commands, 0.35 * wanted, gains, f"closed loop, {kind}"), start))
        else:
            found.append((Drive(commands, kind=f"open loop, {kind}"), start))
    return found


def _inertia(samples: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Inertia (kg m2) and its rate, each [samples]."""
    level = rng.uniform(3.0e5, 5.0e5)
    swing = 0.8e5 * _smooth(signal("ramps", samples, rng), 0.5) if rng.random() < 0.6 else np.zeros(samples)
    whole = level + swing
    return whole, np.diff(whole, append=whole[-1]) / STEP


def slew_scale(system: System, drives: list[Driven]) -> Scale:
    """From runs without effects."""
    traces = _traces(system, drives)
    outputs = np.concatenate([t.outputs for t in traces])
    return Scale(
        force=2e7 * value(system, "slew_displacement"),
        inertia=4e5,
        speed=float(np.sqrt(np.mean(outputs[:, 1] ** 2))),
        travel=float(np.ptp(outputs[:, 0])),
        command=float(max(np.abs(t.commands[:, 0]).max() for t in traces)),
    )


def machine(system: System, rng: np.random.Generator) -> list[Driven]:
    """Three or four runs of 14-18 s with all three commands at once, open loop; swing below MOST_SWING."""
    samples, count = int(rng.integers(14, 19) / STEP), int(rng.integers(3, 5))
    values = {b.name: b.value for b in system.base}
    found: list[Driven] = []
    for kind in [str(k) for k in rng.permutation(KINDS)[:count]]:
        joints = np.column_stack([signal(str(rng.choice(KINDS)), samples, rng) for _ in range(2)])
        joints = _kept(0.15 * joints, most=0.2)
        stick = signal(kind, samples, rng)
        start = np.array([rng.uniform(1.0, 1.15), rng.uniform(-1.5, -1.2), *rng.uniform(-0.05, 0.05, size=2)])
        for gentler in 0.8 ** np.arange(12):
            drive = Drive(np.column_stack([stick, gentler * joints]), kind=f"open loop, {kind}")
            try:
                outputs = system.simulate(values, drive, start).outputs
            except RunError:
                continue
            if np.abs(outputs[:, 8:10]).max() < MOST_SWING:
                break
        found.append((drive, start))
    return found


def machine_scale(system: Machine, drives: list[Driven]) -> Scale:
    """From runs without effects; each part has its own."""
    outputs = np.concatenate([t.outputs for t in _traces(system, drives)])
    speeds = np.sqrt(np.mean(outputs**2, axis=0))
    travel = np.ptp(outputs, axis=0)
    most = np.abs(np.concatenate([d.commands for d, _ in drives])).max(axis=0)
    inertia, response = value(system, "boom_joint_inertia"), value(system, "boom_response")
    swing = float(np.abs(outputs[:, 8:10]).max())
    weight = value(system, "gravity") / value(system, "tool_length_y")
    slew_force = 2e7 * value(system, "slew_displacement")
    parts = {
        "slew": Scale(slew_force, 4e5, float(speeds[1]), float(travel[0]), float(most[0])),
        "arm": Scale(inertia * response * LIMIT / STEP, inertia, float(speeds[6]), float(travel[4]), LIMIT),
        "tool": Scale(weight * swing, 1.0, float(speeds[10:].mean()), swing, 1.0),
    }
    return replace(parts["slew"], parts=parts)
