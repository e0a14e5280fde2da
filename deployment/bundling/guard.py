"""What the guard of a bundle knows: a scene's solids and keep-out zones in polar form, the machine as balls.

The plane around the slew axis is divided into sectors.  A sector's rectangles of radius and height contain
all that ever comes into it (polar.py).
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from deployment.bundling.polar import FAR_M, SECTORS, WIDTH, Rect, few, outermost, rects
from fmus.equations import kinematics
from specs import parameters, shapes
from specs.errors import InputError
from specs.outlines import surface
from specs.scene import GROUND, Scene
from specs.shapes import BASE

FILE = "guard"  # of specs/parameters
SENSORS = ("imu_tool_pitch", "imu_tool_roll", "imu_tool_rate_x", "imu_tool_rate_y")  # beside the gate's
BALLS = 36  # of runtime/core/guard.h
POINTS_M = 0.25  # between the points on carriage and cabin
COVERED = {"boom": 11, "stick": 10}  # balls along each
PARTS = ("", "boom", "stick", "lines", "grab", "carriage")


@dataclass(frozen=True)
class Zones:
    """A scene as the guard sees it."""

    name: str
    sectors: tuple[tuple[Rect, ...], ...]
    carriage: tuple[float, ...]


def zones(scene: Scene) -> Zones:
    """The zones of a scene; InputError for one that holds the machine itself."""
    solids = [(solid, False) for solid in scene.solids() if solid.name != GROUND]
    found: list[list[Rect]] = [[] for _ in range(SECTORS)]
    for solid, tool_only in (*solids, *((zone, True) for zone in scene.keep_outs())):
        for sector, rect in rects(solid):
            found[sector].append(rect._replace(tool_only=tool_only))
    found = [outermost(there) for there in found]
    carriage = tuple(_carriage(found))
    if max(carriage) <= 0.0:
        raise InputError(
            f"scene {scene.name}: things stand in the machine itself, or come there: carriage and cabin are "
            "clear of them at no slew angle"
        )
    return Zones(scene.name, tuple(tuple(few(there)) for there in found), carriage)


def nothing() -> Zones:
    """Zones that are never near: what the guard foresees can be asked."""
    return Zones("nothing", ((),) * SECTORS, (FAR_M,) * SECTORS)


def _carriage(sectors: Sequence[Sequence[Rect]]) -> Iterator[float]:
    """Of each sector of the slew angle: least distance of what turns with the slew to any solid."""
    points = np.vstack([surface(box, POINTS_M) for box in shapes.boxes() if box.link != BASE])
    radius, azimuth = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    slack = POINTS_M / math.sqrt(2.0)  # to the points between
    solid = [(k * WIDTH, rect) for k, rects in enumerate(sectors) for rect in rects if not rect.tool_only]
    span = (float(radius.max()), float(points[:, 2].min()), float(points[:, 2].max()))
    near = sorted((_least(rect, *span), a, rect) for a, rect in solid if rect.r0 < radius.max() + 2.0)
    for sector in range(SECTORS):
        least = FAR_M
        for at_least, start, rect in near:
            if at_least >= least:
                break
            # the points may be anywhere in the sector, the solid anywhere in its own
            turn = np.abs(
                (azimuth + (sector + 0.5) * WIDTH - start - WIDTH / 2 + math.pi) % (2 * math.pi) - math.pi
            )
            least = min(least, float(_away(points[:, 2], radius, np.maximum(turn - WIDTH, 0.0), rect).min()))
        yield least - slack


def _least(rect: Rect, radius: float, low: float, high: float) -> float:
    """What a rectangle is away, at least, from all within a radius and from a low to a high height."""
    return math.hypot(max(rect.r0 - radius, 0.0), max(rect.z0 - high, low - rect.z1, 0.0))


def _away(z: np.ndarray, r: np.ndarray, turn: np.ndarray, rect: Rect) -> np.ndarray:
    """Distance of points at radius r and height z to a rectangle's sector, which is `turn` away."""
    nearest = np.clip(r * np.cos(turn), rect.r0, rect.r1)
    flat = np.sqrt(np.maximum(r * r + nearest * nearest - 2.0 * r * nearest * np.cos(turn), 0.0))
    return np.hypot(flat, np.maximum(np.maximum(rect.z0 - z, z - rect.z1), 0.0))


def balls() -> list[tuple[int, float, float]]:
    """(part, place, radius) of the balls that cover boom, stick, lines and grab: SlrBall."""
    p = shapes.sizes()
    radius = {capsule.name: capsule.radius for capsule in shapes.capsules(p)}
    depth, half = p["tool_length"], p["grab_half_height"]
    grab = math.hypot(radius["grab"], half / 2)  # the nearest to most things is the first
    found = [(PARTS.index("grab"), depth + k * half, grab) for k in (1, 0, -1)]
    # what is above these hangs in the stick's last ball, what is below in the grab's
    found.append((PARTS.index("lines"), 0.4 * depth, math.hypot(radius["lines"], depth / 4)))
    for name, count in COVERED.items():
        ball = math.hypot(radius[name], p[f"{name}_length"] / (count - 1) / 2)
        found += [(PARTS.index(name), k / (count - 1), ball) for k in range(count)]
    return found


