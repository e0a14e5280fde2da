"""What the sensors of a recording show, on the controller's grid: angles, their rates, what is missing.

Rates and accelerations are those of a parabola through the samples `load_estimate_smoothing` around each
moment.  They come from the angles, which are not late, and not from the encoders' velocities, which are.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from baselines.load.balance import JOINTS, Seen, figures
from records.measurement import Measurement, Piece
from specs.errors import InputError
from specs.signals import signal

STEP_S = 0.02
ANGLES = ("q_slew", "q_boom", "q_stick")
TOOL = ("imu_tool_pitch", "imu_tool_roll")
CABIN = ("imu_cabin_pitch", "imu_cabin_roll")
MOVED = 0.02  # rad that a joint turns without its pressure changing when the sensor is dead
Columns = Mapping[str, np.ndarray]


def pressures(joint: str) -> tuple[str, str]:
    """Names of a joint's chamber pressures, bore side and rod side."""
    return f"p_{joint}_a", f"p_{joint}_b"


@dataclass(frozen=True)
class Usable:
    """What can be made of a recording: the joints with both pressures, and whether two IMUs are there."""

    joints: tuple[str, ...]
    tool: bool
    cabin: bool
    notes: tuple[str, ...]

    @property
    def channels(self) -> list[str]:
        """The channels that are used."""
        found = [*ANGLES, *(name for joint in self.joints for name in pressures(joint))]
        return found + list(TOOL) * self.tool + list(CABIN) * self.cabin


@dataclass(frozen=True)
class Stretch:
    """A piece of a recording as the balance takes it; `clipped` [n]: a pressure sensor is at its end."""

    start_s: float
    seen: Seen
    clipped: np.ndarray

    def __len__(self) -> int:
        return len(self.clipped)


def usable(recording: Measurement) -> Usable:
    """Find out what is there; InputError, naming the channels, where no load can be estimated at all."""
    where = recording.source or "the recording"
    _check_values(recording, where)
    if absent := recording.missing(ANGLES):
        raise InputError(f"{where} has no channel {', '.join(absent)}: without the pose there is no estimate")
    joints, notes = [], []
    for joint in JOINTS:
        fault = _fault(recording, joint)
        if fault:
            notes.append(fault)
        else:
            joints.append(joint)
    if not joints:
        raise InputError(f"{where}: {'; '.join(notes)}: neither boom nor stick is left to estimate from")
    notes = [f"{note}: estimated from the {joints[0]} alone" for note in notes]
    tool, cabin = not recording.missing(TOOL), not recording.missing(CABIN)
    if not tool:
        notes.append(
            f"no {' and '.join(recording.missing(TOOL))}: the tool is taken to hang still, at rest only"
        )
    if not cabin:
        notes.append(f"no {' and '.join(recording.missing(CABIN))}: the machine is taken to stand level")
    return Usable(tuple(joints), tool, cabin, tuple(notes))


def _check_values(recording: Measurement, where: str) -> None:
    """InputError for a channel of ours in another unit, without samples, or with one that is no number."""
    for name in (*ANGLES, *TOOL, *CABIN, *(n for joint in JOINTS for n in pressures(joint))):
        if name not in recording:
            continue
        channel = recording[name]
        if channel.unit != signal(name).unit:
            raise InputError(f"{where}: channel {name} is in {channel.unit}; needed: {signal(name).unit}")
        wrong = np.flatnonzero(~np.isfinite(channel.values))
        if len(wrong):
            raise InputError(f"{where}: channel {name} is no number at {channel.time[wrong[0]]:.3f} s")
        if len(channel.values) < 2:
            raise InputError(f"{where}: channel {name} has {len(channel.values)} samples; leave it out")


def _fault(recording: Measurement, joint: str) -> str:
    """Why a joint's pressures cannot be used, or an empty string."""
    names = pressures(joint)
    if absent := recording.missing(names):
        return f"no channel {' and '.join(absent)}"
    moved = np.ptp(recording[f"q_{joint}"].values) > MOVED
    dead = [n for n in names if np.ptp(recording[n].values) == 0.0]
    if dead and moved:
        return f"{' and '.join(dead)} constant while the {joint} moves"
    return ""


def stretches(recording: Measurement, found: Usable) -> list[Stretch]:
    """The recording's stretches without gaps that are longer than two windows' smoothing."""
    shortest = 2 * smoothing()
    pieces = recording.pieces(found.channels, STEP_S)
    return [_stretch(piece, found) for piece in pieces if len(piece) > shortest]


def smoothing() -> int:
    """Samples under the smoothing parabola (odd)."""
    return 2 * round(figures().load_estimate_smoothing / STEP_S / 2) + 1


def _stretch(piece: Piece, found: Usable) -> Stretch:
    n = len(piece)
    tilt = np.array([piece[c] for c in CABIN]) if found.cabin else np.zeros((2, n))
    tool = np.array([piece[c] for c in TOOL]) if found.tool else np.zeros((2, n))
    angles = np.array([*(piece[c] for c in ANGLES), *tool])
    q, v, a = (savgol_filter(angles, smoothing(), 2, d, STEP_S, axis=1) for d in range(3))
    chambers = [c for joint in JOINTS for c in pressures(joint)]
    p = np.array([piece[c] if c in piece.columns else np.zeros(n) for c in chambers])
    tilt = savgol_filter(tilt, smoothing(), 2, axis=1)
    still = np.zeros((2, n))
    return Stretch(piece.start_s, Seen(q, v, a, p, tilt, still, still), _clipped(piece, found))


def _clipped(piece: Piece, found: Usable) -> np.ndarray:
    clipped = np.zeros(len(piece), dtype=bool)
    for joint in found.joints:
        for name in pressures(joint):
            limits = signal(name)
            clipped |= (piece[name] >= limits.max) | (piece[name] <= limits.min)
    return clipped
