"""A rig that is held at first and then let go: what stands still before that tells nothing of its motion.

Where no input changes, a machine at rest stays there.  What held it was not recorded.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reconcile.recordings.ends import moves
from reconcile.recordings.noise import high_pass_level, quantum
from records.measurement import Channel

LEAST = 10  # samples in which it stands
NEAR, FARTHER = 5.0, 20.0  # noise levels, or steps, that what stands is off at most; by which it has moved
LONGER = 4.0  # times as long as it takes from the one to the other: what falls at once takes as long before


def held_at_first(channels: dict[str, Channel], inputs: Sequence[str], outputs: Sequence[str]) -> list[str]:
    """Leave out what stands still at first, in place; what there is to say of it."""
    left = [_leaves(channels[n]) for n in outputs if np.ptp(channels[n].values) > 0.0]
    stands, moved = min(left, default=(0.0, 0.0))
    if not stands or any(np.any(np.diff(c.values[c.time <= moved])) for c in (channels[n] for n in inputs)):
        return []
    for n, c in channels.items():
        after = c.time >= stands
        channels[n] = replace(c, time=c.time[after], values=c.values[after])
    return [
        f"{', '.join(outputs)}: still until {stands:.6g} s, though no input changes, and left out until "
        "then: what let go is not recorded"
    ]


def _leaves(channel: Channel) -> tuple[float, float]:
    """When an output last stands as at first, and when it has moved (s); zeros where it moves at once."""
    y, t = channel.values.astype(float), channel.time
    if len(y) < 2 * LEAST or not moves(y):
        return 0.0, 0.0
    size = max(high_pass_level(y), quantum(y), float(np.ptp(y[:LEAST])) / NEAR)
    off = np.abs(y - np.median(y[:LEAST]))
    near, farther = (int(np.argmax(off > k * size)) for k in (NEAR, FARTHER))
    if not LEAST <= near <= farther or t[near - 1] - t[0] < LONGER * (t[farther] - t[near - 1]):
        return 0.0, 0.0
    return float(t[near - 1]), float(t[farther])
