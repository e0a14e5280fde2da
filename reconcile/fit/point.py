"""A point of the fit, and the problem linearised there, window by window."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import lapack

from reconcile.model import Attached


@dataclass(frozen=True)
class Point:
    """Parameters [NP] and initial states [windows, NX]; `present`: the effects that are switched on."""

    p: np.ndarray
    x0: np.ndarray
    present: tuple[Attached, ...] = ()


@dataclass(frozen=True)
class Look:
    """Errors [N] of a window and slopes [N, states] at an initial state; `loose`: one over its freedom."""

    errors: np.ndarray
    slope: np.ndarray
    loose: np.ndarray

    def factors(self, held: float) -> tuple[np.ndarray, np.ndarray]:
        """Q [N, states] and R of the slopes with the states held `held` times as close, too."""
        q, r = np.linalg.qr(np.vstack([self.slope, np.diag(self.loose * (1.0 + held))]))
        return q[: len(self.errors)], r

    def step(self, held: float) -> np.ndarray:
        """Step [states] of the initial state."""
        q, r = self.factors(held)
        return back(r, q.T @ self.errors)


@dataclass(frozen=True)
class Piece:
    """One window linearised: what `Linear` has of all; `look`: errors and slopes before projection."""

    errors: np.ndarray
    slopes: np.ndarray
    raw: dict[str, np.ndarray]
    step: tuple[np.ndarray, np.ndarray]
    states: np.ndarray
    look: Look
    price: float


@dataclass(frozen=True)
class Linear:
    """Errors [M] and slopes [M, K] after projection, whitened; `raw`: errors by window and output.

    `raw` is in units of the sensors' noise.
    `price`: twice what hidden states of effects, free in every window, cost in marginal log-likelihood.
    `steps`: what turns a change of the parameters [K] into that of the initial states, per window.
    """

    errors: np.ndarray
    slopes: np.ndarray
    raw: list[dict[str, np.ndarray]]
    steps: list[tuple[np.ndarray, np.ndarray]]
    states: list[np.ndarray]
    price: float
    pieces: tuple[Piece, ...]

    @property
    def cost(self) -> float:
        """Sum of squares of the projected errors."""
        return float(self.errors @ self.errors)

    @cached_property
    def left(self) -> list[dict[str, np.ndarray]]:
        """The projected errors by window and output."""
        return [_apart(p.errors, p.raw) for p in self.pieces]


def joined(pieces: Sequence[Piece]) -> Linear:
    """The whole problem from its windows."""
    return Linear(
        np.concatenate([p.errors for p in pieces]),
        np.vstack([p.slopes for p in pieces]),
        [p.raw for p in pieces],
        [p.step for p in pieces],
        [p.states for p in pieces],
        sum(p.price for p in pieces),
        tuple(pieces),
    )


def projected(
    e: np.ndarray, slope: np.ndarray, loose: np.ndarray, own: int, raw: dict[str, np.ndarray], x: np.ndarray
) -> Piece:
    """A window freed of what its initial states could explain.

    `e` [N] and `slope` [N, states + columns] whitened, `loose` one over the freedom of each state, `own` how
    many of them are the model's, `raw` the errors by output, `x` the states along the window.
    """
    n = len(loose)
    look = Look(e, slope[:, :n].copy(), loose)  # kept with every fit, which all columns need not be
    q, r = look.factors(0.0)
    price = 2.0 * float(np.sum(np.log(np.abs(np.diag(r)[own:]) / loose[own:])))
    e_in, p_in = q.T @ e, q.T @ slope[:, n:]
    step = (back(r, e_in), back(r, p_in))
    return Piece(e - q @ e_in, slope[:, n:] - q @ p_in, raw, step, x, look, price)


def freed(slope: np.ndarray, loose: np.ndarray) -> np.ndarray:
    """Slopes [N, columns] of a window's slopes [N, states + columns], freed as `projected` does."""
    n = len(loose)
    q = np.linalg.qr(np.vstack([slope[:, :n], np.diag(loose)]))[0][: len(slope)]
    return slope[:, n:] - q @ (q.T @ slope[:, n:])


def back(r: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Solution of r x = b, r upper triangular and regular: what solve_triangular does, without its checks."""
    return lapack.dtrtrs(r, b)[0]  # type: ignore[attr-defined]


def _apart(e: np.ndarray, like: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Errors of a window one output after the other -> by output."""
    ends = np.cumsum([len(v) for v in like.values()])[:-1]
    return dict(zip(like, np.split(e, ends), strict=True))
