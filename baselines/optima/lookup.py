"""What the best found optima say of a set of targets: the fastest, and the least tool rate at a mean speed.

A comparison averages over targets, so a mean speed may be met by being quick to one target and gentle to
another.  Each target's front is the lower convex hull of its stored optima (slower is never worse); the
hulls' segments are taken in the order of their slopes, the cheapest gain in speed first, which is the least
sum for piecewise linear convex fronts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from baselines.optima import store
from specs.errors import InputError

Point = tuple[float, float]  # speed deg/s, tool rate deg/s


@dataclass(frozen=True)
class Share:
    """How near a controller's means come to the best found: 1 is the optimum itself."""

    speed: float  # its speed over the fastest found
    tool: float | None  # least tool rate found at its speed over its own; None: none found at that speed


def front(
    travel_deg: float, load_kg: float = 0.0, machine: str = "nominal", path: Path = store.PATH, move: int = 0
) -> list[Point]:
    """(speed, tool rate) of the stored optima of a case that count, by speed; [] if there are none."""
    entries = store.read(path).values()
    wanted = store.Key(machine, load_kg, travel_deg, move=move)
    own = [e for e in entries if replace(e.key, speed=wanted.speed) == wanted and e.counts]
    return sorted((float(e.found["speed"]), float(e.found["tool"])) for e in own)


def fastest(fronts: Sequence[Sequence[Point]]) -> float:
    """Mean over targets of the highest speed found, deg/s."""
    _check(fronts)
    return sum(points[-1][0] for points in fronts) / len(fronts)


def least_tool(fronts: Sequence[Sequence[Point]], speed: float) -> float | None:
    """Least mean tool rate (deg/s) over targets at a mean `speed` (deg/s); None beyond the fastest found."""
    _check(fronts)
    hulls = [hull(points) for points in fronts]
    reached = sum(points[0][0] for points in hulls)
    tool = sum(points[0][1] for points in hulls)
    wanted = speed * len(fronts)
    for slope, gain in sorted(_segments(hulls)):
        taken = min(gain, max(wanted - reached, 0.0))
        reached, tool = reached + taken, tool + slope * taken
    return tool / len(fronts) if reached >= wanted - 1e-9 else None


def share(fronts: Sequence[Sequence[Point]], speed: float, tool: float) -> Share:
    """Of a controller's mean speed and tool rate (deg/s) over the same targets."""
    best = least_tool(fronts, speed)
    return Share(speed / fastest(fronts), None if best is None else best / tool)


def hull(points: Sequence[Point]) -> list[Point]:
    """Lower convex hull of a front, by speed; a point that a faster one betters is left out."""
    kept: list[Point] = []
    for point in sorted(points, reverse=True):  # from the fastest down: the tool rate must fall
        if kept and point[1] >= kept[-1][1]:
            continue
        while len(kept) > 1 and _slope(point, kept[-1]) >= _slope(kept[-1], kept[-2]):
            kept.pop()
        kept.append(point)
    return kept[::-1]


def _slope(slow: Point, fast: Point) -> float:
    return (fast[1] - slow[1]) / (fast[0] - slow[0])


def _segments(hulls: Sequence[Sequence[Point]]) -> list[tuple[float, float]]:
    """(slope, gain in speed) of all hulls' segments."""
    pairs = [(points[i], points[i + 1]) for points in hulls for i in range(len(points) - 1)]
    return [(_slope(slow, fast), fast[0] - slow[0]) for slow, fast in pairs]


def _check(fronts: Sequence[Sequence[Point]]) -> None:
    if not fronts or not all(fronts):
        raise InputError("no optima are stored for one of the targets; `slewright optimum` finds them")
