"""A loop cut at the slew joystick, from what was measured: how much more gain and delay it bears.

The share of a sine in a controller's answer over its share in the joystick is the loop's gain and phase at
that frequency, for that amplitude (a describing function: dead bands and limits are in it).  Where the answer
is in phase with the joystick, the loop swings by itself if the answer is larger.  A drive with k times the
gain has k times the loop's gain, and one that is t later 360 f t degrees less phase, so that margins of gain
and delay are in the same figures.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from specs.scenario import TICK_S

FREQUENCIES_HZ = tuple(round(float(f), 3) for f in np.geomspace(0.3, 3.0, 25))
SETTLE_S = 6.0  # of a run that is left out
FAST_HZ = 1.0  # no motion that is wanted is faster


@dataclass(frozen=True)
class Loop:
    """Answer over joystick, complex [n], at rising frequencies [n, Hz]; real and above 1: the loop swings."""

    answers: np.ndarray
    frequencies: Sequence[float] = FREQUENCIES_HZ

    @cached_property
    def in_phase(self) -> tuple[float, float] | None:
        """(frequency [Hz], gain) where the answer is in phase with the joystick: the largest, if any."""
        found = []
        for k, (size, phase, turned) in enumerate(self._steps):
            if phase * (phase + turned) <= 0.0 and turned:
                way = -phase / turned
                found.append((math.exp(size[0] + way * (size[1] - size[0])), self._between(k, way)))
        return max(found)[::-1] if found else None

    @property
    def _steps(self) -> Iterator[tuple[tuple[float, float], float, float]]:
        """From each frequency to the next: both logs of the gain, the phase [rad] and by what it turns."""
        size, phase = np.log(np.abs(self.answers) + 1e-12), np.angle(self.answers)
        for k in range(len(size) - 1):
            turned = (phase[k + 1] - phase[k] + np.pi) % (2 * np.pi) - np.pi
            yield (float(size[k]), float(size[k + 1])), float(phase[k]), float(turned)

    @property
    def fastest(self) -> tuple[float, float]:
        """(frequency [Hz], gain) of the largest answer from FAST_HZ on."""
        return max(
            ((f, float(abs(a))) for f, a in zip(self.frequencies, self.answers, strict=True) if f >= FAST_HZ),
            key=lambda row: row[1],
        )

    @property
    def swings(self) -> bool:
        """Whether it swings by itself at this amplitude, and so grows from it."""
        return self.in_phase is not None and self.in_phase[1] > 1.0

    @property
    def gain_margin(self) -> float:
        """By how much more gain the loop swings by itself; infinite where it is never in phase."""
        return 1.0 / self.in_phase[1] if self.in_phase else math.inf

    @cached_property
    def delay_margin_s(self) -> float:
        """By how much more delay it swings by itself; infinite where no answer is so large."""
        if self.swings:
            return 0.0
        found = [math.inf]
        for k, (size, phase, turned) in enumerate(self._steps):
            ways = [0.0] * (size[0] >= 0.0)
            if size[0] * size[1] < 0.0:
                ways.append(size[0] / (size[0] - size[1]))
            found += [
                (phase + w * turned) % (2 * math.pi) / (2 * math.pi * self._between(k, w)) for w in ways
            ]
        return min(found)

    def as_dict(self) -> dict[str, Any]:
        """For JSON: gain and phase [deg] of the loop as negative feedback, margins."""
        phase = np.degrees(np.unwrap(np.angle(-self.answers)))
        return {
            "frequency_hz": list(self.frequencies),
            "gain": np.abs(self.answers).tolist(),
            "phase_deg": phase.tolist(),
            "in_phase": dict(zip(("frequency_hz", "gain"), self.in_phase, strict=True))
            if self.in_phase
            else None,
            "fastest": dict(zip(("frequency_hz", "gain"), self.fastest, strict=True)),
            "gain_margin": self.gain_margin,
            "delay_margin_s": self.delay_margin_s,
            "swings": self.swings,
        }

    def _between(self, k: int, way: float) -> float:
        """The frequency part of the way from number k to the next."""
        return self.frequencies[k] * (self.frequencies[k + 1] / self.frequencies[k]) ** way


def share(u: np.ndarray, frequency_hz: float, settle_s: float = SETTLE_S) -> complex:
    """The complex share of a sine in a signal [n], one value a tick, beside its mean and drift.

    The first `settle_s` are left out; what is kept should be two periods of the sine or more.
    """
    time = np.arange(len(u)) * TICK_S
    kept = time >= settle_s
    t, window = time[kept], np.sqrt(np.hanning(int(kept.sum())))
    turn = 2 * np.pi * frequency_hz * t
    basis = np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(t), t - t.mean()]) * window[:, None]
    a, b, *_ = np.linalg.lstsq(basis, u[kept] * window, rcond=None)[0]
    return complex(a, -b)
