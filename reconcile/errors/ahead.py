"""How far a model errs by itself: from the filtered state on, without disturbance, over its own time."""

import numpy as np

from reconcile.filter.point import Point
from reconcile.search.core import Core


def horizon_s(core: Core) -> float:
    """Time over which the model is to predict by itself: in which the outputs forget, within the blocks."""
    blocks = [b.end_s - b.start_s for b in core.parts.confirm]
    return float(min(max(core.memory_s, 10.0 * core.period), min(blocks)))


def windows(core: Core, which: str, horizon: float) -> list[np.ndarray]:
    """Numbers of the stretches [n] of every recording in which the model runs by itself (0: none)."""
    found, number = [], 0
    for record in core.records:
        inside = getattr(record, which)
        ids = np.zeros(len(record.time), int)
        begun = -np.inf
        for k in np.flatnonzero(inside):
            if k == 0:
                continue
            if not inside[k - 1] or record.time[k] - begun >= horizon:
                number, begun = number + 1, record.time[k]
            ids[k] = number
        found.append(ids)
    return found


def noise(core: Core, point: Point) -> float:
    """Noise of the outputs in their spreads (rms)."""
    return float(
        np.sqrt(np.mean([(core.noise(point.values, n) / core.spread[n]) ** 2 for n in core.outputs]))
    )


def ahead(core: Core, point: Point, which: str = "confirm") -> float:
    """Error ahead of a point above its noise; see Judge.ahead."""
    error, known = squares(core, point, which)
    return float(np.sqrt(max(error - known, 0.0)))


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
    ids = windows(core, which, horizon_s(core))
    run = core.kalman.run(point.values, point.present, windows=ids, own=True)
    if run is None:
        return None
    spread = np.array([core.spread[n] for n in core.outputs])
    # an error that runs away counts as the whole motion, not as more
    return [np.clip((f.y - f.free)[i > 0] / spread, -3.0, 3.0) for f, i in zip(run, ids, strict=True)]
