"""Faults of a machine's wiring, for the simulated machine: between its sensors or valves and the bus.

Every sensor swapped with each plausible neighbour, with its sign turned, scaled (half, double, degrees for
radians, g for m/s2, bar for Pa), off its zero, noisy, dead (frozen, at zero, at the end of its range,
reporting an error) or with a loose contact; those that control loops rest on late by half a second; both IMUs
turned on their brackets; every valve swapped, turned, scaled, late or dead; every message missing or too
seldom; every switch turned or dead.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import combinations

from runtime.can.codec import received_by
from runtime.image import INPUT, NODE, TICK_S, Group, group
from specs.errors import InputError, nearest

OPTIONAL = ("Planner", "Policy")  # nodes that a machine need not have
JOINTS = ("slew", "boom", "stick")
PRESSURES = tuple(f"p_{j}_{s}" for j in JOINTS for s in "ab")
IMUS = ("cabin", "tool")
IMU = ("rate_x", "rate_y", "rate_z", "acc_x", "acc_y", "acc_z", "roll", "pitch")
VALVES = ("u_slew", "u_boom", "u_stick")
SENSORS = tuple(s.name for s in INPUT.signals if group(s) is Group.SENSOR)
SWITCHES = (
    "operator_enable", "automatic_request", "emergency_stop", "automatic_allowed", "machine_ready",
    "pilot_enabled",
)  # fmt: skip
BINARY = (*SWITCHES, "brake_released")
HARD_WIRED = ("no watchdog", "enabling switch leaves pilot pressure", "emergency stop leaves pilot pressure")
JOYSTICK = tuple(f"joystick_{j}" for j in JOINTS)
BIAS = {"rad": 0.2, "rad/s": 0.1, "m/s2": 2.0, "Pa": 4e6}  # several times what the machine draws spread
NOISE = {"rad": 0.06, "rad/s": 0.06, "m/s2": 1.5, "Pa": 1.5e6}  # three times what `rest` lets pass
LATE_S = 0.5
LOOSE_EVERY, LOOSE_FOR = 60, 3  # ticks: how often a loose contact opens, and for how long
NO_VALUE = float("nan")  # goes over the wire as the code for an error


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong; `kind` says how `signals` are, `value` by how much."""

    kind: str
    signals: tuple[str, ...]
    value: float = 0.0

    @property
    def name(self) -> str:
        """E.g. `q_boom scale 0.5`, `p_slew_a swapped p_slew_b`."""
        if self.kind == "swapped":
            half = len(self.signals) // 2
            return f"{'+'.join(self.signals[:half])} swapped {'+'.join(self.signals[half:])}"
        amount = f" {self.value:.4g}" if self.value else ""
        whole = self.signals[0].removesuffix(f"_{IMU[0]}") if len(self.signals) == len(IMU) else ""
        return f"{whole or '+'.join(self.signals)} {self.kind}{amount}"

    @property
    def group(self) -> str:
        """Which row of the matrix it belongs to: what is wired wrong, and how."""
        if self.kind in HARD_WIRED:
            return f"hard-wired: {self.kind}"
        what = "message" if self.kind in ("missing", "half rate") else _what(self.signals[0])
        return f"{what}: {self.kind}"


