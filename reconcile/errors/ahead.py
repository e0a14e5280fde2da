"""How far a model errs by itself: from the filtered state on, without disturbance, over its own time."""

from collections.abc import Sequence

import numpy as np

from reconcile.filter.point import Point
from reconcile.search.core import Core

LEAST = 10.0  # samples that are predicted, however soon the outputs forget


def horizon_s(core: Core) -> float:
    """Time over which the model is to predict by itself: in which the outputs forget."""
    return float(max(core.memory_s, LEAST * core.period))


def windows(core: Core, which: Sequence[str]) -> list[tuple[np.ndarray, np.ndarray]]:
    """By recording: numbers of the stretches [n] in which the model runs by itself (0: none); what counts.

    What counts lies in the parts `which`.  To a block that is shorter than the horizon the model runs from
    before it, through other parts: so it is predicted over the model's own time, however short it is.
    """
    horizon, found, number = horizon_s(core), [], 0
    for record in core.records:
        inside = np.any([getattr(record, w) for w in which], axis=0)
        ids, free = np.zeros(len(record.time), int), 1  # the first sample that no stretch has; 0 is the start
        for first, end in _blocks(inside):
            before = int(np.searchsorted(record.time, record.time[end - 1] - horizon))
            at = max(min(first, before), free)
            while at < end:
                until = min(int(np.searchsorted(record.time, record.time[at] + horizon)), end)
                number += 1
                ids[at:until] = number
                at = until
            free = end
        found.append((ids, inside & (ids > 0)))
    return found


def _blocks(inside: np.ndarray) -> list[tuple[int, int]]:
    """First sample and end of each stretch that is inside."""
    edges = np.flatnonzero(np.diff(np.r_[0, inside.astype(int), 0]))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def noise(core: Core, point: Point) -> float:
    """Noise of the outputs in their spreads (rms)."""
    return float(
        np.sqrt(np.mean([(core.noise(point.values, n) / core.spread[n]) ** 2 for n in core.outputs]))
    )


def ahead(core: Core, point: Point, which: str = "confirm") -> float:
    """Error ahead of a point above its noise; see Judge.ahead."""
    error, known = squares(core, point, which)
    return float(np.sqrt(max(error - known, 0.0)))


def without_effects(core: Core) -> Point:
    """The model without effects as it errs least ahead: by all that its likelihood says, or by slow motion.

    A large disturbance that remembers long takes over what the model's own parameters do; its likelihood
    hardly says so where a recording is short.
    """
    found = [p for p in (core.base, core.slow) if p is not None]
    return min(found, key=lambda p: ahead(core, p))


def squares(core: Core, point: Point, which: str = "confirm") -> tuple[float, float]:
    """Mean squares of the error ahead, noise and all, and of the noise, in spreads of the outputs."""
    errors = by_record(core, point, which)
    if errors is None:
        return float("inf"), 0.0
    all_errors = np.concatenate(errors)
    known = [(core.noise(point.values, n) / core.spread[n]) ** 2 for n in core.outputs]
    count = max(int((~np.isnan(all_errors)).sum()), 1)
    return float(np.nansum(all_errors**2)) / count, float(np.sum(~np.isnan(all_errors) * known)) / count


def by_record(core: Core, point: Point, which: str = "confirm") -> list[np.ndarray] | None:
    """Errors ahead of every recording [samples, outputs] in spreads of the outputs; NaN: not recorded.

    None where the model runs away.
    """
    each = windows(core, (which,))
    run = core.kalman.run(point.values, point.present, windows=[ids for ids, _ in each], own=True)
    if run is None:
        return None
    spread = np.array([core.spread[n] for n in core.outputs])
    # an error that runs away counts as the whole motion, not as more
    return [np.clip((f.y - f.free)[i] / spread, -3.0, 3.0) for f, (_, i) in zip(run, each, strict=True)]
