"""Windows: the balance averaged over a stretch in which every moment counts.

Averaging both sides is the least squares solution over the window's samples for one equation a joint; what
it leaves is not sensor noise but what the equations get wrong, and that is the same all over the window.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from baselines.load.balance import Seen, figures, functions, unknowns
from baselines.load.gate import Gated, Reason, gate
from baselines.load.sensors import STEP_S, Usable, stretches, usable
from records.measurement import Measurement

THINNED = 5  # every fifth sample enters the balance: its terms are smooth over 0.3 s


@dataclass(frozen=True)
class Window:
    """Mid time (s), samples `seen`, usable joints [2], whether anything moves, and why it is not used."""

    time_s: float
    seen: Seen
    joints: np.ndarray
    moving: bool
    reason: Reason | None

    @property
    def sliding(self) -> np.ndarray:
        """Joints [2] whose piston moves."""
        return np.asarray(self.seen.sliding[:, 0] > 0)


@dataclass(frozen=True)
class Terms:
    """A window's mean y [2] (N m) and h [2] (N m/kg)."""

    y: np.ndarray
    h: np.ndarray


def windows(recording: Measurement, overlap: bool = True) -> tuple[list[Window], Usable]:
    """All windows of a recording, each half a window after the last one (or a whole one)."""
    found = usable(recording)
    return [w for s in stretches(recording, found) for w in _cut(gate(s, found), overlap)], found


def _cut(gated: Gated, overlap: bool) -> Iterator[Window]:
    length = round(figures().load_estimate_window / STEP_S)
    for first in range(0, len(gated.stretch) - length + 1, length // 2 if overlap else length):
        yield _window(gated, slice(first, first + length))


def _window(gated: Gated, part: slice) -> Window:
    seen = gated.stretch.seen
    sliding, direction = seen.sliding[:, part], seen.direction[:, part]
    constant = (np.ptp(sliding, axis=1) == 0) & (np.ptp(direction, axis=1) == 0)
    joints = np.all(gated.usable[:, part], axis=1) & constant
    reason = next((r for r, m in gated.reasons.items() if r is not Reason.BETWEEN and np.any(m[part])), None)
    if reason is None and not np.any(joints):
        reason = Reason.BETWEEN
    thinned = {f.name: getattr(seen, f.name)[:, part][:, ::THINNED] for f in fields(Seen)}
    time = gated.stretch.start_s + STEP_S * (part.start + part.stop - 1) / 2
    return Window(time, Seen(**thinned), joints, bool(np.any(gated.moving[part])), reason)


def terms(window: Window, values: np.ndarray) -> Terms:
    """The window's balance with the unknowns at `values` [n]."""
    y, h = (np.asarray(r) for r in functions()[0](*window.seen.columns(), values))
    return Terms(y.mean(axis=1), h.mean(axis=1))


def slopes(window: Window, values: np.ndarray, load: float) -> np.ndarray:
    """d(y - h load)/d(unknowns) [2, n], averaged over the window."""
    found = np.asarray(functions()[1](*window.seen.columns(), values, load))
    return found.reshape(2, -1, len(unknowns())).mean(axis=1)
