"""Steady segments of a recording: the joystick held, transients over, the speed a slope of the joint angle.

A hold is a stretch whose joystick stays within TOLERANCE of where it began.  Its first SETTLE_S are left out,
the rest is cut into segments of WINDOW_S.  The speed of a segment is the median slope over its pairs of
samples (Theil-Sen: a third of its samples may be wrong), with the standard error of a straight line through
noise that is correlated as the residuals are.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Self

import numpy as np

from baselines.arm_velocity import sensor_checks
from records.measurement import Measurement, Piece
from specs.errors import InputError

TOLERANCE = 0.01  # joystick: less is held
SETTLE_S = 1.2  # delays, spool, pressures, and the arm's first swing
WINDOW_S = 1.0
SHORTEST_S = 0.6
SLOWEST_STEP_S = 0.1  # between samples of the angle
STILL = 0.002  # rad/s: less is no motion
UNSTEADY = 0.25  # of the speed, between both halves of a segment
UNSTEADY_MIN = 0.008  # rad/s


@dataclass(frozen=True)
class Segments:
    """Steady segments of one joint, each field [n]: where, at what command, how fast, under what pressure."""

    recording: np.ndarray  # number of the recording
    hold: np.ndarray  # number of the hold, over all recordings
    start_s: np.ndarray  # s from the recording's start
    command: np.ndarray  # joystick
    speed: np.ndarray  # rad/s
    error: np.ndarray  # rad/s, standard error of the speed
    angle: np.ndarray  # rad, mean of the joint's angle
    inlet: np.ndarray  # Pa, mean pressure of the chamber that drives the motion; NaN where not recorded
    rate_a: np.ndarray  # Pa/s, rate of both chamber pressures: oil that gives way moves the joint, too
    rate_b: np.ndarray

    def __len__(self) -> int:
        return len(self.speed)

    def __getitem__(self, chosen: np.ndarray) -> Self:
        return type(self)(**{f.name: getattr(self, f.name)[chosen] for f in fields(self)})


@dataclass(frozen=True)
class Found:
    """What the recordings hold of a joint; `unsteady` segments were left out."""

    segments: Segments
    unsteady: int
    notes: tuple[str, ...] = ()


def find(recordings: Sequence[Measurement], joint: str) -> Found:
    """The steady segments of `joint` in all recordings that have its joystick and angle.

    Raises InputError naming recording, channel and time for a constant joystick, a joystick that is never
    held, a joint that never moves, and a sensor at the end of its range.
    """
    sensor_checks.excitation(recordings, joint)
    rows: list[tuple[float, ...]] = []
    unsteady, count, notes = 0, 0, []
    for number, recording in enumerate(recordings):
        covariates = list(_pressures(joint))
        if absent := recording.missing(covariates):
            notes.append(f"{recording.source}: no {' and no '.join(absent)}: not corrected for pressure")
            covariates = []  # one chamber alone says little
        step = _step(recording, joint)
        for piece in recording.pieces([f"u_{joint}", f"q_{joint}", *covariates], step):
            for hold in holds(piece[f"u_{joint}"], step):
                count += 1
                for segment in _cut(piece, hold, step, joint, (float(number), float(count))):
                    unsteady += segment is None
                    rows += [segment] if segment else []
    names = [f.name for f in fields(Segments)]
    table = np.array(rows).reshape(-1, len(names)).T
    found = Segments(**dict(zip(names, table, strict=True)))
    sensor_checks.motion(recordings, joint, found.command, found.speed, STILL)
    return Found(found, unsteady, tuple(notes))


def _pressures(joint: str) -> tuple[str, ...]:
    return f"p_{joint}_a", f"p_{joint}_b"


def _step(recording: Measurement, joint: str) -> float:
    """Time between samples of the joint's angle [s]."""
    step = recording[f"q_{joint}"].period_s
    if not step <= SLOWEST_STEP_S:
        raise InputError(
            f"{recording.source}: q_{joint} has a sample every {step:.3g} s; "
            f"at most {SLOWEST_STEP_S:g} s are of use"
        )
    return step


def holds(joystick: np.ndarray, step_s: float) -> list[slice]:
    """Stretches, long enough to be of use, whose joystick [n] stays within TOLERANCE of its first value."""
    needed = round((SETTLE_S + SHORTEST_S) / step_s)
    found, begin = [], 0
    while begin < len(joystick):
        off = np.abs(joystick[begin:] - joystick[begin]) > TOLERANCE
        length = int(np.argmax(off)) if off.any() else len(off)
        if length >= needed:
            found.append(slice(begin, begin + length))
        begin += length
    return found


def _cut(
    piece: Piece, hold: slice, step: float, joint: str, identity: tuple[float, float]
) -> Iterator[tuple[float, ...] | None]:
    """The segments of a hold as rows; None for one in which the speed still changes."""
    command = float(np.median(piece[f"u_{joint}"][hold]))
    first, count = hold.start + round(SETTLE_S / step), round(WINDOW_S / step)
    edges = [*range(first, hold.stop - round(SHORTEST_S / step) + 1, count), hold.stop]
    if abs(command) <= TOLERANCE:
        return
    for begin, end in pairwise(edges):
        q = piece[f"q_{joint}"][begin:end]
        speed, error = slope(q, step)
        if not _steady(q, step, speed):
            yield None
            continue
        pressures = _load(piece, slice(begin, end), joint, command, step)
        yield *identity, piece.start_s + begin * step, command, speed, error, float(np.mean(q)), *pressures


def _load(piece: Piece, at: slice, joint: str, command: float, step: float) -> tuple[float, ...]:
    """`inlet`, `rate_a` and `rate_b` of a segment; NaN where not recorded."""
    a, b = (piece.columns.get(n, np.full(len(piece), np.nan))[at] for n in _pressures(joint))
    return float(np.mean(a if command > 0 else b)), slope(a, step)[0], slope(b, step)[0]


def slope(q: np.ndarray, step_s: float) -> tuple[float, float]:
    """(median slope, its standard error) of evenly spaced samples `q` [n]: 1/s."""
    n = len(q)
    i, j = np.triu_indices(n, max(1, n // 4))  # near pairs tell little but noise
    speed = float(np.median((q[j] - q[i]) / ((j - i) * step_s)))
    t = step_s * (np.arange(n) - (n - 1) / 2)
    rest = q - speed * t
    rest = rest - np.median(rest)
    scale = 1.4826 * float(np.median(np.abs(rest)))
    variation = float(rest @ rest)
    correlation = float(rest[1:] @ rest[:-1]) / variation if variation > 0 else 0.0
    correlation = min(max(correlation, 0.0), 0.95)
    inflation = (1 + correlation) / (1 - correlation)
    return speed, scale * float(np.sqrt(1.1 * inflation / (t @ t)))


def _steady(q: np.ndarray, step: float, speed: float) -> bool:
    """Whether both halves go at the same speed, but for noise and what the arm's geometry changes."""
    half = len(q) // 2
    (one, error), (two, other) = slope(q[:half], step), slope(q[half:], step)
    limit = max(UNSTEADY * abs(speed), UNSTEADY_MIN, 4 * float(np.hypot(error, other)))
    return abs(two - one) <= limit
