"""The guard's C code compiled alone, and what guard.h says, written down a second time."""

import ctypes
import math
import random
from collections.abc import Sequence
from pathlib import Path

from fmus.paths import SHIM
from fmus.toolchain import compiler
from tests.runtime.core.gate import CORE, VISIBLE

AXES, SENT, BACK, SECTORS, RECTS, BALLS = 3, 20, 5, 240, 8, 36
NONE, BOOM, STICK, LINES, GRAB, CARRIAGE = range(6)
TICK_S, ALONE, EQUAL = 0.02, 1e3, 0.005
FREE = 40.0  # carriage with nothing around
WIDTH = 2.0 * math.pi / SECTORS
TRIES = ((1, 0.5), (1, 0.25), (0.5, 0.5), (0.5, 0.25), (1, 0), (0.25, 0.25), (0.5, 0), (0, 0.5), (0, 0.25))
D, Three = ctypes.c_double, ctypes.c_double * AXES
Two = D * 2


class Rect(ctypes.Structure):
    _fields_ = (("r", Two), ("z", Two), ("tool_only", ctypes.c_int32), ("unused", ctypes.c_int32))


class Zones(ctypes.Structure):
    _fields_ = (
        ("count", ctypes.c_int32 * SECTORS),
        ("rect", Rect * RECTS * SECTORS),
        ("carriage", D * SECTORS),
    )


class Ball(ctypes.Structure):
    _fields_ = (("part", ctypes.c_int32), ("unused", ctypes.c_int32), ("at", D), ("radius", D))


class Body(ctypes.Structure):
    _fields_ = (
        ("foot", Two),
        ("stick", D),
        ("balls", ctypes.c_int32),
        ("unused", ctypes.c_int32),
        ("ball", Ball * BALLS),
    )


class Limits(ctypes.Structure):
    _fields_ = (
        ("clearance", D), ("angle_error", D), ("rate_error", Three), ("dead_time", Three), ("settle", Three),
        ("give", Three), ("kick", Three), ("dead_band", D), ("speed", Three), ("top", Three), ("push", D),
        ("brake", D), ("push_time", D), ("creep", D), ("swing_time", D), ("swing_error", D),
        ("swing_slew", D), ("swing_arm", D), ("swing_most", D),
    )  # fmt: skip


class View(ctypes.Structure):
    _fields_ = (("angle", Three), ("slew_rate", D), ("swing", Two), ("swing_rate", Two))


class Past(ctypes.Structure):
    _fields_ = (("sent", D * SENT * AXES), ("angle", D * BACK * 2), ("known", ctypes.c_int64))


class Sweep(ctypes.Structure):
    _fields_ = (("lo", Three), ("hi", Three), ("swing", D))


BOOM_M, STICK_M, FOOT = 10.0, 7.0, (1.5, 2.5)
POSE = f"""
#include "guard.h"
#include "slw_math.h"
void slr_guard_pose(double boom, double stick, SlrGuardPose *p) {{
  p->knee[0] = {FOOT[0]} + {BOOM_M} * slw_cos(boom);
  p->knee[1] = {FOOT[1]} + {BOOM_M} * slw_sin(boom);
  p->tip[0] = p->knee[0] + {STICK_M} * slw_cos(boom + stick);
  p->tip[1] = p->knee[1] + {STICK_M} * slw_sin(boom + stick);
  p->least = 2e5 + 3e3 * p->tip[0] * p->tip[0]; p->most = 1.5 * p->least;
}}
"""
LIMITS = Limits(
    0.25, 0.005, Three(0.02, 0.02, 0.03), Three(1.4, 0.5, 0.45), Three(0.005, 0.012, 0.013),
    Three(0.15, 0.07, 0.12), Three(0.0, 0.05, 0.5), 0.08, Three(1.1, 0.6, 0.65), Three(1.0, 0.5, 0.45), 2e5,
    1e5, 0.5, 0.3, 0.51, 0.09, 0.11, 0.17, 1.42,
)  # fmt: skip
PARTS = (
    *((GRAB, 2.2, 0.8), (GRAB, 1.8, 0.85), (LINES, 0.8, 0.5)),
    *((part, k / 5, 0.6 + 0.01 * k) for part in (BOOM, STICK) for k in range(6)),
)
BODY = Body(Two(*FOOT), STICK_M, len(PARTS), 0, (Ball * BALLS)(*(Ball(p, 0, at, r) for p, at, r in PARTS)))


