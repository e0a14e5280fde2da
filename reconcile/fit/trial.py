"""A step of a fit tried: new parameters, and initial states moved with them as far as that holds.

What the projection (problem.py) says of initial states is right near them only.  Of a state that hardly shows
(a spool within its dead band, a chamber at rest) it may ask for a step of many times its size, which leads
elsewhere: where the whole step would be given up for it, such a window is moved by what the parameters ask
for alone, or not at all.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reconcile.fit.point import Linear, Piece, Point, joined
from reconcile.fit.problem import Problem

ASTRAY = 2.0  # times what a window left before the step, and as many squares more


def tried(
    problem: Problem, point: Point, linear: Linear, p: np.ndarray, share: float, columns: Sequence[int]
) -> tuple[Point, Linear | None]:
    """The point with parameters p [NP], and the problem linearised there; None of it if the model runs away.

    `linear` is the problem at `point`; `share`: of the way that the initial states would go by themselves.
    """
    change, active = p[list(columns)] - point.p[list(columns)], problem.common(point).active
    x0, pieces = point.x0.copy(), list[Piece | None](linear.pieces)
    still = range(len(pieces))
    for own, by in ((share, 1.0), (0.0, 1.0), (0.0, 0.0)):
        for k in still:
            steps = linear.pieces[k].step
            x0[k, active] = point.x0[k, active] + own * steps[0] - by * (steps[1] @ change)
        at = replace(point, p=p, x0=x0)
        for k in still:
            pieces[k] = problem.piece(at, k, columns)
        if _cost(pieces) < linear.cost:
            break
        still = [k for k in still if _astray(pieces[k], linear.pieces[k])]
    kept = [x for x in pieces if x is not None]
    return at, joined(kept) if len(kept) == len(pieces) else None


def _astray(piece: Piece | None, before: Piece) -> bool:
    """Whether a window is far worse off than before the step."""
    return _cost((piece,)) > ASTRAY * _cost((before,)) + ASTRAY


def _cost(pieces: Sequence[Piece | None]) -> float:
    """Sum of squares of the projected errors; infinite where the model runs away."""
    return sum(np.inf if x is None else float(x.errors @ x.errors) for x in pieces)
