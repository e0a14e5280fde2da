"""What adversarial episodes are made of, each drawn from its number alone: machines, starts, drivers.

Machines are corners: every parameter of `specs/draws.toml` at one end of its range or the other (delays,
valves, torques, masses, sensors' zeros), or anywhere within.  None of them is of the sealed test set.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from deployment.guard.stand import Driver, Stand, Start
from specs import draws, parameters
from specs.scene import Box, Cylinder, Goal, HalfSpace, HeightMap, Scene, Thing, Zone

LOAD_MOST_KG = 2000.0  # the promise's
POSES = ((0.62, 1.48), (-2.35, -0.2))  # boom, stick: within the joints' limits
CORNER_SHARE = 0.7  # of the machines
SWINGS_S = (2.4, 3.3)  # periods of the tool
MOVES = (1, 3)  # things that move in a yard, from and to
PACE_S = (0.5, 6.0)  # between the corners of a path


def machine(random: np.random.Generator) -> dict[str, float]:
    """Parameters of a drawn machine."""
    known = {name: p.value for name, p in parameters.load(*draws.FILES).items()}
    corner, groups, found = random.random() < CORNER_SHARE, dict[str, float](), {}
    for name, spread in draws.spreads().items():
        share = float(random.integers(2)) if corner else float(random.random())
        share = groups.setdefault(spread.group or name, share)
        low, high = spread.limits(known[name])
        found[name] = low + share * (high - low)
    return found


def pose(random: np.random.Generator) -> tuple[float, float, float]:
    """Slew, boom, stick, rad."""
    boom, stick = (float(random.uniform(*limits)) for limits in POSES)
    return float(random.uniform(-math.pi, math.pi)), boom, stick


def start(random: np.random.Generator) -> Start:
    """A machine with a load in a pose."""
    angles = pose(random)
    load = random.choice([0.0, LOAD_MOST_KG, random.uniform(0.0, LOAD_MOST_KG)])
    return Start(angles, float(load), machine(random))


def yard(number: int, seed: int, moving: bool = False) -> Scene:
    """A scene full of things around the machine: walls, poles, beams, piles, keep-out zones.

    `moving`: the same with more things, which come and go, and now and then a tilted plane.
    """
    random = np.random.default_rng([seed, number, 1])
    makers = (_wall, _pole, _beam, _pile)
    things = tuple(makers[int(random.integers(4))](random, k) for k in range(int(random.integers(2, 6))))
    zones = (Zone(kind="keep_out", shape=_pole(random, 9)),) if random.random() < 0.5 else ()
    if moving:
        things = (*things, *_movers(np.random.default_rng([seed, number, 2])))
    target = Goal(slew_deg=0.0, radius_m=9.0, height_m=4.0)
    name = f"yard {number}"
    return Scene(name=name, description=name, start=target, targets=(target,), things=things, zones=zones)


def _movers(random: np.random.Generator) -> tuple[Thing, ...]:
    makers, found = (_wall, _pole, _beam, _pile), list[Thing]()
    for k in range(10, 10 + int(random.integers(MOVES[0], MOVES[1] + 1))):
        x, y = _place(random, 9.0, 15.0)
        near = (
            _slope(random, k, x, y) if random.random() < 0.2 else makers[int(random.integers(4))](random, k)
        )
        found.append(replace(near, path=_comings(random, *_outward(near))))
    return tuple(found)


def _outward(thing: Thing) -> tuple[float, float]:
    """Direction from the machine to a thing."""
    place = next(vars(thing)[name] for name in ("middle", "foot", "point", "corner") if name in vars(thing))
    length = math.hypot(*place[:2])
    return place[0] / length, place[1] / length


def _comings(
    random: np.random.Generator, x: float, y: float
) -> tuple[tuple[float, float, float, float], ...]:
    """A path that comes no nearer than the thing's own place, and is there at least once."""
    rows, at_s = list[tuple[float, float, float, float]](), 0.0
    here = int(random.integers(5))
    for k in range(5):
        far, aside = (0.0, 0.0) if k == here else random.uniform((0.0, -4.0), (8.0, 4.0))
        rise = 0.0 if k == here else random.choice([0.0, 0.0, random.uniform(0.0, 2.0)])
        rows.append((at_s, float(far * x - aside * y), float(far * y + aside * x), float(rise)))
        at_s += float(random.uniform(*PACE_S))
    return tuple(rows)


def _slope(random: np.random.Generator, k: int, x: float, y: float) -> HalfSpace:
    """A bank that rises outwards, or a roof that comes down there."""
    length, tilt = math.hypot(x, y), float(random.uniform(0.2, 1.3))
    up, height = (1.0, 0.0) if random.random() < 0.6 else (-1.0, float(random.uniform(9.0, 16.0)))
    normal = (-x / length * math.sin(tilt), -y / length * math.sin(tilt), up * math.cos(tilt))
    return HalfSpace(name=f"slope {k}", point=(x, y, height), normal=normal)


def _place(random: np.random.Generator, nearest: float, farthest: float = 16.0) -> tuple[float, float]:
    turn, radius = random.uniform(-math.pi, math.pi), random.uniform(nearest, farthest)
    return float(radius * math.cos(turn)), float(radius * math.sin(turn))


