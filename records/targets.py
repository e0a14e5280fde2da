"""The targets of a run: when each one was given, where it is, and which way round the slew goes to it."""

from dataclasses import dataclass

import numpy as np

from records.record import Record
from specs.errors import InputError

PERIOD_S = 15.0  # the paper gives a new target every 15 s
XYZ = ("target_x", "target_y", "target_z")


@dataclass(frozen=True)
class Target:
    """One target and the rows of the record in which it held.

    `rows` is half open: a target given at tick k and replaced at tick m holds for the rows k … m−1.
    """

    number: int  # from 1
    rows: slice
    start_s: float
    duration_s: float  # how long it was to hold; the rows may end earlier
    x: float  # m, machine base frame
    y: float
    z: float
    slew: float  # rad, unwrapped: the equivalent of atan2(y, x) nearest to the previous target
    travel: float  # rad, signed slew angle from the previous target, in (−π, π]
    whole: bool  # whether the record covers the whole duration


def targets(record: Record) -> list[Target]:
    """Return the targets of a record in order of time.

    They come from the metadata, `targets`: a list of {"time": s, "x": m, "y": m, "z": m}, or, where that has
    no times, from the changes in the columns target_x, target_y, target_z. A target holds until the next one,
    the last one (and any other at most) for the metadata's `target_interval_s`, 15 s unless told.

    The slew angle of the first target is the equivalent of atan2(y, x) nearest to the slew angle at which the
    run starts, that of every other one the nearest to its predecessor's: so the machine that turns on past
    ±180° is not taken to turn back. Exactly half a turn counts as counter-clockwise.
    """
    time = record.time
    if len(time) < 2:
        return []
    step = float(record.meta.get("step_s", time[1] - time[0]))
    period = float(record.meta.get("target_interval_s", PERIOD_S))
    starts, points = _schedule(record, step)
    previous = float(record.column("true_q_slew")[0])
    found = []
    for i, (start, (x, y, z)) in enumerate(zip(starts, points, strict=True)):
        begin = float(time[start])
        duration = min(period, float(time[starts[i + 1]]) - begin) if i + 1 < len(starts) else period
        stop = start + round(duration / step)
        travel = wrap(np.arctan2(y, x) - previous)
        previous += travel
        whole = stop <= len(time)
        rows = slice(start, min(stop, len(time)))
        found.append(Target(i + 1, rows, begin, duration, x, y, z, previous, travel, whole))
    return found


def _schedule(record: Record, step: float) -> tuple[list[int], list[tuple[float, float, float]]]:
    """Return the first row and the point of each target."""
    told = record.meta.get("targets") or []
    if told and all({"time", "x", "y", "z"} <= set(t) for t in told):
        rows = [int(np.searchsorted(record.time, t["time"] - step / 2)) for t in told]
        points = [(float(t["x"]), float(t["y"]), float(t["z"])) for t in told]
        given = [i for i, row in enumerate(rows) if row < len(record)]
        return [rows[i] for i in given], [points[i] for i in given]
    missing = [name for name in XYZ if name not in record]
    if missing:
        raise InputError(
            f"the record names no targets: neither in its metadata nor as columns {', '.join(XYZ)}"
        )
    track = np.column_stack([record.column(name) for name in XYZ])
    starts = [0, *(np.flatnonzero(np.any(np.diff(track, axis=0) != 0, axis=1)) + 1).tolist()]
    return starts, [(float(x), float(y), float(z)) for x, y, z in track[starts]]


def wrap(angle: float) -> float:
    """Return the equivalent of `angle` [rad] in (−π, π]."""
    wrapped = float(np.remainder(angle, 2 * np.pi))
    return wrapped - 2 * np.pi if wrapped > np.pi else wrapped
