"""Initial states of windows, moved to where they fit best: each window by itself.

The projection (problem.py) takes initial states out to first order.  Where a model is far from linear in them
(chambers, spools, brakes), what is left after it is right only at initial states near the best ones; and one
window that has not found its own must not hold up the others.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reconcile.fit import beginning
from reconcile.fit.point import Linear, Look, Piece, Point
from reconcile.fit.problem import Problem

OPEN = 0.2  # of what a window leaves after projection: more left before it, and its state is settled
ROUNDS, FEW = 8, 2  # of a window; where sets are only ranked
TIGHTER = 10.0  # times as close as their freedom states are held, and again after a step that led astray
STUCK = 2.0  # times what the projection promised: so far above it, a window is tried from another start

_Errors = tuple[float, float, Look]  # squares before and after projection, and what a step is made of


def settle(
    problem: Problem, point: Point, linear: Linear, columns: Sequence[int], ranking: bool = False
) -> tuple[Point, Linear | None]:
    """The point with the initial states of open windows moved, and the problem linearised there.

    None of it if the model runs away.  `ranking`: a few steps will do, since sets are only ranked.
    """
    found = open_windows(linear)
    if not found:
        return point, linear
    x0 = point.x0.copy()
    for k in found:
        here = _known(linear.pieces[k])
        way = (problem, point, k, here)
        x0[k] = _window(*way, point.x0[k], FEW)[0] if ranking else _best(*way)
    point = replace(point, x0=x0)
    return point, problem.linear(point, columns, linear, found)


def open_windows(linear: Linear) -> list[int]:
    """Windows whose errors are well above what the projection leaves of them."""
    found = []
    for k, piece in enumerate(linear.pieces):
        raw, left, _ = _known(piece)
        if raw > (1.0 + OPEN) * left + 1.0:
            found.append(k)
    return found


def _best(problem: Problem, point: Point, k: int, here: _Errors) -> np.ndarray:
    """Initial state [NX] of window k from where it is; where that ends far off, from the outputs as well."""
    x0, left = _window(problem, point, k, here, point.x0[k])
    if left > STUCK * here[1] + STUCK:
        fresh = beginning.fresh(problem, point, k)
        other, there = _window(problem, point, k, _errors(problem, point, k, fresh), fresh)
        return other if there < left else x0
    return x0


def _window(
    problem: Problem, point: Point, k: int, here: _Errors | None, start: np.ndarray, rounds: int = ROUNDS
) -> tuple[np.ndarray, float]:
    """Initial state [NX] of window k after at most `rounds` damped Gauss-Newton steps, and squares there.

    `here`: the errors at the start.
    States are held near where they are, so that those that hardly show stay there; a step that led astray is
    made again shorter and with states held closer, so that one that shows well finds its place without them.
    """
    x0, share, held = start, 1.0, TIGHTER
    for _ in range(rounds if here else 0):
        raw, left, look = here  # type: ignore[misc]
        if raw <= (1.0 + 0.2 * OPEN) * left + 0.2 or share < 1e-3:
            break
        trial = x0.copy()
        trial[problem.common(point).active] += share * look.step(held)
        there = _errors(problem, point, k, trial)
        if there is None or there[0] >= raw:
            share, held = 0.3 * share, TIGHTER * held
            continue
        x0, here = trial, there
        share, held = min(1.0, 3.0 * share), max(TIGHTER, held / TIGHTER)
    return x0, np.inf if here is None else here[0]


def _known(piece: Piece) -> _Errors:
    """The errors of a window that is linearised."""
    e = piece.look.errors
    return float(e @ e), float(piece.errors @ piece.errors), piece.look


def _errors(problem: Problem, point: Point, k: int, x0: np.ndarray) -> _Errors | None:
    """Errors of window k from an initial state [NX]; None where the model runs away."""
    states = point.x0.copy()
    states[k] = x0
    at = replace(point, x0=states)
    run = problem.simulate(at, k, ())
    if run is None:
        return None
    e, slope = problem.compare(at, k, run)[1:]
    if problem.whiteners is not None:
        e, slope = problem.whiteners[k](e), problem.whiteners[k](slope)
    look = Look(e, slope, problem.common(point).loose)
    q = look.factors(0.0)[0]
    left = e - q @ (q.T @ e)
    return float(e @ e), float(left @ left), look
