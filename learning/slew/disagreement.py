"""Ensembles: the mean of several networks, which is not to be trusted where they part."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fmus.models.slew_nn.network import SlewNetwork
from learning.slew.score import predictor, roll_out, score
from learning.slew.trajectory import Windows

QUANTILE = 0.9  # of the validation windows' disagreement: above it, a window is warned about


def ensemble(networks: Sequence[SlewNetwork]) -> SlewNetwork:
    """The networks as one; they must have been trained on the same recordings (its region is kept)."""
    pressure = tuple(net for network in networks for net in network.pressure)
    velocity = tuple(net for network in networks for net in network.velocity)
    return replace(networks[0], pressure=pressure, velocity=velocity)


def members(network: SlewNetwork) -> list[SlewNetwork]:
    """Each member as a model of its own."""
    pairs = zip(network.pressure, network.velocity, strict=True)
    return [replace(network, pressure=(p,), velocity=(v,)) for p, v in pairs]


def disagreement(network: SlewNetwork, of: Windows) -> np.ndarray:
    """Deviation of the members' open-loop speeds, mean over each window: [n], deg/s; 0 for one member."""
    speeds = [roll_out(member, of)[2] for member in members(network)]
    return np.degrees(np.std(speeds, axis=0)).mean(axis=1)


def limit(network: SlewNetwork, validation: Windows) -> float:
    """The disagreement above which to warn, deg/s."""
    return float(np.quantile(disagreement(network, validation), QUANTILE))


def figures(network: SlewNetwork, of: Windows, above: float) -> dict[str, float]:
    """Share of windows warned about; the mean speed error of these and of the others, deg/s."""
    warned = disagreement(network, of) > above
    error = score(predictor(network), of).velocity
    means = {
        name: float(error[w].mean()) if w.any() else 0.0
        for name, w in (("warned", warned), ("others", ~warned))
    }
    return {
        "share_warned": float(warned.mean()),
        "error_warned": means["warned"],
        "error_others": means["others"],
    }
