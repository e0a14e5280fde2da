"""Is the traces' speed late against their pressures?  `python -m fmus.models.slew.lateness` tells.

The drive's torque balance I w' = D (p_a - p_b) - b w - T sgn w holds at one instant.  It is fitted with the
speed moved in time against the pressures: where the speed of the traces is late, the fit is best there.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from fmus.models.slew.traces import PERIOD, Trace, held_out, load

SHIFTS = tuple(round(0.1 * k - 0.3, 1) for k in range(8))  # s, speed taken so much later than the pressures
MOVES = 0.01  # rad/s: below, dry friction has no known direction


def balance(traces: Iterable[Trace], shift: float) -> tuple[float, np.ndarray]:
    """The balance with the speed taken `shift` s later, over all rows that move.

    R² of I w', and D [m3], b [N m s/rad], T [N m].
    """
    rows, torque = [], []
    for t in traces:
        own = t.time[t.first :]
        w = np.interp(own + shift, t.time, t.qd)
        slope = (
            np.interp(own + shift + PERIOD, t.time, t.qd) - np.interp(own + shift - PERIOD, t.time, t.qd)
        ) / (2.0 * PERIOD)
        inside = (own + shift - PERIOD >= t.time[0]) & (own + shift + PERIOD <= t.time[-1])
        used = inside & (np.abs(w) > MOVES)
        pressure = (t.p_a - t.p_b)[t.first :]
        rows.append(np.column_stack([pressure, -w, -np.sign(w)])[used])
        torque.append(t.inertia * slope[used])
    matrix, wanted = np.concatenate(rows), np.concatenate(torque)
    found, *_ = np.linalg.lstsq(matrix, wanted, rcond=None)
    left = wanted - matrix @ found
    return 1.0 - float(left @ left) / float(wanted @ wanted), found


def lateness(traces: Sequence[Trace]) -> dict[float, float]:
    """R² by shift [s]."""
    return {shift: balance(traces, shift)[0] for shift in SHIFTS}


if __name__ == "__main__":
    found = lateness(held_out(load()))
    print("speed taken later by [s]   R² of the torque balance")
    for shift, share in found.items():
        print(f"{shift:+24.1f}   {share:.3f}{'   best' if share == max(found.values()) else ''}")