def build(folder: Path, text: str = "", extra: Sequence[str] = ()) -> Path:
    """Compile guard.c (or `text` in its place) with a pose of its own in `folder`; the library."""
    host = compiler.host().name
    made = []
    for name, code in (("guard.c", text or (CORE / "guard.c").read_text()), ("pose.c", POSE)):
        (folder / name).write_text(code)
        flags = [VISIBLE, "-I", str(CORE), "-I", str(SHIM), *extra]
        made.append(compiler.compile_object(folder / name, folder / f"{name}.o", host, flags))
    return compiler.link_shared(made, folder / "guard.so", host, list(extra))


class Guard:
    """The functions of a compiled guard.c."""

    def __init__(self, library: Path) -> None:
        self.library = ctypes.CDLL(str(library))
        self.library.slr_guard_room.restype = D

    def __call__(
        self, zones: Zones, view: View, past: Past, wanted: Sequence[float]
    ) -> tuple[list[float], int]:
        """(commands that pass, part)."""
        commands = (D * (AXES + 1))(*wanted, 0.77)
        refs = (ctypes.byref(x) for x in (LIMITS, BODY, zones, view, past))
        part = self.library.slr_guard(*refs, commands)
        assert commands[AXES] == 0.77, "nothing behind the last axis is written"
        return list(commands)[:AXES], part

    def foresee(self, view: View, past: Past, commands: Sequence[float]) -> Sweep:
        """Its sweep."""
        found = Sweep()
        refs = (ctypes.byref(x) for x in (LIMITS, BODY, view, past))
        self.library.slr_guard_foresee(*refs, Three(*commands), ctypes.byref(found))
        return found

    def room(self, zones: Zones, sweep: Sweep, enough: float = -ALONE) -> tuple[float, int]:
        """(room, part)."""
        part = ctypes.c_int(-1)
        refs = (ctypes.byref(x) for x in (LIMITS, BODY, zones, sweep))
        return self.library.slr_guard_room(*refs, D(enough), ctypes.byref(part)), part.value

    def remember(self, past: Past, view: View, usable: int, sent: Sequence[float]) -> None:
        """One tick more."""
        self.library.slr_guard_remember(ctypes.byref(past), ctypes.byref(view), usable, Three(*sent))


# ---- said again ----


def knee_and_tip(boom: float, stick: float) -> tuple[complex, complex]:
    """Radius and height as one complex number each."""
    knee = complex(*FOOT) + BOOM_M * complex(math.cos(boom), math.sin(boom))
    return knee, knee + STICK_M * complex(math.cos(boom + stick), math.sin(boom + stick))


def peaks(view: View, past: Past, commands: Sequence[float]) -> list[list[float]]:
    """Largest speeds of each axis, backwards and forwards."""
    limits, found = LIMITS, []
    _, tip = knee_and_tip(view.angle[1], view.angle[2])
    for axis in range(AXES):
        both = []
        for way in (-1.0, 1.0):
            command = max(0.0, way * commands[axis], *(way * past.sent[axis][k] for k in range(SENT)))
            steady = min(limits.speed[axis] * max(command - limits.dead_band, 0.0), limits.top[axis])
            if axis == 0:
                rate = way * view.slew_rate + limits.rate_error[0]
                pushed = min(steady, rate + limits.push_time * limits.push / (2e5 + 3e3 * tip.real**2))
                both.append(max(rate, pushed, 0.0))
            else:
                gone = view.angle[axis] - past.angle[axis - 1][BACK - 1]
                rate = way * gone / (BACK * TICK_S) + limits.rate_error[axis]
                both.append(max(rate if past.known >= BACK else limits.top[axis], steady, 0.0))
        found.append(both)
    return found


def measured_swing(view: View) -> float:
    """Of the tool now."""
    rate = LIMITS.swing_time * math.hypot(*view.swing_rate)
    return math.hypot(*view.swing, rate) + LIMITS.swing_error


