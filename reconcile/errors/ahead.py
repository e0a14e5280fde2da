"""How far a model errs by itself: from the filtered state on, without disturbance, over its own time."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from reconcile.filter.kalman import NOISE
from reconcile.filter.point import Point
from reconcile.search.alone import alone
from reconcile.search.core import Core

LEAST = 10.0  # samples that are predicted, however soon the outputs forget


def horizon_s(core: Core) -> float:
    """Time over which the model is to predict by itself: in which the outputs forget."""
    return float(max(core.memory_s, LEAST * core.period))


def windows(core: Core, which: Sequence[str]) -> list[tuple[np.ndarray, np.ndarray]]:
    """By recording: numbers of the stretches [n] in which the model runs by itself (0: none); what counts.

    What counts lies in the parts `which`, from where hidden states are known, if anything of them does.  To
    a block that is shorter than the horizon the model runs from before it, through other parts: so it is
    predicted over the model's own time, however short it is.
    """
    found = _windows(core, which)
    return found if any(counts.any() for _, counts in found) else _windows(core, which, early=True)


def _windows(core: Core, which: Sequence[str], early: bool = False) -> list[tuple[np.ndarray, np.ndarray]]:
    """See windows; `early`: whether what comes before hidden states are known counts as well."""
    reach, found, number = horizon_s(core) - 0.5 * core.period, [], 0  # half a sample: for rounding
    first_s = min(reach, (LEAST - 0.5) * core.period) if core.shows_all else reach
    for record in core.records:
        inside = np.any([getattr(record, w) for w in which], axis=0)
        index = partial(np.searchsorted, record.time)
        known = index(record.time[0] + first_s)  # hidden states are known by then
        # the first sample that no stretch has; 0 is the start
        ids, free = np.zeros(len(record.time), int), 1 if early else known
        for first, end in _blocks(inside):
            at = max(min(first, max(known, index(record.time[end - 1] - reach))), free)
            while at < end:
                until = min(index(record.time[at] + reach), end)
                number += 1
                ids[at:until] = number
                at = until
            free = max(end, free)
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
    return above_noise(by_stretch(core, point, which))


def above_noise(stretches: np.ndarray) -> float:
    """The error (rms) above the noise, of some rows of by_stretch."""
    squares, known, count = stretches.sum(axis=0)
    return float(np.sqrt(max(squares - known, 0.0) / max(count, 1.0)))


def without_effects(core: Core) -> Point:
    """The model without effects: by all that its likelihood says, or by its output error where it errs less.

    What errs by no more than the noise is left as it is.
    """
    if ahead(core, core.base) < noise(core, core.base):
        return core.base
    return min((core.base, *alone(core)), key=lambda p: ahead(core, p))


def squares(core: Core, point: Point, parts: Sequence[str] = ("confirm",)) -> tuple[float, float]:
    """Mean squares of the error ahead, noise and all, and of the noise, in spreads of the outputs."""
    rows = np.vstack([by_stretch(core, point, w) for w in parts])
    errors, known, count = rows.sum(axis=0)
    return float(errors / max(count, 1.0)), float(known / max(count, 1.0))


def standing(core: Core, which: str = "confirm") -> float:
    """What a model that stands still errs by in the model's own time (rms), in spreads of the outputs."""
    moved = [np.zeros((1, len(core.outputs)))]
    for record, (ids, counts) in zip(core.records, windows(core, (which,)), strict=True):
        y = np.column_stack([record.output(n, (0.0, 0.0))[0] / core.spread[n] for n in core.outputs])
        of_each = (ids == number for number in np.unique(ids[counts]))
        moved += [(y[i] - y[i][0])[counts[i]] for i in of_each]
    return float(np.sqrt(np.nanmean(np.concatenate(moved) ** 2)))


def beyond_noise(core: Core, point: Point) -> float:
    """Error ahead in levels of the outputs' noise."""
    own = sensors(core, point)
    return float(np.sqrt(max(squares(core, point)[0] / own - 1.0, 0.0)))


def beyond_sensors(
    core: Core, point: Point, parts: Sequence[str] = ("confirm",), level: float = np.inf
) -> float:
    """Error ahead but the sensors' own noise, in spreads of the outputs (rms).

    `level`: mean square of that noise, where another fit has shown that there is less of it.
    """
    own = min(sensors(core, point), level)
    return float(np.sqrt(max(squares(core, point, parts)[0] - own, 0.0)))


def sensors(core: Core, point: Point) -> float:
    """Mean square of the sensors' noise in spreads of the outputs.

    What a fit takes for noise beyond the level that samples in a row show is error.
    """
    white = {NOISE + n: min(point.values[NOISE + n], core.floors[n].level) for n in core.outputs}
    own = [core.noise(point.values | white, n) / core.spread[n] for n in core.outputs]
    return float(np.mean(np.square(own)))


def by_stretch(core: Core, point: Point, which: str = "confirm") -> np.ndarray:
    """By stretch [W, 3]: sums of squares, noise and all, and of the noise, and samples.

    One row without end where the model runs away, or nothing is predicted.  What a point takes for noise
    beyond that of the model without effects is error.
    """
    errors = by_record(core, point, which)
    numbers = np.concatenate([ids[counts] for ids, counts in windows(core, (which,))])
    if errors is None or not len(numbers):
        return np.array([[np.inf, 0.0, 1.0]])
    every, level = (
        np.concatenate(errors),
        [
            min(core.noise(v, n) for v in (point.values, core.base.values)) / core.spread[n]
            for n in core.outputs
        ],
    )
    seen = ~np.isnan(every)
    rows = np.column_stack([np.nansum(every**2, axis=1), seen @ np.square(level), seen.sum(axis=1)])
    return np.array([rows[numbers == n].sum(axis=0) for n in np.unique(numbers)])


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
