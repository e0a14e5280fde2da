"""The smoother of Rauch, Tung and Striebel (AIAA J. 3 (1965) 1445): states as a whole record tells them."""

from collections.abc import Mapping

import numpy as np

KNOWN = 1e-150  # variance: what stands is known ever better, and its inverse would overflow


def smoothed(run: Mapping[str, np.ndarray], columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and disturbances [n, NX + NW] and their variances, backwards through what a filter kept.

    `columns`: where the filter's own columns (active states, disturbances) lie among all.
    """
    z, v = run["z"].copy(), run["v"].copy()
    phi, before, after, ahead = (run[n] for n in ("phi", "before", "after", "ahead"))
    if len(z) < 2:
        return z, v
    scale = np.sqrt(np.maximum(np.diagonal(before[1:], axis1=1, axis2=2), KNOWN))
    size = (
        scale[:, :, None] * scale[:, None, :]
    )  # scaled: pressures in Pa and angles in rad stand in one matrix
    inverse = np.linalg.pinv(before[1:] / size, rcond=1e-12, hermitian=True) / size
    gains = after[:-1] @ phi[1:].transpose(0, 2, 1) @ inverse
    state, spread = z[-1, columns], after[-1]
    for k in range(len(z) - 2, -1, -1):
        state = z[k, columns] + gains[k] @ (state - ahead[k + 1])
        spread = after[k] + gains[k] @ (spread - before[k + 1]) @ gains[k].T
        z[k, columns], v[k, columns] = state, np.maximum(np.diag(spread), 0.0)
    return z, v
