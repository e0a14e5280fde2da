"""Known points touched by hand: the geometry against the encoders (deployment/commissioning/points.py).

The operator brings the grab's centre to each point with the joysticks, in manual operation at limited
authority, and lets it hang still.  Where the grab stands at no angles that suit all points, one of them was
typed, measured or touched wrong, or an encoder or a length is.
"""

import math
from collections.abc import Sequence

import numpy as np

from deployment.commissioning.bench import Bench
from deployment.commissioning.points import FEWEST, JOINTS, MOST, Fit, Point, check, fit, odd_one
from deployment.commissioning.rig import Trace
from deployment.commissioning.steps.safety import hold, release
from specs.errors import InputError

LOOKS = 40  # at the grab, until it hangs still
SWING = ("imu_tool_roll", "imu_tool_pitch")


def run(bench: Bench) -> None:
    """Every point, then the fit."""
    points = bench.points or _typed(bench)
    hold(bench)
    bench.rig.hands_off = False
    bench.rig.limit([bench.f.commissioning_most] * 3, 1.0, bench.f.commissioning_rise)
    angles = np.array([_touched(bench, point) for point in points])
    bench.neutral()
    release(bench)
    _judge(bench, points, angles, fit(points, angles))
    bench.verdict()


def _typed(bench: Bench) -> tuple[Point, ...]:
    """The points that the operator names; InputError for those that cannot be used."""
    count = bench.number("known.count", f"How many known points are touched ({FEWEST} to {MOST})", "points")
    if count not in range(FEWEST, MOST + 1):
        raise InputError(f"step touch: {count:g} points; {FEWEST} to {MOST} are needed")
    points = []
    for k in range(1, int(count) + 1):
        x, y, z = (bench.number(f"known.{k}.{axis}", f"Point {k}: {axis}", "m") for axis in "xyz")
        points.append(Point(name=f"point {k}", x=x, y=y, z=z))
    check(points, "step touch")
    return tuple(points)


def _touched(bench: Bench, point: Point) -> list[float]:
    """The encoders' mean angles, rad, while the grab hangs at the point; Failed where it does not."""
    text = f"Bring the grab's centre to {point} with the joysticks and let it hang still. Is it there?"
    x, y, z = point.xyz
    there = bench.seen(f"touch.{x:.3f}_{y:.3f}_{z:.3f}", text)
    bench.equal(f"{point.name}: reached", "yes" if there else "no", "yes", "the way there; other points")
    bench.verdict()
    moved, swing, trace = _hanging(bench)
    f = bench.f
    bench.between(f"{point.name}: moved meanwhile", moved, 0.0, f.commissioning_touch_still, "rad", "wait")
    bench.between(f"{point.name}: swing", swing, 0.0, f.commissioning_touch_swing, "rad", "wait longer")
    bench.verdict()
    return [float(np.mean(trace[name])) for name in JOINTS]


def _hanging(bench: Bench) -> tuple[float, float, Trace]:
    """How far a joint moves, the tool's largest swing [rad], and what passed, once both are small enough or
    nobody waits longer.
    """
    f, moved, swing = bench.f, math.inf, math.inf
    trace = bench.wait(f.commissioning_touch)
    for _ in range(LOOKS):
        moved = max(float(np.ptp(trace[name])) for name in JOINTS)
        swing = max(float(np.ptp(trace[name])) / 2 for name in SWING)
        if moved <= f.commissioning_touch_still and swing <= f.commissioning_touch_swing:
            break
        trace = bench.wait(f.commissioning_touch)
    return moved, swing, trace


def _judge(bench: Bench, points: Sequence[Point], angles: np.ndarray, found: Fit) -> None:
    names = [point.name for point in points]
    bench.found["points"] = {point.name: list(point.xyz) for point in points}
    bench.found["angles"] = dict(zip(names, angles.tolist(), strict=True))
    bench.found["residuals"] = left = dict(zip(names, found.residuals, strict=True))
    bench.found["residual"] = math.sqrt(sum(r**2 for r in found.residuals) / len(points))
    most = bench.f.commissioning_touch_residual
    look = _suspects(points, angles, most)
    for point in points:
        bench.between(f"{point}: residual", left[point.name], 0.0, most, "m", look)
    for joint in JOINTS:
        _offset(bench, joint, found.offsets[joint], found.intervals[joint])


def _offset(bench: Bench, joint: str, offset: float, half: float) -> None:
    f, zero = bench.f, bench.before.get("rest", {}).get(f"zero {joint}", 0.0)
    bench.found |= {f"offset {joint}": offset, f"interval {joint}": [offset - half, offset + half]}
    name = f"{joint}: half of the offset's 95 % interval"
    bench.between(name, half, 0.0, f.commissioning_touch_interval, "rad", "more points, further apart")
    apart, look = f.commissioning_touch_apart, f"encoder of {joint}, inclinometer, mark; lengths of the arm"
    bench.between(f"{joint}: offset less its zero at rest", offset - zero, -apart, apart, "rad", look)


def _suspects(points: Sequence[Point], angles: np.ndarray, limit_m: float) -> str:
    """Where to look when points do not fit."""
    odd = odd_one(points, angles, limit_m) if len(points) > FEWEST else None
    alone = f"{odd}: without it the others fit; " if odd else ""
    return f"{alone}were the points measured, typed and touched right? scales of the encoders, lengths"