@dataclass
class Wiring:
    """Faults at work; `first` are the values that frozen signals keep, `past` those that late ones had."""

    faults: tuple[Fault, ...] = ()
    first: dict[str, float] = field(default_factory=dict)
    past: dict[str, deque[float]] = field(default_factory=dict)
    ticks: int = 0

    def sensed(self, values: Mapping[str, float]) -> dict[str, float]:
        """What the electronics send of what the sensors show, called once a tick."""
        found = dict(values)
        self.ticks += 1
        for fault in self.faults:
            self._apply(fault, found)
        return found

    commanded = sensed  # the same wires, the other way

    def has(self, kind: str) -> bool:
        """Whether something that is to be hard-wired does not work."""
        return any(fault.kind == kind for fault in self.faults)

    def drops(self, message: str, beat: int) -> bool:
        """Whether this frame of a message never comes."""
        for fault in self.faults:
            if fault.signals == (message,):
                return fault.kind == "missing" or (fault.kind == "half rate" and beat % 2 == 1)
        return False

    def _apply(self, fault: Fault, found: dict[str, float]) -> None:
        names = [n for n in fault.signals if n in found]
        if fault.kind == "swapped" and names:
            half = len(names) // 2
            for a, b in zip(names[:half], names[half:], strict=True):
                found[a], found[b] = found[b], found[a]
        elif fault.kind == "reversed with its pressures":
            self._reverse(fault.signals, found)
        elif fault.kind in ("turned", "upside down") and names:
            found |= _mounted(fault, found)
        elif fault.kind in TIMED:
            for n in names:
                found[n] = TIMED[fault.kind](self, n, found[n], fault.value)
        elif fault.kind in ONE:
            for n in names:
                found[n] = ONE[fault.kind](found[n], fault.value, self.first.setdefault(n, found[n]), n)

    def _late(self, name: str, x: float, seconds: float) -> float:
        kept = self.past.setdefault(name, deque(maxlen=round(seconds / TICK_S) + 1))
        kept.append(x)
        return kept[0]

    def _loose(self, name: str, x: float, _: float) -> float:
        return NO_VALUE if self.ticks % LOOSE_EVERY < LOOSE_FOR else x

    def _noisy(self, name: str, x: float, amplitude: float) -> float:
        return x + amplitude * math.sin(7.9 * self.ticks * self.ticks)  # deterministic, and white enough

    def _reverse(self, signals: tuple[str, ...], found: dict[str, float]) -> None:
        valve, a, b = signals
        if valve in found:
            found[valve] = -found[valve]
        if a in found:
            found[a], found[b] = found[b], found[a]


TIMED: dict[str, Callable[[Wiring, str, float, float], float]] = {
    "late": Wiring._late,
    "loose contact": Wiring._loose,
    "noisy": Wiring._noisy,
}
ONE = {
    "sign": lambda x, value, first, name: 1.0 - x if name in BINARY else -x,
    "scale": lambda x, value, first, name: value * x,
    "bias": lambda x, value, first, name: x + value,
    "frozen": lambda x, value, first, name: first,
    "zero": lambda x, value, first, name: 0.0,
    "one": lambda x, value, first, name: 1.0,
    "error": lambda x, value, first, name: NO_VALUE,
    "full scale": lambda x, value, first, name: math.inf,  # as much as its field in the message holds
}


def cases() -> list[Fault]:
    """Every single fault, each once."""
    found = [*_sensors(), *_encoders(), *_swaps(), *_valves(), *_switches(), *_messages(), *_together()]
    found += [*_mountings(), *_late()]
    found += [Fault(kind, ("machine",)) for kind in HARD_WIRED]
    return list({f.name: f for f in found}.values())


def _sensors() -> Iterator[Fault]:
    for name in SENSORS:
        unit = INPUT.signals[INPUT.index[name]].unit
        yield Fault("sign", (name,))
        yield Fault("error", (name,))
        yield Fault("zero", (name,))
        if name in BINARY:
            yield Fault("one", (name,))
            continue
        yield Fault("frozen", (name,))
        yield Fault("full scale", (name,))
        yield Fault("loose contact", (name,))
        yield Fault("noisy", (name,), NOISE[unit])
        yield Fault("bias", (name,), BIAS[unit])
        for factor in (0.5, 2.0, *_units(unit)):
            yield Fault("scale", (name,), factor)


def _encoders() -> Iterator[Fault]:
    """Position and velocity come from one encoder: wrong together."""
    for joint in JOINTS:
        both = (f"q_{joint}", f"qd_{joint}")
        yield Fault("sign", both)
        yield from (Fault("scale", both, factor) for factor in (0.5, 2.0))
        yield Fault("frozen", both)
    for a, b in combinations(JOINTS, 2):
        yield Fault("swapped", (f"q_{a}", f"qd_{a}", f"q_{b}", f"qd_{b}"))


def _together() -> Iterator[Fault]:
    """Valve and sensors of an axis reversed together: they agree with each other."""
    for joint in JOINTS:
        yield Fault("sign", (f"u_{joint}", f"q_{joint}", f"qd_{joint}"))
        both = (f"p_{joint}_a", f"p_{joint}_b")
        yield Fault("reversed with its pressures", (f"u_{joint}", *both))
    yield Fault("sign", ("u_slew", "q_slew", "qd_slew", "imu_cabin_rate_z"))


def _mountings() -> Iterator[Fault]:
    """An IMU that is turned about its upright axis, degrees, or upside down on its bracket."""
    for imu in IMUS:
        signals = tuple(f"imu_{imu}_{n}" for n in IMU)
        yield from (Fault("turned", signals, degrees) for degrees in (90.0, 180.0, -90.0))
        yield Fault("upside down", signals)


