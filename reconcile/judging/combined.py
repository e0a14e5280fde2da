"""Base parameters of which only combinations act: an inertia, a gain and a friction that are all free."""

from collections.abc import Sequence
from functools import lru_cache

import casadi as ca
import numpy as np

from reconcile import words
from reconcile.search.core import Core

POINTS = 64  # states and inputs at which slopes by the parameters are looked at
ALONE = 1e-9  # of the largest slope: a combination that changes less changes nothing
PART = 1e-3  # of a parameter, in such a combination


@lru_cache(1)
def combined(core: Core) -> list[tuple[str, ...]]:
    """Groups of parameters of which no recording tells each: what one changes, others can undo.

    Parameters that the model states well are not among them.
    """
    names = list(core.known(core.base))
    slopes = _slopes(core, names) if len(names) > 1 else np.empty((0, 0))
    if len(slopes) <= len(names):
        return []
    _, sizes, directions = np.linalg.svd(slopes / np.maximum(np.linalg.norm(slopes, axis=0), 1e-300))
    idle = directions[sizes < ALONE * sizes[0]]
    share = np.abs(idle.T @ idle)  # of a parameter in what changes nothing, together with another
    groups: dict[tuple[int, ...], None] = {}
    for i in range(len(names)):
        if share[i, i] > PART:
            groups[tuple(int(k) for k in np.flatnonzero(share[i] > PART))] = None
    return [tuple(names[i] for i in g) for g in groups if len(g) > 1]


def _slopes(core: Core, names: Sequence[str]) -> np.ndarray:
    """Slopes of rates and outputs by the parameters [rows, names], at drawn states and inputs."""
    model, rng = core.model, np.random.default_rng(0)
    x, u, m, p = model.symbols
    rows = ca.vertcat(model.f(x, u, m, p), model.h(x, u, m, p))
    by = ca.jacobian(rows, p)[:, [model.index("parameters", n) for n in names]]
    inputs = np.array([core.scales[v.name].u for v in model.inputs])
    values = np.array([core.base.values[v.name] for v in model.parameters])
    drawn = ca.Function("slopes", [x, u, m, p], [by]).map(POINTS)(
        core.kalman.scale[:, None] * rng.standard_normal((x.numel(), POINTS)),
        inputs[:, None] * rng.standard_normal((u.numel(), POINTS)),
        np.repeat(core.kalman.modes[0][:1].T, POINTS, 1),
        np.repeat(values[:, None], POINTS, 1),
    )
    found = np.asarray(ca.DM(drawn)).reshape(by.shape[0], POINTS, len(names)).reshape(-1, len(names))
    return found[np.isfinite(found).all(1)]


def sentence(groups: Sequence[Sequence[str]]) -> str:
    """What to state in the model, "" where nothing acts in combinations only."""
    said = (words.listed(list(g)) for g in groups)
    return "".join(f" Only combinations of {g} act: state one of them well." for g in said)
