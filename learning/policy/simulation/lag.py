"""A slew drive as an engineer would sketch it, as a network: dead band, delay, lag, limited acceleration.

    w[k] = w[k-1] + clip(c (W(u[k-d]) - w[k-1]), -a, a),   W(u) = g (max(u - b, 0) - max(-u - b, 0))

with a = a0 - a1 I, a straight line in the place of torque over inertia.  Its two layers of ReLU are exact, so
that it runs wherever a trained network does.  Nobody's recordings are in it: a policy that was trained on
networks is held against it as a machine that it does not know (learning/policy/worst.py).
"""

import numpy as np

from fmus.models.slew_nn.network import HISTORY, INPUTS, PERIOD_S, Mlp, SlewNetwork

U, SPEED, INERTIA = HISTORY - 1, 4 * HISTORY - 1, INPUTS - 1  # newest values among the inputs
MOST_INERTIA, UNIT = 1.4e6, 1e6  # kg m2


def lag(
    delay: int = 2, dead_band: float = 0.11, gain: float = 0.85, lag_s: float = 0.3, reach: float = 0.035
) -> SlewNetwork:
    """`delay` in periods, `gain` in rad/s per joystick, `reach`: rad/s in a period without inertia."""
    first, offsets = np.zeros((5, INPUTS)), np.zeros(5)
    first[0, U - delay], first[1, U - delay], offsets[:2] = 1.0, -1.0, -dead_band
    first[2, SPEED], first[3, SPEED], first[4, INERTIA] = 1.0, -1.0, 1.0
    share, slope = PERIOD_S / lag_s, 0.75 * reach * UNIT / MOST_INERTIA
    towards = share * np.array([gain, -gain, -1.0, 1.0, 0.0])
    room = np.array([0.0, 0.0, 0.0, 0.0, -slope])
    second = np.stack([towards + room, towards - room, room])
    speed = _net([first, second, np.array([[1.0, -1.0, -1.0]])], [offsets, [reach, -reach, reach], [0.0]])
    still = _net([np.zeros((1, INPUTS)), np.zeros((2, 1))], [[0.0], [0.0, 0.0]])
    return SlewNetwork((still,), (speed,))


def _net(weights: list[np.ndarray], biases: list[object]) -> Mlp:
    scale = np.ones(INPUTS)
    scale[INERTIA] = UNIT
    outputs = len(weights[-1])
    return Mlp(
        tuple(np.asarray(w, np.float32) for w in weights), tuple(np.asarray(b, np.float32) for b in biases),
        np.zeros(INPUTS), scale, np.zeros(outputs), np.ones(outputs), residual=True,
    )  # fmt: skip
