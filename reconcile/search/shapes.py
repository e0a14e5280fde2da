"""Starts of shapes that a grid would miss, from the missing force: a ripple's period, a stop's place."""

from collections.abc import Sequence

import numpy as np

from reconcile.equations.model import Attached
from reconcile.errors.residual import Residual, missing_forces
from reconcile.filter.kalman import Values
from reconcile.search.core import Core

PEAKS = 4  # periods of a ripple that are tried
FINE = 600  # numbers of waves that a period is looked for among
SHARES = (0.6, 0.75, 0.85, 0.92, 0.97)  # of the places met, at which a stop may begin


class Shapes:
    """The missing force of the model without effects, over place."""

    def __init__(self, core: Core):
        self.core = core
        self._forces: list[Residual] | None = None

    def starts(self, a: Attached) -> list[Values]:
        """Starts of an effect's shape by full name; none for effects that the catalogue's own serve."""
        if a.effect.name == "torque_ripple":
            return [{a.name("waves"): w} for w in self._periods(a)]
        if a.effect.name == "end_stop":
            return self._stops(a)
        return []

    def _over_place(self, a: Attached) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Place, speed and missing force [N] of the axis at which an effect is."""
        if self._forces is None:
            self._forces = missing_forces(self.core, self.core.shown)
        axis = self.core.folder.ports.axis(a.port)
        found = next((f for f in self._forces if f.axis == a.port), None)
        if found is None or axis.position is None:
            return None
        q, v = (found.states[:, self.core.model.index("states", n)] for n in (axis.position, axis.velocity))
        return q, v, found.values

    def _periods(self, a: Attached) -> Sequence[float]:
        """Waves over the place at which the missing force's periodogram has its peaks (Lomb 1976)."""
        known = self._over_place(a)
        if known is None or np.ptp(known[0]) == 0.0:
            return []
        q, v, d = known
        d = d - np.mean(d)
        # a wave is to be met by several samples, and one and a half of them to lie in the travel
        most = 0.7 * np.pi / max(float(np.quantile(np.abs(v), 0.6)) * self.core.period, 1e-12)
        least = max(3.0 * np.pi / float(np.ptp(q)), 1.0 if self.core.scales[a.port].angular else 0.0)
        if most <= least:
            return []
        waves = np.unique(np.concatenate([np.linspace(least, most, FINE), np.geomspace(least, most, FINE)]))
        power = np.array([np.abs(np.sum(d * np.exp(-1j * w * q))) for w in waves])
        peaks = [i for i in range(1, len(waves) - 1) if power[i] >= max(power[i - 1], power[i + 1])]
        return [float(waves[i]) for i in sorted(peaks, key=lambda i: -power[i])[:PEAKS]]

    def _stops(self, a: Attached) -> list[Values]:
        """Places where a stop may begin, with the stiffness that the missing force has beyond them."""
        known = self._over_place(a)
        if known is None:
            return []
        q, _, d = known
        side = {"upper": 1.0, "lower": -1.0}.get(a.effect.form, 0.0)
        reach, pushed = (side * q, -side * d) if side else (np.abs(q), -np.sign(q) * d)
        starts = []
        for share in SHARES:
            place = float(np.quantile(reach, share))
            into = np.maximum(reach - place, 0.0)
            k = float(into @ pushed) / max(float(into @ into), 1e-300)
            if k > 0.0:
                starts.append({a.name("position"): side * place if side else place, a.name("k"): 2.0 * k})
        return starts