def names() -> set[str]:
    """The guard's parameters."""
    return set(parameters.load(FILE))


def constants(changes: Mapping[str, float]) -> dict[str, float]:
    """Values of specs/parameters/guard.toml, some changed; InputError for a wrong one."""
    for name, value in changes.items():
        parameters.parameter(name, FILE).check(value)
    return {name: changes.get(name, p.value) for name, p in parameters.load(FILE).items()}


def guard_c(found: Zones | None, c: Mapping[str, float]) -> str:
    """`guard_config.c`: bounds, body and zones of the guard."""
    return (
        '/* What the guard knows, generated. */\n#include "slr.h"\n\n'
        f"const SlrGuardLimits slr_guard_limits = {_limits(c)};\n"
        f"const SlrGuardBody slr_guard_body = {_body()};\n{_zones(found)}"
    )


ONE = (  # fields of SlrGuardLimits with one value
    *("clearance", "angle_error", "dead_band", "push", "brake", "push_time", "creep"),
    *("swing_time", "swing_error", "swing_slew", "swing_arm", "swing_most"),
)
EACH = ("dead_time", "settle", "give")  # with one for each axis
ARM = ("rate_error", "speed", "top")  # with one for the slew, one for boom and stick


def _limits(c: Mapping[str, float]) -> str:
    def values(name: str, axes: Iterable[str]) -> str:
        return f".{name} = {_list(repr(c[f'guard_{name}_{axis}']) for axis in axes)}"

    fields = [f".{name} = {c[f'guard_{name}']!r}" for name in ONE]
    fields += [values(name, ("slew", "boom", "stick")) for name in EACH]
    fields += [values(name, ("slew", "arm", "arm")) for name in ARM]
    fields += [f".kick = {{0.0, {c['guard_kick_boom']!r}, {c['guard_kick_stick']!r}}}"]
    return f"{{{', '.join(fields)}}}"


def _body() -> str:
    p = kinematics.geometry()
    each = [f"{{{part}, 0, {at!r}, {radius!r}}}" for part, at, radius in balls()]
    return (
        f"{{.foot = {{{p.boom_foot_x!r}, {p.boom_foot_z!r}}}, .stick = {p.stick_length!r}, "
        f".balls = {len(each)},\n  .ball = {{{', '.join(each)}}}}}"
    )


def _zones(found: Zones | None) -> str:
    if found is None:
        return "const SlrZones *const slr_zones = 0;\n"
    rows = ",\n    ".join(_list(map(_rect, rects)) if rects else "{{{0}}}" for rects in found.sectors)
    return (
        f"static const SlrZones zones = {{\n  .count = {_list(str(len(r)) for r in found.sectors)},\n"
        f"  .rect = {{{rows}}},\n  .carriage = {_list(map(repr, found.carriage))}}};\n"
        "const SlrZones *const slr_zones = &zones;\n"
    )


def _rect(r: Rect) -> str:
    return f"{{{{{r.r0!r}, {r.r1!r}}}, {{{r.z0!r}, {r.z1!r}}}, {int(r.tool_only)}, 0}}"


def _list(values: Iterable[object]) -> str:
    return f"{{{', '.join(map(str, values))}}}"


POSE_C = (  # around `pose`
    "\nvoid slr_guard_pose(double boom, double stick, SlrGuardPose *pose) {\n"
    "  const double *arg[] = {&boom, &stick};\n"
    "  double *res[] = {pose->knee, pose->tip, &pose->least, &pose->most};\n"
    "  slr_guard_pose_f(arg, res, 0, 0, 0);\n}\n"
)


def pose() -> ca.Function:
    """(boom, stick) -> knee, tip (radius, height each), inertia empty and with the largest load."""
    p, known = kinematics.geometry(), parameters.load("geometry")
    boom, stick = ca.SX.sym("boom"), ca.SX.sym("stick")
    knee = ca.vertcat(
        p.boom_foot_x + p.boom_length * ca.cos(boom), p.boom_foot_z + p.boom_length * ca.sin(boom)
    )
    tip = ca.vertcat(*kinematics.arm_tip(boom, stick, p))
    inertia = [kinematics.inertia_z(boom, stick, load, p) for load in (0.0, known["load_mass"].max or 0.0)]
    return ca.Function("slr_guard_pose_f", [boom, stick], [knee, tip, *inertia])
