"""Shafts at the frequencies at which the missing force swings: where damping is small, no grid meets them.

A shaft's ends swing against each other so fast that a fit only finds them from close by, with little noise: a
large disturbance would take all of it over, and slopes there lead nowhere.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from reconcile.equations.model import Attached
from reconcile.errors.residual import missing_forces
from reconcile.filter.kalman import Values
from reconcile.search.core import Core
from reconcile.search.sets import LONG, Key, Sets
from reconcile.tolerances import WORTH

NAME = "structural_compliance"
PEAKS = 2  # frequencies that are tried
SHARES = (0.2, 0.35, 0.5, 0.7)  # of the inertia, with the drive
DAMPED = 0.04  # damping ratio where a fit starts
SLOWEST = 3.0  # swings in a recording, at least
APART = 5  # bins of the spectrum around a peak that are lower


def found(sets: Sets) -> list[Key]:
    """Sets of a shaft, with an offset in time or without, that are likelier than none; the best first.

    What swings fast is told only with inputs that act when they do.
    """
    core, fitted = sets.core, []
    for a in core.candidates:
        if a.effect.name != NAME:
            continue
        for present in [(a,), (a, core.offset)] if core.offset else [(a,)]:
            free, key = [*core.base_free, *core.free_of(*present)], frozenset(present)
            tried = [
                core.fitter.fit(v, present, free, LONG, every=2, own=True) for v in _starts(core, present)
            ]
            best = min((p for p in tried if p), key=lambda p: p.total, default=None)
            if best is not None:
                sets.fit(key, present, [best.values])
            if key in sets.points and sets.evidence(key) > sets.evidence(frozenset()) + WORTH:
                fitted.append(key)
    return sorted(fitted, key=lambda k: -sets.evidence(k))


def _starts(core: Core, present: Sequence[Attached]) -> Iterator[Values]:
    """A shaft in the model as it came, for each frequency and each share of the inertia."""
    a = present[0]
    inertia = core.kalman.whole.inertia(core.folder.ports.axis(a.port))
    early = {o.name("delay"): -0.5 * core.period for o in present[1:]}
    for frequency in _frequencies(core, a.port):
        for share in SHARES:
            mass = inertia * share * (1.0 - share)
            own = {
                "gate": 1.0,
                "k": mass * frequency**2,
                "c": 2.0 * DAMPED * mass * frequency,
                "share": share,
            }
            yield core.fresh | early | {a.name(n): v for n, v in own.items()}


def _frequencies(core: Core, axis: str) -> list[float]:
    """Where the spectrum of the missing force at an axis has its highest peaks (rad/s)."""
    force = next((f.values for f in missing_forces(core, core.shown) if f.axis == axis), None)
    if force is None:
        return []
    size = np.abs(np.fft.rfft((force - np.mean(force)) * np.hanning(len(force))))
    least = int(SLOWEST)
    peaks = [
        i for i in range(least, len(size) - 1) if size[i] == size[max(i - APART, 0) : i + APART + 1].max()
    ]
    highest = sorted(peaks, key=lambda i: -size[i])[:PEAKS]
    return [2.0 * np.pi * i / (len(force) * core.period) for i in highest]
