"""Whitening: residuals in units of what noise and disturbance can do, so that lambda compares with a
likelihood.

A run's residual has the covariance C = S^2 + R R', S the sensors' deviations and R the responses of the
outputs to the disturbance, one column a cosine of its expansion (scaled to its deviation).  C^(-1/2) is
applied through the singular values of S^-1 R.  Noise on recorded inputs, which a replay on the recording
feels, adds columns of its own: the responses to some draws of it.

The first half second of a run does not count.  The generator's machine begins there, in motion, with lines
and memories that know of nothing before; no machine does, and what that tells is no effect's doing.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

BEGINNING = 25  # samples of a run that do not count
LINES = 48  # cosines of the disturbance in a run of 20 s: up to 1.2 Hz


@dataclass(frozen=True)
class Whitening:
    """Of one run: deviation of the outputs [outputs] and the directions that the disturbance fills."""

    deviation: np.ndarray
    directions: np.ndarray  # [(n - BEGINNING) outputs, columns], orthonormal
    shrink: np.ndarray  # [columns]: 1 - 1 / sqrt(1 + s^2)

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Residual [n, outputs] in whitened form [(n - BEGINNING) outputs]."""
        flat = (residual[BEGINNING:] / self.deviation).ravel()
        return flat - self.directions @ (self.shrink * (self.directions.T @ flat))


def cosines(samples: int) -> np.ndarray:
    """The first orthonormal cosines of a run, [LINES, samples]."""
    k, j = np.arange(samples) + 0.5, np.arange(LINES)[:, None]
    found = np.sqrt(2.0 / samples) * np.cos(np.pi * j * k / samples)
    found[0] /= np.sqrt(2.0)
    return found


def whitening(
    deviation: np.ndarray,
    responses: Sequence[Callable[[np.ndarray], np.ndarray]],
    spectrum: np.ndarray,
    shaken: Sequence[np.ndarray],
) -> Whitening:
    """From the linear responses of the outputs [n, outputs] to small disturbances [n], one a disturbance.

    `shaken`: further changes of the outputs, each a column of the covariance's root.
    """
    shapes = cosines(len(shaken[0]))
    columns = [
        (np.sqrt(power) * response(shape) / deviation)[BEGINNING:].ravel()
        for response in responses
        for shape, power in zip(shapes, spectrum, strict=True)
    ]
    columns += [(change / deviation)[BEGINNING:].ravel() for change in shaken]
    directions, values, _ = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
    return Whitening(deviation, directions, 1.0 - 1.0 / np.sqrt(1.0 + values**2))
