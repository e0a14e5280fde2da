"""Noise of sensors that has a memory: a camera's, a filtered speed's, a range finder's.

The filter knows white noise of outputs and forces with a memory.  Noise that lasts for some samples would be
taken for a force, which then stands for small, steady effects as well: they gain nothing any more.
"""

from reconcile.filter.kalman import CORRELATED, SIGMA, TAU
from reconcile.filter.point import Point
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.search.sets import LONG
from reconcile.tolerances import INPUT_GAIN

LEFT = 1e-3  # of the forces at a place: a disturbance that is smaller hides nothing


def likelier(beam: Beam) -> Core | None:
    """The beam's ground with noise that has a memory, where the best set is likelier with it."""
    core, point = beam.core, beam.points[beam.ranked()[0]]
    if core.kalman.correlated or max(core.disturbances(point.values).values(), default=0.0) < LEFT:
        return None
    other = Core(core.folder, core.parts, core.catalogue, core.share, correlated=True)
    free = [*other.base_free, *other.noise_free, *other.free_of(*point.present)]
    found = other.fitter.fit(other.base.values | point.values, point.present, free, LONG, own=True)
    return other if found and found.total < point.total - INPUT_GAIN else None


def notes(core: Core, point: Point) -> list[str]:
    """What of the outputs' noise has a memory, in words; nothing where that is little."""
    units, found = {v.name: v.unit for v in core.model.outputs}, []
    for n in core.kalman.correlated:
        size, lasts = (point.values[kind + CORRELATED + n] for kind in (SIGMA, TAU))
        if size > core.floor[n]:
            found.append(f"noise of {n} of {size:.3g} {units[n]} has a memory of {lasts:.3g} s")
    return found
