"""A recording with everything that formats differ in: two rates, flags, whole numbers, a gap, a start."""

from datetime import datetime, timedelta, timezone

import numpy as np

from records.measurement import Channel, Measurement

START = datetime(2025, 3, 1, 12, 30, 0, 123456, tzinfo=timezone(timedelta(hours=2)))
FAST_S, SLOW_S = 0.02, 0.1


def channel(name: str, unit: str, time: np.ndarray, values: np.ndarray, description: str = "") -> Channel:
    return Channel(name, unit, time, values, description)


def recording(rows: int = 500) -> Measurement:
    """50 Hz with a gap of a second after 2 s, and 10 Hz beside it."""
    rng = np.random.default_rng(7)
    fast = np.arange(rows) * FAST_S
    fast = np.where(np.arange(rows) > 100, fast + 1.0, fast)
    slow = np.arange(rows // 5) * SLOW_S
    made = [
        channel("q_slew", "rad", fast, np.cumsum(rng.normal(0, 0.01, rows)), "Slew angle"),
        channel("p_slew_a", "Pa", fast, 2e7 + 1e6 * rng.normal(size=rows), "Pressure"),
        channel("brake_released", "1", fast, rng.random(rows) > 0.5),
        channel("target_x", "m", slow, rng.normal(0, 5, len(slow))),
        channel("target_number", "1", slow, np.arange(len(slow), dtype=np.int64) % 250),
    ]
    meta = {"label": "simulated reference machine", "seed": 3}
    return Measurement({c.name: c for c in made}, START, meta, "machine.mf4", ("mended before",))


def one_rate(rows: int = 500) -> Measurement:
    """The same without the slow channels, for formats with one time."""
    whole = recording(rows)
    channels = {n: c for n, c in whole.channels.items() if not n.startswith("target")}
    return Measurement(channels, whole.start, whole.meta, whole.source, whole.repairs)
