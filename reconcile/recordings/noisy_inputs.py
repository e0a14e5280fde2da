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
    return [n for n in names if all(_noise(r.inputs[n]) is not None for r in runs if n in r.inputs)]


def without_noise(runs: Sequence[Run], name: str, unit: str) -> list[Run]:
    """The runs with one input smoothed, and a note of it."""
    return [_smoothed(r, name, unit) if name in r.inputs else r for r in runs]


def _smoothed(run: Run, name: str, unit: str) -> Run:
    signal = run.inputs[name]
    noise = _noise(signal)
    if noise is None:
        return run
    note = f"noise of {np.std(noise):.3g} {unit} is taken out of {name}".replace("  ", " ")
    inputs = {**run.inputs, name: Signal(signal.time, signal.values - noise)}
    return replace(run, inputs=inputs, notes=(*run.notes, note))


def _noise(signal: Signal) -> np.ndarray | None:
    """What is white in an input [n]; None where it is little, or its samples do not stand by themselves."""
    time, values = signal.time, signal.values
    spread = float(np.std(values))
    if len(values) < LEAST_SAMPLES or high_pass_level(values) < LEAST * spread or spread == 0.0:
        return None
    if np.mean(np.diff(values) == 0.0) > HELD:
        return None
    steps = np.diff(time)
    if steps.max() > UNEVEN * np.median(steps):
        return None
    noise = values - _smooth(values)
    level = float(np.std(noise))
    if level < LEAST * spread or abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) > WHITE:
        return None
    return noise


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