def foreseen(view: View, past: Past, commands: Sequence[float]) -> tuple[list[float], list[float], float]:
    """lo, hi, swing."""
    limits, speed = LIMITS, peaks(view, past, commands)
    _, tip = knee_and_tip(view.angle[1], view.angle[2])
    reach, fast = abs(tip - complex(*FOOT)), [max(both) for both in speed]
    swing = measured_swing(view) + limits.swing_slew * tip.real * fast[0]
    swing = min(swing + limits.swing_arm * (reach * fast[1] + STICK_M * fast[2]), limits.swing_most)
    ways = []
    for axis, both in enumerate(speed):
        more = limits.angle_error + limits.settle[axis] + limits.give[axis] * swing
        other = (0.0, fast[2], fast[1])[axis] * limits.kick[axis]
        inertia = 1.5 * (2e5 + 3e3 * tip.real**2)
        brakes = [p * p * inertia / (2.0 * limits.brake) if axis == 0 else other for p in both]
        ways.append([p * limits.dead_time[axis] + b + more for p, b in zip(both, brakes, strict=True)])
    lo = [view.angle[axis] - ways[axis][0] for axis in range(AXES)]
    return lo, [view.angle[axis] + ways[axis][1] for axis in range(AXES)], swing


Placed = tuple[int, complex, float, float, float, float]


def placed(lo: Sequence[float], hi: Sequence[float], swing: float) -> list[Placed]:
    """(part, place, moves, swings, rises, radius) of each ball at the middle of a sweep."""
    knee, tip = knee_and_tip((lo[1] + hi[1]) / 2, (lo[2] + hi[2]) / 2)
    foot, found = complex(*FOOT), []
    for part, at, radius in PARTS:
        hangs = part in (LINES, GRAB)
        share, below = (1.0, at) if hangs else (at, 0.0)
        spot = foot + share * (knee - foot) if part == BOOM else knee + share * (tip - knee)
        moves = (hi[1] - lo[1]) / 2 * abs(spot - foot)
        moves += 0.0 if part == BOOM else share * STICK_M * (hi[2] - lo[2]) / 2
        found.append(
            (part, spot - 1j * below, moves, below * min(swing, 1.0), below * min(swing**2 / 2, 1.0), radius)
        )
    return found


def room(zones: Zones, lo: Sequence[float], hi: Sequence[float], swing: float) -> float:
    """The least room, over all sectors and balls."""
    least, high = FREE - LIMITS.clearance, min(hi[0], lo[0] + 2.0 * math.pi)
    balls = placed(lo, hi, swing)
    near = [radius + LIMITS.clearance + moves for _, _, moves, _, _, radius in balls]
    sides = [
        (min(b[1].real - n - b[3] for b, n in zip(balls, near, strict=True)),
         max(b[1].real + n + b[3] for b, n in zip(balls, near, strict=True))),
        (min(b[1].imag - n for b, n in zip(balls, near, strict=True)),
         max(b[1].imag + n + b[4] for b, n in zip(balls, near, strict=True))),
    ]  # fmt: skip
    for sector in range(SECTORS):
        if not zones.count[sector] and zones.carriage[sector] == FREE:
            continue
        starts = (sector * WIDTH + turn * 2.0 * math.pi for turn in range(-3, 4))
        gap = min(max(lo[0] - (start + WIDTH), start - high, 0.0) for start in starts)
        if gap <= 0.0:
            least = min(least, zones.carriage[sector] - LIMITS.clearance)
        for rect in list(zones.rect[sector])[: zones.count[sector]]:
            ranges = zip((rect.r, rect.z), sides, strict=True)
            if not any(side[1] < own[0] or own[1] < side[0] for side, own in ranges):
                least = min(least, *(_ball_room(ball, rect, gap) for ball in balls))
    return least


def _ball_room(ball: Placed, rect: Rect, gap: float) -> float:
    part, place, moves, swings, rises, radius = ball
    wide = radius + LIMITS.clearance + moves + swings
    sine = wide / place.real if place.real else 2.0
    within = math.pi if not wide < place.real else sine + (math.pi / 2 - 1.0) * sine**3
    if gap > within or (rect.tool_only and part not in (LINES, GRAB)):
        return ALONE
    r = max(rect.r[0] - (place.real + moves + swings), place.real - moves - swings - rect.r[1])
    z = max(rect.z[0] - (place.imag + moves + rises), place.imag - moves - rect.z[1])
    away = math.hypot(r, z) if min(r, z) > 0.0 else max(r, z)
    return away - radius - LIMITS.clearance


def still(view: View) -> tuple[View, Past]:
    """Standing here, with nothing sent."""
    here, past = View.from_buffer_copy(view), Past(known=BACK)
    here.slew_rate = 0.0
    for joint in range(2):
        past.angle[joint][BACK - 1] = view.angle[1 + joint]
    return here, past


