"""Inputs that were measured with noise, such as an effort by its current: recordings without that noise.

The model takes an input as it is recorded. Noise in it makes its gain look smaller than it is (errors in
variables), and everything that makes up for that looks like an effect.  The smoothing spline of generalised
cross-validation takes out what is white; whether that is noise, and not a command that really jumps from
sample to sample, only the outputs tell.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import make_smoothing_spline

from reconcile.recordings.data import Run, Signal
from reconcile.recordings.noise import high_pass_level

LEAST = 0.02  # of an input's spread: less noise takes less than a thousandth of a gain
HELD = 0.2  # share of samples that repeat the one before: such an input is a command that was held
WHITE = 0.25  # most correlation of neighbours in what is taken out: more is motion, not noise
LEAST_SAMPLES = 30


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
    unit = (time - time[0]) / signal.period_s
    noise = values - make_smoothing_spline(unit, values / spread)(unit) * spread
    level = float(np.std(noise))
    if level < LEAST * spread or abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) > WHITE:
        return None
    return noise
