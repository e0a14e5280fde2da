"""The supervisor between whatever wants to move the machine and the machine: a pure function of sensors.

    command, state = supervise(wanted, seen, age_s, state, limits)

once in each command period.  It clips what would leave the limits, and aborts to neutral, for the rest of the
recording, where clipping did not help or the sensors cannot be trusted:

    slew speed   no further joystick in the direction of motion from where the gyroscope's speed, as it will
                 be when the drive follows, is above the limit, until it is well below; abort at ABORT_SPEED
    arm          a reference is taken only if the pose at which the arm comes to rest keeps pose limits and
                 keep-out, or is further inside than the present one; abort outside
    tool         while its swing is too large, and a while after, all commands go to neutral, but slowly: a
                 sudden stop would swing it further; abort at tool_swing_abort_rad
    sensors      abort on silence, a value outside the signal's range, or two sensors that contradict

Neutral is the safe state: the slew's brake closes and the arm's valves hold.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

from fmus.equations import kinematics
from learning.collection.command import NEUTRAL, Command, Sample
from learning.collection.plan import PERIOD_S, Limits, clearance
from specs.parameters import parameter
from specs.signals import signal

ABORT_SPEED = 1.2  # of the limit
ABORT_POSE_RAD = 0.1  # outside the pose limits
CONTRADICTION_RAD_S = 0.35  # between gyroscope and encoder, for silence_s; the encoder is 0.2 s late
SPEED_AHEAD_S = 0.4  # that the slew still accelerates after the joystick has gone back
SLOW_AGAIN = 0.85  # of the speed limit: below it the joystick is given back
EASE = 0.5  # 1/s: share of full command by which it may change while the tool swings
STEP = 1 / 32000  # of the joystick, as it goes over the wire; references in as many steps
GYROSCOPE = "imu_cabin_rate_z"
WATCHED = (
    *(f"{kind}_{joint}" for kind in ("q", "qd") for joint in ("slew", "boom", "stick")),
    *(f"p_slew_{side}" for side in "ab"),
    GYROSCOPE,
    "imu_tool_roll",
    "imu_tool_pitch",
)
SATURATING = ("imu_tool_rate_x", "imu_tool_rate_y")  # beyond their range in a hard swing, which is no fault
# Sensors whose noise never lets them repeat their value to the last digit.
RESTLESS = ("qd_slew", "qd_boom", "qd_stick", GYROSCOPE, "imu_tool_roll", "imu_tool_pitch")


@dataclass(frozen=True)
class State:
    """What the supervisor remembers from period to period; `State()` before the first."""

    told: tuple[Command, ...] = ()  # the last periods' commands
    speed: float | None = None  # of the gyroscope: the encoder's is late
    fast: bool = False  # the speed limit has been near
    rest_s: float = 0.0  # for so long still the tool is given rest
    unchanged_s: tuple[float, ...] = (0.0,) * len(RESTLESS)
    values: tuple[float, ...] = ()
    contradiction_s: float = 0.0
    clipped: tuple[str, ...] = ()  # what was clipped in this period
    aborted: str = ""  # why; empty while all is well


def supervise(
    wanted: Command, seen: Sample, age_s: float, state: State, limits: Limits
) -> tuple[Command, State]:
    """The command that may go to the machine, and the next state.

    `seen` holds the newest value of every signal that is WATCHED or SATURATING, `age_s` is how old it is.
    Once aborted, the command stays neutral.
    """
    state = _remember(seen, state)
    reason = state.aborted or _untrusted(seen, age_s, state, limits) or _outside(seen, limits)
    if not all(math.isfinite(value) for value in wanted):
        reason = reason or "the excitation is not a number"
    if reason:
        return NEUTRAL, replace(state, clipped=(), aborted=reason)
    rest = _rest(seen, state, limits)
    fast = _fast(seen, state, limits)
    command, clipped = _clipped(wanted, seen, replace(state, rest_s=rest, fast=fast), limits)
    told = (*state.told[1 - round(limits.stopping_s / PERIOD_S) :], command)
    return command, replace(state, told=told, speed=seen[GYROSCOPE], fast=fast, rest_s=rest, clipped=clipped)


def _remember(seen: Sample, state: State) -> State:
    """How long each restless sensor has not changed, how long gyroscope and encoder have contradicted."""
    values = tuple(seen.get(name, math.nan) for name in RESTLESS)
    before = state.values or (math.nan,) * len(values)
    same = tuple(
        since + PERIOD_S if now == then else 0.0
        for now, then, since in zip(values, before, state.unchanged_s, strict=True)
    )
    apart = abs(seen.get(GYROSCOPE, math.nan) - seen.get("qd_slew", math.nan)) > CONTRADICTION_RAD_S
    contradiction = state.contradiction_s + PERIOD_S if apart else 0.0
    return replace(state, values=values, unchanged_s=same, contradiction_s=contradiction)


def _untrusted(seen: Sample, age_s: float, state: State, limits: Limits) -> str:
    """Why the sensors cannot be trusted, or nothing."""
    if age_s > limits.silence_s:
        return f"no sensor value for {age_s:.2g} s"
    for name in WATCHED:
        low, high = _range(name)
        if name not in seen or not low <= seen[name] <= high:
            return f"{name} = {seen.get(name, math.nan):.4g} is outside {low:g} … {high:g}"
    for name in SATURATING:
        if not math.isfinite(seen.get(name, math.nan)):
            return f"{name} is not a number"
    for name, since in zip(RESTLESS, state.unchanged_s, strict=True):
        if since >= limits.silence_s - 1e-9:
            return f"{name} has not changed for {since:.2g} s"
    if state.contradiction_s >= limits.silence_s - 1e-9:
        return "cabin gyroscope and slew encoder contradict each other"
    return ""


def _outside(seen: Sample, limits: Limits) -> str:
    """Which limit is broken so far that only neutral is left, or nothing."""
    speed = max(seen["qd_slew"], seen[GYROSCOPE], key=abs)
    if abs(speed) > ABORT_SPEED * limits.slew_speed_rad_s:
        return f"slew speed {speed:.3f} rad/s"
    swing = _swing(seen)
    if swing > limits.tool_swing_abort_rad:
        return f"tool swing {swing:.2f} rad"
    boom, stick = seen["q_boom"], seen["q_stick"]
    if min(_room(boom, stick, limits)) < -ABORT_POSE_RAD:
        return f"arm pose boom {boom:.3f}, stick {stick:.3f} rad"
    height, radius = clearance(boom, stick)
    if height < 0.0 or radius < 0.0:
        return f"keep-out: grab {height:.2f} m above, {radius:.2f} m outside"
    return ""


def _rest(seen: Sample, state: State, limits: Limits) -> float:
    if _amplitude(seen) > limits.tool_swing_rad:
        return limits.rest_s
    return max(0.0, state.rest_s - PERIOD_S)


def _fast(seen: Sample, state: State, limits: Limits) -> bool:
    """Whether the slew is, or in a moment will be, too fast; or was, and is not yet slow again."""
    speed = seen[GYROSCOPE]
    acceleration = 0.0 if state.speed is None else (speed - state.speed) / PERIOD_S
    ahead = max(abs(speed + acceleration * SPEED_AHEAD_S), abs(seen["qd_slew"]))
    return ahead > limits.slew_speed_rad_s or (
        state.fast and abs(speed) > SLOW_AGAIN * limits.slew_speed_rad_s
    )


def _clipped(wanted: Command, seen: Sample, state: State, limits: Limits) -> tuple[Command, tuple[str, ...]]:
    reasons = []
    top = parameter("arm_velocity_limit", "arm_velocity").value
    if state.rest_s > 0.0:
        last = state.told[-1] if state.told else NEUTRAL
        wanted = Command(
            *(_towards_neutral(now, full) for now, full in zip(last, (1.0, top, top), strict=True))
        )
        reasons.append("tool swing")
    u = _rounded(wanted.u_slew, 1.0)
    if state.fast and u * seen[GYROSCOPE] > 0.0:
        u = 0.0
        reasons.append("slew speed")
    asked = (_rounded(wanted.qd_boom_ref, top), _rounded(wanted.qd_stick_ref, top))
    taken = _arm(asked, seen, state, limits)
    if taken != asked:
        reasons.append("arm")
    return Command(u, *taken), tuple(reasons)


def _towards_neutral(now: float, full: float) -> float:
    return math.copysign(max(0.0, abs(now) - EASE * PERIOD_S * full), now)


def _arm(asked: tuple[float, float], seen: Sample, state: State, limits: Limits) -> tuple[float, float]:
    """Both references, one of them or none: the first choice after which the arm comes to rest inside.

    It comes to rest where it stands, plus what it has not followed yet: of the last stopping_s any part may
    be done already, and with each the limits must be kept.
    """
    pitch, count = seen["imu_tool_pitch"], round(limits.stopping_s / PERIOD_S)
    now = _inside(seen["q_boom"], seen["q_stick"], pitch, limits)
    pending = [[told[joint] for joint in (1, 2)] for told in state.told[-count:]]
    boom, stick = asked
    for choice in ((boom, stick), (boom, 0.0), (0.0, stick)):
        rest, kept = [seen["q_boom"], seen["q_stick"]], True
        for told in (choice, *reversed(pending)):
            rest = [q + PERIOD_S * rate for q, rate in zip(rest, told, strict=True)]
            then = _inside(rest[0], rest[1], pitch, limits)
            kept = kept and all(t >= 0.0 or t > n for t, n in zip(then, now, strict=True))
        if kept:
            return choice
    return 0.0, 0.0


def _inside(boom: float, stick: float, pitch: float, limits: Limits) -> Sequence[float]:
    """How far a pose is inside each limit (rad or m); below 0: outside."""
    return [*_room(boom, stick, limits), *(clearance(boom, stick, pitch) - limits.keepout_margin_m)]


def _room(boom: float, stick: float, limits: Limits) -> tuple[float, float, float, float]:
    """How far a pose is inside the pose limits, rad."""
    (least, most), (low, high) = limits.boom_rad, limits.stick_rad
    return boom - least, most - boom, stick - low, high - stick


def _swing(seen: Sample) -> float:
    """Larger one of the tool's two angles, rad."""
    return max(abs(seen["imu_tool_roll"]), abs(seen["imu_tool_pitch"]))


def _amplitude(seen: Sample) -> float:
    """Where the larger of the two swings will have its end, from angle and rate, rad."""
    g = kinematics.geometry()
    natural = math.sqrt(g.gravity / g.tool_length)
    return max(
        math.hypot(seen[f"imu_tool_{angle}"], seen[f"imu_tool_rate_{axis}"] / natural)
        for angle, axis in (("roll", "x"), ("pitch", "y"))
    )


def _rounded(value: float, limit: float) -> float:
    """Clipped to +-limit and rounded to what goes over the wire."""
    return round(max(-1.0, min(1.0, value / limit)) / STEP) * STEP * limit


@cache
def _range(name: str) -> tuple[float, float]:
    found = signal(name)
    return (
        -math.inf if found.min is None else found.min,
        math.inf if found.max is None else found.max,
    )
