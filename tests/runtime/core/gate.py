"""The gate's C code compiled alone, and what gate.h promises, written down a second time."""

import ctypes
import math
import random
from collections.abc import Sequence
from pathlib import Path

from fmus.toolchain import compiler

CORE = Path(__file__).parents[3] / "runtime" / "core"
AXES = 3
KEEP_OUT, WALLS = 2, 6  # the first two walls are the keep-out
GUARD = 0.77  # behind the commands
SLACK = 1e-12  # of a difference of two rounded numbers
VISIBLE = "-fvisibility=default"
NOTHING = float("nan")


class Wall(ctypes.Structure):
    _fields_ = (
        ("distance", ctypes.c_double),
        ("rate", ctypes.c_double),
        ("gradient", ctypes.c_double * AXES),
    )


class Limits(ctypes.Structure):
    _fields_ = (
        ("range", ctypes.c_double),
        ("creep", ctypes.c_double),
        ("rise", ctypes.c_double),
        ("fall", ctypes.c_double),
        ("speed", ctypes.c_double * AXES),
        ("ahead", ctypes.c_double),
        ("zone", ctypes.c_double * WALLS),
    )


class View(ctypes.Structure):
    _fields_ = (
        ("move", ctypes.c_int),
        ("by_hand", ctypes.c_int),
        ("known", ctypes.c_int * AXES),
        ("speed", ctypes.c_double * AXES),
        ("walls", Wall * WALLS),
    )


class _Trap(ctypes.Structure):
    """A view with one wall more behind it, which stops everything: who reads past the end is seen."""

    _fields_ = (("view", View), ("behind", Wall))


Commands = Sequence[float]
ZONES = (ctypes.c_double * WALLS)(2.5, 2.5, 0.1, 0.1, 0.1, 0.1)
LIMITS = Limits(1.0, 0.3, 0.2, 0.4, (ctypes.c_double * AXES)(0.85, 0.4, 0.4), 0.6, ZONES)


class Gate:
    """`slr_gate` of a compiled gate.c."""

    def __init__(self, library: Path) -> None:
        self._gate = ctypes.CDLL(str(library)).slr_gate

    def __call__(
        self, limits: Limits, view: View, wanted: Commands, held: Commands
    ) -> tuple[list[float], int]:
        """(commands that pass, whether something was changed)."""
        commands = (ctypes.c_double * (AXES + 1))(*held, GUARD)
        asked = (ctypes.c_double * (AXES + 1))(*wanted, -GUARD)
        changed = self._gate(ctypes.byref(limits), ctypes.byref(view), asked, commands)
        assert commands[AXES] == GUARD, "nothing behind the last axis is written"
        return list(commands)[:AXES], changed


def build(folder: Path, text: str = "", extra: Sequence[str] = ()) -> Path:
    """Compile gate.c (or `text` in its place) in `folder`; the library."""
    host = compiler.host().name
    source = folder / "gate.c"
    source.write_text(text or (CORE / "gate.c").read_text())
    made = compiler.compile_object(source, folder / "gate.o", host, [VISIBLE, "-I", str(CORE), *extra])
    return compiler.link_shared([made], folder / "gate.so", host, list(extra))


def view(move: int = 1, by_hand: int = 0, known: Sequence[int] = (1, 1, 1), **more: Commands) -> View:
    """A view far from every wall and at rest; `speed` of the axes may be given."""
    stop = Wall(-1.0, 0.0, (ctypes.c_double * AXES)(1.0, -1.0, 1.0))
    found = _Trap(View(move, by_hand, (ctypes.c_int * AXES)(*known)), stop).view
    found.speed = (ctypes.c_double * AXES)(*more.get("speed", (0.0,) * AXES))
    for wall in found.walls:
        wall.distance = 10.0
    return found


