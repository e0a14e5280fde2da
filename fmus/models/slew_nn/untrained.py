"""Slew networks with random weights, for tests and for measuring speed; they describe no machine.

python -m fmus.models.slew_nn.untrained [FILE] [SEED]    writes a small one
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fmus.models.slew_nn.network import HISTORY, INPUTS, Mlp, SlewNetwork

PRESSURE_LAYERS, VELOCITY_LAYERS = (128, 128, 128, 128, 32), (128, 128, 128, 32)  # the paper's
SMALL = (16,)
PRESSURE, SPEED, INERTIA = (6e6, 5e6), (0.0, 0.3), (4e5, 1.5e5)  # mean and deviation: Pa, rad/s, kg m2
GAIN = 0.6  # of a network on its own predictions: below 1, so that roll-outs stay bounded


def untrained(
    seed: int,
    pressure: Sequence[int] = SMALL,
    velocity: Sequence[int] = SMALL,
    members: int = 1,
    symmetric: bool = False,
    residual: bool = False,
) -> SlewNetwork:
    """A network with hidden layers of these widths; the same seed gives the same weights."""
    rng = np.random.default_rng(seed)
    return SlewNetwork(
        tuple(_mlp(rng, [INPUTS, *pressure, 2], PRESSURE, residual) for _ in range(members)),
        tuple(_mlp(rng, [INPUTS, *velocity, 1], SPEED, residual) for _ in range(members)),
        symmetric,
        meta={"origin": f"random weights, seed {seed}: describes no machine"},
    )


def _mlp(rng: np.random.Generator, sizes: Sequence[int], out: tuple[float, float], residual: bool) -> Mlp:
    shapes = list(zip(sizes[1:], sizes[:-1], strict=True))
    weights = tuple(rng.normal(0, GAIN * np.sqrt(2 / s[1]), s).astype(np.float32) for s in shapes)
    biases = tuple(rng.normal(0, 0.1, n).astype(np.float32) for n in sizes[1:])
    scales = [(0.0, 0.5), PRESSURE, PRESSURE, SPEED]
    mean, deviation = (np.append(np.repeat([s[i] for s in scales], HISTORY), INERTIA[i]) for i in (0, 1))
    share = 0.02 if residual else 1.0  # changes are small beside values
    mean_out = np.full(sizes[-1], 0.0 if residual else out[0])
    return Mlp(weights, biases, mean, deviation, mean_out, np.full(sizes[-1], share * out[1]), residual)


if __name__ == "__main__":
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("weights.npz")
    untrained(int(sys.argv[2]) if len(sys.argv) > 2 else 1).save(file)