def said(zones: Zones, view: View, past: Past, wanted: Sequence[float]) -> list[float]:
    """The commands that guard.h lets through."""

    def after(commands: Sequence[float]) -> float:
        return room(zones, *foreseen(view, past, commands))

    if after(wanted) >= 0.0:
        return list(wanted)
    for slew, arm in TRIES:
        less = [max(-1.0, min(1.0, share * w)) for share, w in zip((slew, arm, arm), wanted, strict=True)]
        if after(less) >= 0.0:
            return less
    here, allowed = room(zones, *_as_it_is(*still(view), (0.0, 0.0, 0.0))), [0.0, 0.0, 0.0]
    for axis in range(AXES):
        allowed[axis] = max(-LIMITS.creep, min(LIMITS.creep, wanted[axis]))
        if room(zones, *_as_it_is(view, past, allowed)) < here - EQUAL:
            allowed[axis] = 0.0
    return allowed


def _as_it_is(view: View, past: Past, commands: Sequence[float]) -> tuple[list[float], list[float], float]:
    lo, hi, _ = foreseen(view, past, commands)
    return lo, hi, measured_swing(view)


def random_zones(draw: random.Random, view: View) -> Zones:
    """A few things in a few sectors, most of them near the tool: where the margins end."""
    _, tip = knee_and_tip(view.angle[1], view.angle[2])
    found = Zones()
    found.carriage = (D * SECTORS)(*(draw.choice((FREE,) * 2000 + (1.0, 0.1)) for _ in range(SECTORS)))
    for _ in range(draw.choice((0, 1, 1, 1, 2, 12))):
        first, count = draw.randrange(SECTORS), draw.choice((1, 2, 12))
        r, z, tool_only = draw.uniform(3.0, 18.0), draw.uniform(0.0, 12.0), int(draw.random() < 0.3)
        if draw.random() < 0.7:
            first = math.floor((view.angle[0] + draw.uniform(-1.5, 1.5)) / WIDTH) % SECTORS
            r, z = tip.real + draw.uniform(-6.0, 6.0), tip.imag + draw.uniform(-7.0, 4.0)
        for k in range(count):
            sector = (first + k) % SECTORS
            if found.count[sector] < RECTS:
                size = draw.choice((0.2, 1.0, 4.0))
                rect = Rect(Two(r, r + size), Two(max(z - size, 0.0), z), tool_only, 0)
                found.rect[sector][found.count[sector]] = rect
                found.count[sector] += 1
    return found


def random_case(draw: random.Random) -> tuple[Zones, View, Past, list[float]]:
    """Zones, a state and commands in which every rule of the guard takes part now and then."""
    fast = draw.choice((0.0, 0.0, 0.02, 0.3))
    angle = (draw.uniform(-9.0, 9.0), draw.uniform(0.6, 1.5), draw.uniform(-2.4, -0.15))
    view = View(
        Three(*angle), draw.uniform(-2, 2) * fast, Two(*(draw.uniform(-1, 1) * fast for _ in range(2))),
        Two(*(draw.uniform(-3, 3) * fast for _ in range(2))),
    )  # fmt: skip
    past = Past(known=draw.choice((BACK, BACK, BACK, BACK, 0, BACK - 1)))
    for joint in range(2):
        rate = draw.uniform(-1, 1) * fast
        for k in range(BACK):
            past.angle[joint][k] = view.angle[1 + joint] - (k + 1) * TICK_S * rate
    for axis in range(AXES):
        held = draw.choice((0.0, 0.0, 0.1, -0.4, 1.0))
        for k in range(SENT):
            past.sent[axis][k] = held * draw.choice((0.0, 1.0)) if draw.random() < 0.5 else 0.0
    wanted = [draw.choice((0.0, 1.0, -1.0, 0.25, -0.25, 0.05, draw.uniform(-1.2, 1.2))) for _ in range(AXES)]
    return random_zones(draw, view), view, past, wanted


