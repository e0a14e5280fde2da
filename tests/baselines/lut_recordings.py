"""Made-up sweeps of a joint whose valve curve, linkage and load are known: what tables are held against."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from records.measurement import Channel, Measurement

STEP = 0.02  # s
MIDDLE = 1.0  # rad
LOAD = 200e5  # Pa
WAY = 0.6  # rad to both sides of it
LEVELS = tuple(np.round(np.arange(0.05, 1.001, 0.05), 2))
EDGE = {1: 0.14, -1: 0.11}
GAIN = {1: 0.30, -1: 0.34}  # rad/s a joystick


def curve(command: float) -> float:
    """Speed at the reference condition [rad/s]: a dead band for each direction, then nearly a line."""
    way = 1 if command > 0 else -1
    past = max(abs(command) - EDGE[way], 0.0)
    return way * GAIN[way] * (past - 0.05 * past**2)


def inverse(speed: float) -> float:
    """Joystick at which `curve` gives `speed`."""
    way = 1 if speed > 0 else -1
    past = (1 - np.sqrt(1 - 4 * 0.05 * abs(speed) / GAIN[way])) / (2 * 0.05)
    return way * (EDGE[way] + past)


@dataclass(frozen=True)
class Joint:
    """How the made-up joint answers."""

    curve: Callable[[float], float] = curve
    linkage: float = 0.5  # 1/rad
    load: float = -0.15  # a 100 bar
    noise: float = 2e-4  # rad
    swing: float = 15e5  # Pa, of the inlet pressure
    compliance: float = 3e-10  # rad/Pa


def sweep(
    joint: Joint,
    seed: int,
    loads: Sequence[float] = (150e5, 250e5),
    levels: Sequence[float] = LEVELS,
    hold_s: float = 3.5,
    slowed: float = 0.0,
    name: str = "boom",
) -> list[Measurement]:
    """A recording for each inlet pressure of `loads` [Pa]; `slowed` of the holds run at half the speed."""
    random = np.random.default_rng(seed)
    return [
        _one(joint, random, load, levels, hold_s, slowed, name, f"sweep{i}") for i, load in enumerate(loads)
    ]


def _one(
    joint: Joint,
    random: np.random.Generator,
    load: float,
    levels: Sequence[float],
    hold_s: float,
    slowed: float,
    name: str,
    source: str,
) -> Measurement:
    count = round(hold_s / STEP)
    q, u, p = MIDDLE, [], []
    speeds = []
    signed = random.permutation([way * level for level in levels for way in (1, -1)])
    for command in signed:
        factor = 0.5 if random.random() < slowed else 1.0
        phase = random.uniform(0, 2 * np.pi)
        q = MIDDLE + random.uniform(-0.5, 0.1) * np.sign(command)  # as if moved back in between
        for k in range(count):
            if abs(q - MIDDLE) > WAY:
                break
            wave = joint.swing * np.sin(2 * np.pi * k * STEP / 2.7 + phase)
            scale = 1 + joint.linkage * (q - MIDDLE) + joint.load * (load - LOAD) / 1e7
            q += STEP * factor * joint.curve(command) * scale
            u.append(command)
            p.append(load + wave)
            speeds.append(q)
    pressure = np.array(p)
    angle = np.array(speeds) - joint.compliance * (pressure - load)
    angle = angle + joint.noise * random.standard_normal(len(angle))
    noisy = pressure + 5e4 * random.standard_normal(len(pressure))
    return measurement(
        {f"u_{name}": u, f"q_{name}": angle, f"p_{name}_a": noisy, f"p_{name}_b": noisy}, source
    )


def measurement(columns: Mapping[str, Sequence[float] | np.ndarray], source: str = "sweep") -> Measurement:
    """Channels at 50 Hz; those of pressures in Pa, angles in rad."""
    units = {"u": "1", "q": "rad", "p": "Pa"}
    channels = {}
    for name, values in columns.items():
        array = np.asarray(values, dtype=float)
        channels[name] = Channel(name, units[name[0]], STEP * np.arange(len(array)), array)
    return Measurement(channels, source=source)


def changed(recording: Measurement, **columns: np.ndarray) -> Measurement:
    """The recording with other values in some channels."""
    values = {name: channel.values for name, channel in recording.channels.items()}
    return measurement({**values, **columns}, recording.source)


def without(recording: Measurement, *names: str) -> Measurement:
    """The recording without some channels."""
    kept = {name: c.values for name, c in recording.channels.items() if name not in names}
    return measurement(kept, recording.source)