def _mounted(fault: Fault, found: Mapping[str, float]) -> dict[str, float]:
    """What an IMU shows that is mounted so; its angles as those of small turns."""
    rate, acc = ([found[n] for n in fault.signals[k : k + 3]] for k in (0, 3))
    roll, pitch = (found[n] for n in fault.signals[6:])
    if fault.kind == "upside down":
        turned = [[x, -y, -z] for x, y, z in (rate, acc)]
        angles = [math.remainder(roll + math.pi, 2 * math.pi), -pitch]
    else:
        c, s = math.cos(math.radians(fault.value)), math.sin(math.radians(fault.value))
        turned = [[c * x + s * y, c * y - s * x, z] for x, y, z in (rate, acc)]
        angles = [c * roll + s * pitch, c * pitch - s * roll]
    return dict(zip(fault.signals, (*turned[0], *turned[1], *angles), strict=True))


def _late() -> Iterator[Fault]:
    """Only what control loops rest on: pressures of the arm weigh the load, slowly, and may be late."""
    single = (f"{kind}_{joint}" for kind in ("q", "qd") for joint in JOINTS)
    sensors = (*single, "p_slew_a", "p_slew_b", *(f"imu_{imu}_{n}" for imu in IMUS for n in IMU))
    yield from (Fault("late", (name,), LATE_S) for name in (*sensors, *VALVES))
    yield from (Fault("late", (f"q_{joint}", f"qd_{joint}"), LATE_S) for joint in JOINTS)


def _units(unit: str) -> tuple[float, ...]:
    """Wrong units: degrees for radians, g for m/s2, kPa for Pa."""
    known = {"rad": math.degrees(1), "rad/s": math.degrees(1), "m/s2": 1 / 9.80665, "Pa": 1e-3}
    return (known[unit],)


def _swaps() -> Iterator[Fault]:
    for kind in ("q", "qd"):
        yield from (Fault("swapped", (f"{kind}_{a}", f"{kind}_{b}")) for a, b in combinations(JOINTS, 2))
    yield from (Fault("swapped", pair) for pair in combinations((*PRESSURES, "p_pump"), 2))
    for imu in IMUS:
        for kind in ("rate", "acc"):
            yield from (
                Fault("swapped", (f"imu_{imu}_{kind}_{a}", f"imu_{imu}_{kind}_{b}"))
                for a, b in combinations("xyz", 2)
            )
        yield Fault("swapped", (f"imu_{imu}_roll", f"imu_{imu}_pitch"))
    yield from (Fault("swapped", (f"imu_cabin_{n}", f"imu_tool_{n}")) for n in IMU)
    yield Fault("swapped", (*(f"imu_cabin_{n}" for n in IMU), *(f"imu_tool_{n}" for n in IMU)))


def _valves() -> Iterator[Fault]:
    for name in VALVES:
        yield from (Fault("sign", (name,)), Fault("zero", (name,)))
        yield from (Fault("scale", (name,), factor) for factor in (0.5, 2.0))
    yield from (Fault("swapped", pair) for pair in combinations(VALVES, 2))


def _switches() -> Iterator[Fault]:
    for name in SWITCHES:
        yield from (Fault("sign", (name,)), Fault("zero", (name,)), Fault("one", (name,)))
    for name in JOYSTICK:
        yield from (Fault("sign", (name,)), Fault("zero", (name,)), Fault("error", (name,)))
        yield from (Fault("scale", (name,), factor) for factor in (0.5, 2.0))
    yield from (Fault("swapped", pair) for pair in combinations(JOYSTICK, 2))


def _messages() -> Iterator[Fault]:
    for codec in received_by(NODE):
        if codec.message.sender not in OPTIONAL:
            yield Fault("missing", (codec.message.name,))
            if codec.message.cycle_ms <= 100:
                yield Fault("half rate", (codec.message.name,))


def _what(name: str) -> str:
    if name in VALVES:
        return "valve"
    if name in SWITCHES:
        return "switch"
    return "joystick" if name in JOYSTICK else "sensor"


def find(text: str) -> list[Fault]:
    """Cases whose name has `text` in it."""
    return [fault for fault in cases() if text in fault.name or text == fault.group]


def named(name: str) -> Fault:
    """The case of that name; InputError with the nearest."""
    known = {fault.name: fault for fault in cases()}
    if name not in known:
        raise InputError(f"no wiring fault '{name}'; {nearest(name, known)}")
    return known[name]