def most(limits: Limits, seen: View, axis: int, wanted: float) -> float:
    """How far gate.h lets an axis go the way that is wanted."""
    if not seen.move or not math.isfinite(wanted) or wanted == 0.0:
        return 0.0
    if not seen.known[axis]:
        return limits.creep if seen.by_hand else 0.0
    way = math.copysign(1.0, wanted)
    if seen.speed[axis] * way >= limits.speed[axis]:
        return 0.0
    found = limits.range
    for number, wall in enumerate(seen.walls):
        counts = number >= KEEP_OUT or not seen.by_hand
        if counts and wall.gradient[axis] * way < 0.0:
            left = wall.distance + limits.ahead * min(wall.rate, 0.0)
            found = min(found, limits.range * max(left, 0.0) / limits.zone[number])
    return found


def check(
    limits: Limits, seen: View, wanted: Commands, before: Commands, after: Commands, changed: int
) -> None:
    """Everything that gate.h promises of one call; AssertionError where it does not hold."""
    for axis in range(AXES):
        _check_axis(limits, seen, axis, wanted[axis], before[axis], after[axis])
    assert bool(changed) == any(a != w for a, w in zip(after, wanted, strict=True)), "changed"


def _check_axis(limits: Limits, seen: View, axis: int, wanted: float, before: float, after: float) -> None:
    assert math.isfinite(after), "finite"
    assert abs(after) <= limits.range, "range"
    assert abs(after - before) <= limits.fall + SLACK, "rate"
    away = abs(after) if after * before < 0.0 else abs(after) - abs(before)
    assert away <= limits.rise + SLACK, "rate away from neutral"
    limit = most(limits, seen, axis, wanted)
    if limit == 0.0:
        assert abs(after) == max(abs(before) - limits.fall, 0.0), "straight to neutral"
        assert after * before >= 0.0, "not past neutral"
        return
    aim = min(max(wanted, -limit), limit)
    assert abs(after - aim) <= abs(before - aim), "no farther from what is allowed than before"
    assert after == aim or _as_fast_as_allowed(limits, before, after), "all that is allowed"


def _as_fast_as_allowed(limits: Limits, before: float, after: float) -> bool:
    if after * before < 0.0:
        return math.isclose(abs(after), limits.rise) or math.isclose(abs(after - before), limits.fall)
    change = limits.fall if abs(after) < abs(before) else limits.rise
    return math.isclose(abs(after - before), change, abs_tol=SLACK)


VALUES = (0.0, -0.0, 1.0, -1.0, 1e-300, 1e308, -1e308, math.inf, -math.inf, math.nan, 0.3, -0.3, 0.1, -0.25)


def random_case(draw: random.Random) -> tuple[View, list[float], list[float]]:
    """A view, wanted and held commands in which every rule of the gate takes part now and then."""
    seen = view(int(draw.random() < 0.85), int(draw.random() < 0.4))
    for axis in range(AXES):
        seen.known[axis] = int(draw.random() < 0.8)
        seen.speed[axis] = draw.choice((0.0, *LIMITS.speed, *(-s for s in LIMITS.speed), 0.2, -2.0))
    for wall in seen.walls:
        wall.distance = draw.choice((5.0, 5.0, 5.0, 1.0, 0.3, 0.06, 0.04, 0.0, -0.5))
        wall.rate = draw.choice((0.0, -0.1, -0.5, 0.5))
        for axis in range(AXES):
            wall.gradient[axis] = draw.choice((0.0, 1.0, -3.0, 0.05))
    wanted = [
        float(draw.choice(VALUES) if draw.random() < 0.5 else draw.uniform(-1.5, 1.5)) for _ in range(3)
    ]
    held = [float(draw.choice((0.0, 0.05, -0.1, 1.0, -1.0, draw.uniform(-1, 1)))) for _ in range(3)]
    return seen, wanted, held


def check_all(gate: Gate, cases: int, seed: int = 1) -> None:
    """Many random calls."""
    draw = random.Random(seed)
    for _ in range(cases):
        seen, wanted, held = random_case(draw)
        check(LIMITS, seen, wanted, held, *gate(LIMITS, seen, wanted, held))
