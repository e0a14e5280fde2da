"""Excitations: steps, sines, multisines, ramps, chirps and random commands, all within -1 .. 1."""

import numpy as np

from blindtest.systems.system import STEP

KINDS = ("steps", "sine", "multisine", "ramps", "chirp", "random")


def signal(kind: str, samples: int, rng: np.random.Generator) -> np.ndarray:
    """A signal of a kind, [samples] within -1 .. 1, at rest over its first fifth of a second."""
    t = np.arange(samples) * STEP
    values = {
        "steps": _steps,
        "sine": _sine,
        "multisine": _multisine,
        "ramps": _ramps,
        "chirp": _chirp,
        "random": _random,
    }[kind](t, rng)
    values[t < 0.2] = 0.0
    return np.clip(values, -1.0, 1.0)


def _levels(t: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Times of change and levels of alternating sign, so that an axis does not run away."""
    holds = rng.uniform(0.4, 2.0, size=int(t[-1] / 0.4) + 2)
    signs = np.where(np.arange(len(holds)) % 2, 1.0, -1.0) * rng.choice([-1.0, 1.0])
    levels = signs * rng.uniform(0.15, 1.0, size=len(holds))
    return np.cumsum(holds), np.where(rng.random(len(holds)) < 0.2, 0.0, levels)


def _steps(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    times, levels = _levels(t, rng)
    return levels[np.searchsorted(times, t, side="right")]


def _ramps(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    times, levels = _levels(t, rng)
    return np.interp(t, times, levels, left=0.0)


def _sine(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    envelope = 0.3 + 0.7 * np.abs(np.sin(np.pi * t / t[-1] * rng.uniform(0.5, 1.5)))
    return envelope * np.sin(2 * np.pi * rng.uniform(0.15, 0.6) * t)


def _multisine(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    lines = [np.sin(2 * np.pi * (f * t + rng.random())) for f in np.geomspace(0.08, 1.5, 8)]
    whole = np.sum(lines, axis=0)
    return whole / np.abs(whole).max() * rng.uniform(0.6, 1.0)


def _chirp(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    low, high = 0.1, rng.uniform(1.0, 2.0)
    return rng.uniform(0.5, 1.0) * np.sin(2 * np.pi * (low * t + 0.5 * (high - low) * t * t / t[-1]))


def _random(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """White noise through two lags of a drawn time constant."""
    keep = np.exp(-STEP / rng.uniform(0.15, 0.5))
    whole = rng.standard_normal(len(t))
    for _ in range(2):
        state = 0.0
        for k in range(len(whole)):
            state = keep * state + (1.0 - keep) * whole[k]
            whole[k] = state
    return whole / np.abs(whole).max() * rng.uniform(0.6, 1.0)