def _box(
    random: np.random.Generator, nearest: float, *sizes: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float, float], float]:
    """Place, size within these ranges, and turn [deg]."""
    place = _place(random, nearest)
    length, width, height = (float(random.uniform(*span)) for span in sizes)
    return place, (length, width, height), float(random.uniform(0.0, 180.0))


def _wall(random: np.random.Generator, k: int) -> Thing:
    place, size, turn = _box(random, 7.0, (0.3, 5.0), (0.3, 1.0), (1.0, 10.0))
    return Box(name=f"wall {k}", middle=(*place, size[2] / 2), size=size, turn_deg=turn)


def _pole(random: np.random.Generator, k: int) -> Cylinder:
    x, y = _place(random, 4.6)
    radius, height = float(random.uniform(0.1, 1.0)), float(random.uniform(1.0, 12.0))
    return Cylinder(name=f"pole {k}", foot=(x, y, 0.0), radius=radius, height=height)


def _beam(random: np.random.Generator, k: int) -> Thing:
    place, size, turn = _box(random, 5.0, (2.0, 10.0), (0.3, 1.0), (0.3, 1.0))
    return Box(name=f"beam {k}", middle=(*place, float(random.uniform(5.0, 14.0))), size=size, turn_deg=turn)


def _pile(random: np.random.Generator, k: int) -> Thing:
    x, y = _place(random, 9.0)
    heights = tuple(tuple(round(float(random.uniform(0.0, 3.0)), 2) for _ in range(4)) for _ in range(4))
    return HeightMap(name=f"pile {k}", corner=(x - 2.0, y - 2.0), cell=1.0, heights=heights)


def bang(random: np.random.Generator, ticks: int, shortest_s: float = 0.2, longest_s: float = 4.0) -> Driver:
    """Each axis at one end, the other, or neutral, for a drawn time."""
    rows = np.zeros((ticks, 3))
    for axis in range(3):
        tick = 0
        while tick < ticks:
            length = round(math.exp(random.uniform(math.log(shortest_s), math.log(longest_s))) / 0.02)
            rows[tick : tick + length, axis] = random.choice([-1.0, 0.0, 1.0, random.uniform(-1, 1)])
            tick += length
    return lambda tick, _: rows[tick]


def push(random: np.random.Generator, ticks: int) -> Driver:
    """One way with all there is, or a share of it."""
    row = random.choice([-1.0, 0.0, 1.0], 3) * random.choice([1.0, random.uniform(0.2, 1.0)])
    return lambda tick, _: row


def rock(random: np.random.Generator, ticks: int) -> Driver:
    """To and fro at the tool's period, and slowly to one side."""
    period, drift = random.uniform(*SWINGS_S), random.uniform(-0.5, 0.5, 3)
    size, phase = random.choice([0.0, 1.0], 3), random.uniform(0.0, 2 * math.pi)

    def at(tick: int, _: Stand) -> np.ndarray:
        beat = math.copysign(1.0, math.sin(2 * math.pi * 0.02 * tick / period + phase))
        return np.clip(drift + size * beat, -1.0, 1.0)

    return at


def noise(random: np.random.Generator, ticks: int) -> Driver:
    """A hand that trembles: filtered noise."""
    rows, value, keep = np.empty((ticks, 3)), np.zeros(3), random.uniform(0.8, 0.99)
    for tick in range(ticks):
        value = keep * value + math.sqrt(1.0 - keep * keep) * random.normal(0.0, 0.8, 3)
        rows[tick] = np.clip(value, -1.0, 1.0)
    return lambda tick, _: rows[tick]


def seek(random: np.random.Generator, ticks: int) -> Driver:
    """Ten times a second the command that the guard would just let pass: it drives at the wall as it may."""
    ends = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    size, held = random.choice([1.0, random.uniform(0.15, 1.0)]), [np.zeros(3)]

    def at(tick: int, stand: Stand) -> np.ndarray:
        if tick % 5 == 0:
            rooms = np.array([stand.foreseen(size * end)[-1] for end in ends])
            rooms[rooms < 0.0] = np.inf
            # the least room that passes; where none does, what is worst of all
            held[0] = size * ends[int(rooms.argmin()) if np.isfinite(rooms).any() else random.integers(27)]
        return held[0]

    return at


def charge(random: np.random.Generator, ticks: int) -> Driver:
    """Away first, then back at full speed, with the arm pushed against all it has at a drawn moment."""
    turn, late = random.choice([-1.0, 1.0]), round(random.uniform(1.0, 6.0) / 0.02)
    arm, back = random.choice([-1.0, 0.0, 1.0], 2), round(random.uniform(0.0, 2.5) / 0.02)

    def at(tick: int, _: Stand) -> np.ndarray:
        slew = -turn if tick < back else turn
        return np.array([slew, *(arm if tick >= late else np.zeros(2))])

    return at


JOYSTICKS: dict[str, Callable[[np.random.Generator, int], Driver]] = {
    "push": push, "bang": bang, "rock": rock, "noise": noise, "charge": charge, "seek": seek,
}  # fmt: skip
LETS_GO = ("push", "bang", "rock", "noise")  # of those, what needs nothing to drive at
