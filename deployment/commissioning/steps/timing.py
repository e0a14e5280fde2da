"""When sensors say what they say: the same motion, seen by two of them, is half over at the same time.

Half of a change is a time that neither a wrong zero nor a wrong scale shifts, and a hand that turns an IMU
need not be steady.
"""

import numpy as np

from deployment.commissioning.bench import Bench
from runtime.image import TICK_S

EDGE = 10  # ticks at either end over which the levels before and after are taken


def halfway(x: np.ndarray) -> float:
    """s from the beginning until a signal [n] has made half of its change for good; NaN if it has not
    changed."""
    before, after = float(np.mean(x[:EDGE])), float(np.mean(x[-EDGE:]))
    if before == after:
        return float("nan")
    below = np.flatnonzero((x - before) / (after - before) < 0.5)
    return float(below[-1] + 1) * TICK_S


def swept(rate: np.ndarray, zero: float) -> np.ndarray:
    """Integral of a rate [n] less its zero, rad."""
    return np.cumsum(rate - zero) * TICK_S


def agree(
    bench: Bench, name: str, late: np.ndarray, reference: np.ndarray, look: str, usual: float = 0.0
) -> None:
    """Check that one signal's change comes `usual` seconds after the other's, within the limit."""
    apart, limit = halfway(late) - halfway(reference), bench.f.commissioning_late
    bench.between(f"{name} later", apart, usual - limit, usual + limit, "s", look)
