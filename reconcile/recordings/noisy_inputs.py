"""Inputs that were measured with noise, such as an effort by its current: recordings without that noise.

The model takes an input as it is recorded. Noise in it makes its gain look smaller than it is (errors in
variables), and everything that makes up for that looks like an effect.  A smoother that generalised
cross-validation chooses takes out what is white (D. Garcia, Comput. Stat. Data Anal. 54 (2010) 1167); whether
that is noise, and not a command that really jumps from sample to sample, only the outputs tell.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.fft import dct, idct
from scipy.optimize import minimize_scalar

from reconcile.recordings.data import Run, Signal
from reconcile.recordings.noise import high_pass_level

LEAST = 0.02  # of an input's spread: less noise takes less than a thousandth of a gain
HELD = 0.2  # share of samples that repeat the one before: such an input is a command that was held
WHITE = 0.25  # most correlation of neighbours in what is taken out: more is motion, not noise
UNEVEN = 1.5  # longest step, in usual ones: a longer one has no sample to smooth
LEAST_SAMPLES = 30
STIFFEST = 12.0  # log10 of the weight of second differences: beyond it only a straight line is left


def noisy(runs: Sequence[Run]) -> list[str]:
    """Inputs that look as if they were measured with noise."""
    names = dict.fromkeys(n for r in runs for n in r.inputs)
    return [n for n in names if all(_measured(r.inputs[n]) for r in runs if n in r.inputs)]


def smoothed(runs: Sequence[Run], name: str, unit: str) -> list[Run]:
    """The runs with one input smoothed, and a note of it."""
    return [_smoothed(r, name, unit) if name in r.inputs else r for r in runs]


def _smoothed(run: Run, name: str, unit: str) -> Run:
    signal = run.inputs[name]
    smooth = _smooth(signal.values)
    note = f"noise of {np.std(signal.values - smooth):.3g} {unit} is taken out of {name}".replace("  ", " ")
    inputs = {**run.inputs, name: Signal(signal.time, smooth)}
    return replace(run, inputs=inputs, notes=(*run.notes, note))


def _measured(signal: Signal) -> bool:
    """Whether enough in an input is white, and its samples stand by themselves."""
    values, steps, spread = signal.values, np.diff(signal.time), float(np.std(signal.values))
    if len(values) < LEAST_SAMPLES or spread == 0.0 or high_pass_level(values) < LEAST * spread:
        return False
    if np.mean(np.diff(values) == 0.0) > HELD or steps.max() > UNEVEN * np.median(steps):
        return False
    noise = values - _smooth(values)
    return bool(np.std(noise) >= LEAST * spread and abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) <= WHITE)


def _smooth(values: np.ndarray) -> np.ndarray:
    """Values [n] at even steps with second differences as small as generalised cross-validation asks."""
    n, waves = len(values), np.asarray(dct(values, norm="ortho"))
    bent = (2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n)) ** 2

    def kept(log: float) -> np.ndarray:
        return 1.0 / (1.0 + 10.0**log * bent)

    def score(log: float) -> float:
        share = kept(log)
        return float(np.log(np.sum(((1.0 - share) * waves) ** 2)) - 2.0 * np.log(n - np.sum(share)))

    found: Any = minimize_scalar(score, bounds=(-2.0, STIFFEST), method="bounded")
    return np.asarray(idct(kept(found.x) * waves, norm="ortho"))
