"""How far open-loop predictions are off: mean absolute errors of speed and angle over 10 s (the paper's)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fmus.models.slew_nn.network import HISTORY, PERIOD_S, SlewNetwork
from learning.slew.trajectory import Windows

HORIZON = round(10.0 / PERIOD_S)  # rows ahead
STRIDE = round(1.0 / PERIOD_S)  # rows between the windows' beginnings
Predictor = Callable[[Windows], np.ndarray]  # windows -> speed [n, ahead] in rad/s, from what is before and u


@dataclass(frozen=True)
class Score:
    """Mean absolute errors of each window [n]; `owner` tells its recording."""

    velocity: np.ndarray  # deg/s
    position: np.ndarray  # deg, of the angle since the window's beginning
    owner: np.ndarray

    @property
    def velocity_mae(self) -> float:
        """Mean over all windows, deg/s."""
        return float(self.velocity.mean())

    @property
    def position_mae(self) -> float:
        """Mean over all windows, deg."""
        return float(self.position.mean())


def score(predict: Predictor, of: Windows) -> Score:
    """Predict all windows and compare; the measured angle is the running sum of the measured speed.

    The encoder's speed is late, its angle is not: summing the same late signal on both sides compares like
    with like.
    """
    error = np.degrees(predict(of) - of.omega[:, of.before :])
    angle = np.cumsum(error, axis=1) * PERIOD_S
    return Score(np.abs(error).mean(axis=1), np.abs(angle).mean(axis=1), of.owner)


def roll_out(network: SlewNetwork, of: Windows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(p_l, p_r, omega), each [n, ahead]: the network on its own predictions from the measured history on."""
    ahead = of.u.shape[1] - of.before
    past = {key: getattr(of, key)[:, of.before - HISTORY : of.before] for key in ("p_l", "p_r", "omega")}
    found = np.empty((3, len(of), ahead))
    for k in range(ahead):
        row = of.before + k
        now = network.predict(of.u[:, row - HISTORY + 1 : row + 1], **past, inertia=of.inertia[:, row - 1])
        for i, (key, value) in enumerate(zip(("p_l", "p_r", "omega"), now, strict=True)):
            past[key] = np.hstack([past[key][:, 1:], value[:, None]])
            found[i, :, k] = value
    return found[0], found[1], found[2]


def predictor(network: SlewNetwork) -> Predictor:
    """The network as a Predictor."""
    return lambda of: roll_out(network, of)[2]
