"""A throw: the slew spins up with the arm in a pose, and the load flies off along the tangent."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from baselines.planning.path import TICK_S, Path, averaged, of_angles
from fmus.equations import kinematics
from specs import parameters
from specs.errors import InputError

RADII_M = np.arange(8.0, 17.0, 0.25)
HEIGHTS_M = np.arange(4.0, 8.5, 0.5)
FINE_M = 0.05
SPARE_M = 0.4  # of the arm's reach: the grab is led from outside the circle
MEANS = 3  # of the path, which make it smooth enough for the grab to be led (baselines/planning/flat.py)
AFTER_S = 0.8  # for which the speed is kept beyond the release


@dataclass(frozen=True)
class Throw:
    """A path with its release, as planned."""

    path: Path
    slew: float  # rad, at the release
    speed: float  # rad/s, of the slew
    radius: float  # m, of the grab
    height: float  # m
    seconds: float  # until the release


def plan(start: np.ndarray, target: tuple[float, float]) -> Throw:
    """The throw with the least cost, from rest in a pose (slew, boom, stick) to a place on the ground [m].

    InputError for a place that no throw reaches, with the valid distances.
    """
    away = math.hypot(*target)
    found = [throw for choice in _choices(away) if (throw := _thrown(start, target, *choice))]
    if not found:
        raise InputError(f"no throw lands {away:.2f} m from the slew axis; valid: {inside(span())} m")
    return min(found, key=_cost)


def _cost(throw: Throw) -> float:
    """Time until the release, and the time that its speed is worth, s."""
    return throw.seconds + _gains()["throw_speed_cost"] * abs(throw.speed) * throw.radius


def span() -> tuple[float, float]:
    """From where to where throws may land, m from the slew axis."""
    g = _gains()
    nearest, farthest = (
        [math.hypot(r, g[name] * r * _fall(z)) for r, z in _poses()]
        for name in ("throw_least_speed", "throw_slew_speed")
    )
    return min(nearest), max(farthest)


def inside(span: tuple[float, float]) -> str:
    """Both ends in figures that are valid themselves."""
    low, high = math.ceil(100.0 * span[0]) / 100.0, math.floor(100.0 * span[1]) / 100.0
    return f"{low:.2f} to {high:.2f}"


@cache
def reach() -> float:
    """How far from the slew axis the grab may be at any height, m, to FINE_M."""
    heights = np.arange(HEIGHTS_M[0], HEIGHTS_M[-1], 5 * FINE_M).tolist()
    radii = np.arange(RADII_M[0], 20.0, FINE_M).tolist()
    return max(r for z in heights for r in radii if not kinematics.reachable(r, 0.0, z))


def _choices(away: float) -> Iterator[tuple[float, float, float]]:
    """(radius, height, slew speed) whose load lands at this distance."""
    gains = _gains()
    for radius, height in _poses():
        if radius < away:
            speed = math.sqrt(away**2 - radius**2) / (radius * _fall(height))
            if gains["throw_least_speed"] <= speed <= gains["throw_slew_speed"]:
                yield radius, height, speed


def _poses() -> Iterator[tuple[float, float]]:
    for height in HEIGHTS_M.tolist():
        for radius in RADII_M.tolist():
            if not kinematics.reachable(radius + SPARE_M, 0.0, height):
                yield radius, height


def _fall(height: float) -> float:
    return math.sqrt(2.0 * height / kinematics.geometry().gravity)


def _thrown(
    start: np.ndarray, target: tuple[float, float], radius: float, height: float, speed: float
) -> Throw | None:
    """The quicker one of both ways round."""
    lead = math.atan(speed * _fall(height))
    azimuth = math.atan2(target[1], target[0])
    both = [_one_way(start, azimuth, way, lead, radius, height, speed) for way in (1, -1)]
    return min(both, key=lambda throw: throw.seconds)


def _one_way(
    start: np.ndarray, azimuth: float, way: int, lead: float, radius: float, height: float, speed: float
) -> Throw:
    g = _gains()
    _, boom, stick = (float(v) for v in kinematics.inverse(radius, 0.0, height, kinematics.geometry()))
    rise = _acceleration(boom, stick, radius)
    steady = g["throw_steady_time"] + MEANS * g["path_round_time"] / 2
    run_up = speed**2 / (2.0 * rise) + speed * steady
    release = azimuth - way * lead
    turn = (way * (release - start[0])) % (2.0 * math.pi)
    turn += 2.0 * math.pi * math.ceil(max(run_up - turn, 0.0) / (2.0 * math.pi))
    arm_s = max(abs(boom - start[1]), abs(stick - start[2])) / g["path_arm_speed"]
    slew_s = speed / rise + (turn - speed**2 / (2.0 * rise)) / speed
    wait = max(arm_s + steady - slew_s, 0.0)
    seconds = wait + slew_s + MEANS * g["path_round_time"] / 2
    profile = _Profile(wait, rise, speed, slew_s + AFTER_S + MEANS * g["path_round_time"] / 2)
    path = _path(start, way, profile, (boom, stick), arm_s)
    return Throw(path, start[0] + way * turn, way * speed, radius, height, seconds)


@dataclass(frozen=True)
class _Profile:
    """Angle gone of a slew that waits, speeds up evenly, and slows down after `until` s of motion."""

    wait: float
    rise: float
    speed: float
    until: float

    def at(self, times: np.ndarray) -> np.ndarray:
        """Angle gone at times a tick apart, rad."""
        moving = np.maximum(times - self.wait, 0.0)
        rates = np.minimum(self.rise * moving, self.speed)
        rates = np.minimum(rates, np.maximum(self.speed - self.rise * (moving - self.until), 0.0))
        return np.concatenate([[0.0], np.cumsum((rates[1:] + rates[:-1]) / 2)]) * TICK_S

    @property
    def seconds(self) -> float:
        """Until it is at rest again."""
        return self.wait + self.until + self.speed / self.rise


def _path(start: np.ndarray, way: int, profile: _Profile, arm: tuple[float, float], arm_s: float) -> Path:
    """The timed path, its corners rounded."""
    times = np.arange(math.ceil(max(profile.seconds, arm_s) / TICK_S) + 1) * TICK_S
    share = np.clip(times / max(arm_s, TICK_S), 0.0, 1.0)
    columns = [start[0] + way * profile.at(times)]
    columns += [a + share * (b - a) for a, b in zip(start[1:].tolist(), arm, strict=True)]
    angles = np.stack(columns, axis=1)
    for _ in range(MEANS):
        angles = averaged(angles, _gains()["path_round_time"])
    return of_angles(angles, np.zeros((1, 3)), 0.0)


def _acceleration(boom: float, stick: float, radius: float) -> float:
    """Of the slew: what it brakes with, and what swings the tool no more than paths may (planner.py)."""
    g, p = _gains(), kinematics.geometry()
    inertia = float(kinematics.inertia_z(boom, stick, 1000.0, p)) + g["control_inertia_extra"]
    brake = g["path_slew_share"] * g["control_brake_torque"] / inertia
    return min(brake, p.gravity * g["path_swing"] / radius)


def _gains() -> dict[str, float]:
    return {n: p.value for n, p in parameters.load("throwing", "planning", "control", "grab").items()}
