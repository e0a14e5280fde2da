"""Reading curves between the rows of a simulation: Lagrange weights, and where the curves have kinks."""

import numpy as np

from reconcile.fit.windows import Window

ON_ROW = 1e-3  # of a step
NODES = 4


def straight(
    positions: np.ndarray, rows: int, kinks: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Linear weights at `positions` [n] (in rows): index [n, 2], weights, slopes by position.

    `kinks` change nothing: a line reaches over one step only.
    """
    first = np.clip(np.floor(positions).astype(int), 0, max(rows - 2, 0))
    t = np.clip(positions, 0.0, rows - 1.0) - first
    ones = np.ones_like(t)
    return first[:, None] + np.arange(2), np.stack([1.0 - t, t], axis=1), np.stack([-ones, ones], axis=1)


def interpolation(
    positions: np.ndarray, rows: int, kinks: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cubic Lagrange weights at `positions` [n] (in rows): index [n, 4], weights, slopes by position.

    Rows are taken from one side of `kinks` (sorted rows); parabolas between those
    that are two rows apart, and across them where they are closer.
    """
    at = np.clip(positions, 0.0, rows - 1.0)
    ends = np.unique(np.concatenate([[0], kinks, [max(rows - 1, 0)]])).astype(int)
    after = np.clip(np.searchsorted(ends, at - ON_ROW), 1, max(len(ends) - 1, 1))
    low, high = ends[after - 1], ends[np.minimum(after, len(ends) - 1)]
    near = high - low == 1
    low, high = np.where(near, 0, low), np.where(near, rows - 1, high)
    first = np.maximum(np.minimum(np.floor(at).astype(int) - 1, high - (NODES - 1)), low)
    weights, slopes = _lagrange(at - first, np.where(high - low == 2, NODES - 1, NODES))
    return first[:, None] + np.arange(NODES), weights, slopes


def _lagrange(t: np.ndarray, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights [n, 4] of rows 0 to 3 at t [n], of the first three only where `nodes` is 3, and slopes by t."""
    a, b, c, d = t, t - 1.0, t - 2.0, t - 3.0
    none = np.zeros_like(t)
    cubic = [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
    parabola = [b * c / 2.0, -a * c, a * b / 2.0, none]
    by_t = [
        -(c * d + b * d + b * c) / 6.0,
        (c * d + a * d + a * c) / 2.0,
        -(b * d + a * d + a * b) / 2.0,
        (b * c + a * c + a * b) / 6.0,
    ]
    by_t_of_three = [(b + c) / 2.0, -(a + c), (a + b) / 2.0, none]
    three = (nodes == NODES - 1)[:, None]
    return (
        np.where(three, np.stack(parabola, axis=1), np.stack(cubic, axis=1)),
        np.where(three, np.stack(by_t_of_three, axis=1), np.stack(by_t, axis=1)),
    )


def bends(window: Window) -> np.ndarray:
    """Rows of a window at which a recorded input changes, sorted; [] where changes lie between the rows."""
    changes = [s.time[1:][np.diff(s.values) != 0.0] for s in window.run.inputs.values()]
    at = (np.concatenate([np.empty(0), *changes]) - window.start_s) / window.step_s
    rows = np.unique(np.round(at[(at > -0.5) & (at < window.steps + 0.5)]))
    return rows if np.all(np.abs(at - np.round(at)) < ON_ROW) else np.empty(0)
