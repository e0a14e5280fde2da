"""A point of the fit, and the problem linearised there."""

from dataclasses import dataclass

import numpy as np

from reconcile.model import Attached


@dataclass(frozen=True)
class Point:
    """Parameters [NP] and initial states [windows, NX]; `present`: the effects that are switched on."""

    p: np.ndarray
    x0: np.ndarray
    present: tuple[Attached, ...] = ()


@dataclass(frozen=True)
class Linear:
    """Errors [M] and slopes [M, K] after projection, whitened; `raw`: errors by window and output.

    `white`: errors by window and output in whitened form, `raw` in units of the sensors' noise.
    `price`: twice what hidden states of effects, free in every window, cost in marginal log-likelihood.
    `steps`: what turns a change of the parameters [K] into that of the initial states, per window.
    """

    errors: np.ndarray
    slopes: np.ndarray
    raw: list[dict[str, np.ndarray]]
    steps: list[tuple[np.ndarray, np.ndarray]]
    states: list[np.ndarray]
    white: list[dict[str, np.ndarray]]
    price: float = 0.0

    @property
    def cost(self) -> float:
        """Sum of squares of the projected errors."""
        return float(self.errors @ self.errors)
