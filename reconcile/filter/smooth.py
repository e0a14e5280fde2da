"""The smoother of Rauch, Tung and Striebel (AIAA J. 3 (1965) 1445): states as a whole record tells them."""

from collections.abc import Mapping

import numpy as np


def smoothed(run: Mapping[str, np.ndarray], columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and disturbances [n, NX + NW] and their variances, backwards through what a filter kept.

    `columns`: where the filter's own columns (active states, disturbances) lie among all.
    """
    z, v = run["z"].copy(), run["v"].copy()
    phi, before, after, ahead = (run[n] for n in ("phi", "before", "after", "ahead"))
    state, spread = z[-1, columns], after[-1]
    for k in range(len(z) - 2, -1, -1):
        scale = np.sqrt(np.maximum(np.diag(before[k + 1]), 1e-300))
        # scaled: pressures in Pa and angles in rad stand in one matrix
        inverse = np.linalg.pinv(before[k + 1] / np.outer(scale, scale), rcond=1e-12, hermitian=True)
        gain = after[k] @ phi[k + 1].T @ (inverse / np.outer(scale, scale))
        state = z[k, columns] + gain @ (state - ahead[k + 1])
        spread = after[k] + gain @ (spread - before[k + 1]) @ gain.T
        z[k, columns], v[k, columns] = state, np.maximum(np.diag(spread), 0.0)
    return z, v
