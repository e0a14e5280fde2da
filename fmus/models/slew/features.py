"""Features of a joystick step as engineers read them: speed reached, rise times, angle coasted.

Used on the traces and on recordings of the reference machine alike: they need a sampled speed and angle.
"""

from dataclasses import dataclass, fields

import numpy as np

from fmus.models.slew.traces import Trace

STEP_AT, RELEASE_AT = 1.0, 8.0  # s, of the step traces
SHARES = (0.05, 0.63, 0.9)


@dataclass(frozen=True)
class Features:
    """Of one step, or averaged over both directions; angles in degrees, times from the step in s."""

    speed_deg_s: float  # mean over the last second before the release
    t5_s: float
    t63_s: float
    t90_s: float
    coast_deg: float


# Largest difference to the traces: relative, or absolute, whichever is more.
RELATIVE = 0.15
ABSOLUTE = Features(speed_deg_s=2.0, t5_s=0.3, t63_s=0.3, t90_s=0.3, coast_deg=5.0)


def features(
    time: np.ndarray, qd: np.ndarray, q: np.ndarray, step_at: float = STEP_AT, release_at: float = RELEASE_AT
) -> Features:
    """Features of a step from `step_at` to `release_at` (s), from speed (rad/s) and angle (rad) at `time`.

    A rise time is that of the first sample at or above the share of the speed reached; NaN if there is none.
    """
    held = (time > release_at - 1.0 + 1e-6) & (time < release_at + 1e-6)
    speed = qd[held].mean()
    late = time > step_at + 1e-6
    times = [_first(time[late], qd[late] / speed >= share) - step_at for share in SHARES]
    last = int(np.flatnonzero(held)[-1])
    return Features(
        float(np.degrees(abs(speed))), *times, coast_deg=float(np.degrees((q[-1] - q[last]) * np.sign(speed)))
    )


def of_trace(trace: Trace) -> Features:
    """Features of a step trace."""
    return features(trace.time, trace.qd, trace.q)


def mean(several: list[Features]) -> Features:
    """Mean over directions."""
    names = [f.name for f in fields(Features)]
    return Features(**{n: float(np.mean([getattr(s, n) for s in several])) for n in names})


def misses(found: Features, wanted: Features) -> list[str]:
    """The features of `found` that are further from `wanted` than max(15 %, 2 °/s, 0.3 s, 5°)."""
    out = []
    for f in fields(Features):
        value, target = getattr(found, f.name), getattr(wanted, f.name)
        if not abs(value - target) <= max(RELATIVE * abs(target), getattr(ABSOLUTE, f.name)):
            out.append(f"{f.name} {value:.2f}, traces {target:.2f}")
    return out


def _first(time: np.ndarray, reached: np.ndarray) -> float:
    where = np.flatnonzero(reached)
    return float(time[where[0]]) if where.size else float("nan")
