"""Excitation that needs no feedback: joystick of the slew and arm velocity references, 10 values a second.

    steps               a random level for a random time, often through neutral, both directions
    sines               a few periods of one amplitude and period, then others
    trapezoids          up, hold, down, rest; the other way; amplitudes and times drawn anew each time
    random_references   random levels with random ramps on slew, boom and stick at once

Each begins with LEAD_S of neutral, so that the machine is seen at rest with a full history.
"""

from collections.abc import Callable

import numpy as np

from learning.collection.draws import Draws
from learning.collection.plan import PERIOD_S, PLAN_COMMANDS, Limits, Part, Recording
from specs.parameters import parameter

LEAD_S = 1.0
ANYWHERE = (-np.inf, np.inf)
ARM = (0.1, 1.0)  # of the largest arm reference
RAMP_S = (0.0, 1.5)
ARM_RAMP_S = (1.0, 2.5)  # about the tool's period: an arm that starts or stops at once throws it
Range = tuple[float, float]


def wanted(part: Part, recording: Recording, limits: Limits, seed: int) -> np.ndarray:
    """Commands (u_slew, qd_boom_ref, qd_stick_ref) [n, 3] of every command period, before the supervisor."""
    draws = recording.draws(seed, "excitation")
    n = recording.periods
    found = np.zeros((n, 3))
    lead = round(LEAD_S / PERIOD_S)
    found[lead:, 0] = SHAPES[recording.kind](part, draws, n - lead)
    if recording.kind == "random_references":
        top = parameter("arm_velocity_limit", "arm_velocity").value
        poses = ((recording.q_boom, limits.boom_rad), (recording.q_stick, limits.stick_rad))
        for joint, (start, span) in enumerate(poses, 1):
            room = ((span[0] - start) / top, (span[1] - start) / top)
            found[lead:, joint] = top * _random(draws, n - lead, ARM, part.period_s, ARM_RAMP_S, 0.35, room)
    return found


def stated(part: Part, recording: Recording) -> np.ndarray:
    """The commands [n, 3] of a replay."""
    found = np.zeros((recording.periods, len(PLAN_COMMANDS)))
    for i, name in enumerate(PLAN_COMMANDS):
        found[:, i] = (part.commands or {}).get(name, 0.0)  # type: ignore[call-overload]
    return found


def _steps(part: Part, draws: Draws, n: int) -> np.ndarray:
    found: list[float] = []
    while len(found) < n:
        level = draws.sign() * draws.between(*part.amplitude)
        found += [level] * _count(draws.between(*part.period_s))
        if draws.uniform() < 0.6:
            found += [0.0] * _count(draws.between(*part.period_s))
    return np.array(found[:n])


def _sines(part: Part, draws: Draws, n: int) -> np.ndarray:
    found: list[float] = []
    while len(found) < n:
        amplitude, period = draws.sign() * draws.between(*part.amplitude), draws.between(*part.period_s)
        time = PERIOD_S * np.arange(_count(period * (1 + int(3 * draws.uniform()))))
        found += list(amplitude * np.sin(2 * np.pi * time / period))
        found += [0.0] * _count(draws.between(0.2, 2.0))
    return np.array(found[:n])


def _trapezoids(part: Part, draws: Draws, n: int) -> np.ndarray:
    found: list[float] = []
    sign = draws.sign()
    while len(found) < n:
        level, period = sign * draws.between(*part.amplitude), draws.between(*part.period_s)
        up, down = draws.between(0.1, 0.4), draws.between(0.1, 0.4)
        shares = np.linspace(0.0, 1.0, _count(period) + 1)
        found += list(level * np.clip(np.minimum(shares / up, (1.0 - shares) / down), 0.0, 1.0))
        found += [0.0] * _count(draws.between(0.2, 3.0))
        sign = -sign if draws.uniform() < 0.8 else sign
    return np.array(found[:n])


def _random_references(part: Part, draws: Draws, n: int) -> np.ndarray:
    return _random(draws, n, part.amplitude, part.period_s, RAMP_S, 0.25)


def _random(
    draws: Draws,
    n: int,
    amplitude: Range,
    period_s: Range,
    ramp_s: Range,
    rest: float,
    room: Range = ANYWHERE,
) -> np.ndarray:
    """Levels with ramps between them; a share `rest` of the levels is neutral.

    A level whose integral (s) would leave `room` is taken the other way: the supervisor then need not clip.
    """
    found: list[float] = [0.0]
    while len(found) <= n:
        still = draws.uniform() < rest
        level = 0.0 if still else draws.sign() * draws.between(*amplitude)
        ramp, hold = draws.between(*ramp_s), draws.between(*period_s)
        there = PERIOD_S * sum(found) + level * (hold + ramp)  # its own way back to neutral included
        level = level if room[0] <= there <= room[1] else -level
        found += list(np.linspace(found[-1], level, _count(ramp) + 1)[1:])
        found += [level] * _count(hold)
    return np.array(found[1 : n + 1])


def _count(seconds: float) -> int:
    return max(1, round(seconds / PERIOD_S))


SHAPES: dict[str, Callable[[Part, Draws, int], np.ndarray]] = {
    "steps": _steps,
    "sines": _sines,
    "trapezoids": _trapezoids,
    "random_references": _random_references,
}
