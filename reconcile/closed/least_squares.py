"""Parameters that a fit of a closed FMU moves, and how well it knows them."""

from dataclasses import dataclass

import numpy as np

UNTOLD = 1e-12  # of a parameter's own information: no direction is told less


@dataclass(frozen=True)
class Free:
    """A parameter that a fit moves: bounds, a size for its steps, and a prior where it has one."""

    name: str
    low: float
    high: float
    size: float
    prior: tuple[float, float] | None = None  # mean and standard deviation


def covariance_of(information: np.ndarray) -> np.ndarray:
    """Covariance [K, K] of parameters, for errors of unit variance, of the information [K, K] on them.

    What nothing tells (one load as two effects) is not known, where a pseudo-inverse would call it certain.
    """
    own = np.diag(information)
    scale = np.sqrt(np.where(own > 0.0, own, 1.0))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    return (vectors / np.maximum(values, UNTOLD)) @ vectors.T / np.outer(scale, scale)
