"""Noise levels from recordings, and how many independent samples correlated errors are worth."""

from math import comb

import numpy as np

ORDER = 4  # of the differences: they take out motion up to a cubic over five samples


def high_pass_level(values: np.ndarray) -> float:
    """Standard deviation of white noise on a smooth signal, from its fourth differences (robust)."""
    if len(values) < 3 * ORDER:
        return 0.0
    differences = np.diff(values, ORDER)
    spread = np.median(np.abs(differences - np.median(differences))) / 0.6745
    return float(spread / np.sqrt(comb(2 * ORDER, ORDER)))


def quantum(values: np.ndarray) -> float:
    """Smallest step between different values, if the signal is made of such steps; else 0."""
    levels = np.unique(values)
    if len(levels) < 3 or len(levels) > 0.5 * len(values):
        return 0.0
    step = float(np.min(np.diff(levels)))
    off = np.abs((levels - levels[0]) / step - np.round((levels - levels[0]) / step))
    return step if np.max(off) < 0.05 else 0.0


def worth(residuals: list[np.ndarray]) -> float:
    """Share of samples that count as independent, from the autocorrelation of residuals by window.

    Sums the autocorrelation up to its first zero crossing (initial positive sequence): 1 for white ones.
    """
    longest = min(200, max((len(r) for r in residuals), default=0) // 3)
    total = sum(float(r @ r) for r in residuals)
    if total <= 0.0 or longest < 2:
        return 1.0
    summed = 1.0
    for lag in range(1, longest):
        rho = sum(float(r[lag:] @ r[:-lag]) for r in residuals if len(r) > lag) / total
        if rho <= 0.02:
            break
        summed += 2.0 * rho
    return 1.0 / summed