def check(guard: Guard, zones: Zones, view: View, past: Past, wanted: Sequence[float]) -> None:
    """Everything that guard.h says of one call; AssertionError where it does not hold."""
    sweep, (lo, hi, swing) = guard.foresee(view, past, wanted), foreseen(view, past, wanted)
    for name, mine in (("lo", lo), ("hi", hi)):
        for a, b in zip(getattr(sweep, name), mine, strict=True):
            assert math.isclose(a, b, abs_tol=1e-9), name
    assert math.isclose(sweep.swing, swing, abs_tol=1e-9), "swing"
    least = room(zones, lo, hi, swing)
    found, part = guard.room(zones, sweep)
    assert math.isclose(found, least, abs_tol=1e-9), "room"
    assert BOOM <= part <= CARRIAGE, "part of the room"
    passed, part = guard(zones, view, past, wanted)
    assert passed == said(zones, view, past, wanted), "commands"
    assert (part == NONE) == (least >= 0.0), "says when it steps in"
    assert part or passed == list(wanted), "bit for bit"
    early, _ = guard.room(zones, sweep, 0.0)
    assert (early >= 0.0) == (least >= 0.0), "early"


def check_lesser(guard: Guard, draw: random.Random, cases: int) -> None:
    """Cases in which a lesser command passes, found by asking the guard itself."""
    seen = set[tuple[float, ...]]()
    for _ in range(50 * cases):
        case = random_case(draw)
        passed, part = guard(*case)
        shares = tuple(round(p / w, 1) if w else 0.0 for p, w in zip(passed, case[3], strict=True))
        if part and any(passed) and shares not in seen:
            seen.add(shares)
            check(guard, *case)


def check_rooms(guard: Guard, draw: random.Random, cases: int) -> None:
    """The room before one thing in one sector, at the edge of one ball's margins, for all balls in turn."""
    for number in range(cases):
        lo = [draw.uniform(-4.0, 4.0), draw.uniform(0.6, 1.4), draw.uniform(-2.4, -0.3)]
        hi = [a + draw.choice((0.0, 0.02, 0.3)) for a in lo]
        swing = draw.choice((0.0, 0.1, 0.6, 1.42))
        part, place, moves, swings, rises, radius = placed(lo, hi, swing)[number % len(PARTS)]
        zones = Zones(carriage=(D * SECTORS)(*(FREE,) * SECTORS))
        aside = draw.choice((0.0, draw.uniform(0.0, 1.2))) * draw.choice((-1.0, 1.0))
        sector = (
            math.floor((lo[0] + aside * (radius + moves + swings) / max(place.real, 1.0)) / WIDTH) % SECTORS
        )
        away = radius + LIMITS.clearance + moves
        r = place.real + draw.choice((-1.0, 0.0, 1.0)) * (away + swings) * draw.uniform(0.9, 1.02)
        z = place.imag + draw.choice((-1.0, 0.0, 1.0)) * (away + rises) * draw.uniform(0.9, 1.02)
        size = draw.choice((0.01, 0.5))
        zones.count[sector] = 1
        ends = (
            (Two(r, r + size), Two(z, z + size))
            if draw.random() < 0.5
            else (Two(r - size, r), Two(z - size, z))
        )
        zones.rect[sector][0] = Rect(*ends, int(part in (LINES, GRAB) and draw.random() < 0.5), 0)
        sweep, mine = Sweep(Three(*lo), Three(*hi), swing), room(zones, lo, hi, swing)
        found, _ = guard.room(zones, sweep)
        assert math.isclose(found, mine, abs_tol=1e-9), "room before one thing"


def check_past(guard: Guard, draw: random.Random) -> None:
    """That it remembers what was sent and where the arm was, newest first."""
    past, sent, angles, known = Past(), list[list[float]](), list[list[float]](), 0
    for _ in range(SENT + 3):
        commands, usable = [draw.uniform(-1, 1) for _ in range(AXES)], int(draw.random() < 0.9)
        view = View(Three(*(draw.uniform(-1, 1) for _ in range(AXES))))
        guard.remember(past, view, usable, commands)
        sent.insert(0, commands)
        angles.insert(0, list(view.angle))
        known = min(known + 1, BACK) if usable else 0
        assert past.known == known, "known"
        for k in range(min(SENT, len(sent))):
            assert [past.sent[axis][k] for axis in range(AXES)] == sent[k], "sent"
        for k in range(min(BACK, len(angles))):
            assert [past.angle[joint][k] for joint in range(2)] == angles[k][1:], "angle"


def check_all(guard: Guard, cases: int, seed: int = 1) -> None:
    """Many random calls."""
    draw = random.Random(seed)
    for _ in range(cases):
        check(guard, *random_case(draw))
    check_lesser(guard, draw, cases)
    check_rooms(guard, draw, 20 * cases)
    check_past(guard, draw)
