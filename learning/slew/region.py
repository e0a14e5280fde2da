"""Where a model's training data was, in slew inertia, joystick and speed: it travels with the weights."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from fmus.models.slew_nn.network import CELL_AXES, SlewNetwork
from learning.slew.trajectory import Trajectory, Windows, both_ways

LEAST = 3  # samples that make a cell known


def with_region(network: SlewNetwork, trajectories: Iterable[Trajectory], mirror: bool) -> SlewNetwork:
    """The network with the ranges and the map of what it was trained on."""
    chosen = list(both_ways(trajectories) if mirror else trajectories)
    whole = {name: np.concatenate([getattr(t, name) for t in chosen]) for name in ("p_l", "p_r", *CELL_AXES)}
    region = {name: (float(values.min()), float(values.max())) for name, values in whole.items()}
    region["inertia"] = _widened(*region["inertia"])
    edges = [np.linspace(*region[name], count + 1) for name, count in CELL_AXES.items()]
    counts, _ = np.histogramdd(np.stack([whole[name] for name in CELL_AXES], axis=1), edges)
    return replace(network, region=region, visited=counts >= LEAST)


def _widened(low: float, high: float) -> tuple[float, float]:
    """A range that is one even when every recording had the same inertia."""
    return (low, high) if high > 1.001 * low else (0.99 * low, 1.01 * high)


def share_outside(network: SlewNetwork, of: Windows) -> float:
    """Share of predicted instants of the windows that lie where the network saw no data."""
    ahead = slice(of.before, None)
    return float(network.outside(of.inertia[:, ahead], of.u[:, ahead], of.omega[:, ahead]).mean())
