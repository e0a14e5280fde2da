"""The sketched drive is its own equation, and runs beside trained networks."""

import numpy as np
import pytest
import torch

from learning.policy.simulation.drive import Drive
from learning.policy.simulation.lag import lag


def equation(u: float, w: float, inertia: float) -> float:
    """The docstring's formula with the default numbers."""
    wanted = 0.85 * (max(u - 0.11, 0.0) - max(-u - 0.11, 0.0))
    room = 0.035 * (1.0 - 0.75 * inertia / 1.4e6)
    return w + min(max((wanted - w) / 3.0, -room), room)


@pytest.mark.parametrize(("u", "w"), [(0.05, 0.1), (0.5, 0.0), (-0.5, 0.02), (0.15, 0.03), (1.0, 0.7)])
def test_a_step_is_its_equation(u: float, w: float) -> None:
    """In numpy and in the batched drive; the joystick of two periods ago counts, pressures stay."""
    levers = np.zeros((1, 10))
    levers[0, 7] = u
    p, inertia = np.full((1, 10), 2e6), np.array([5e5])
    speeds = np.full((1, 10), w)
    network = lag()
    p_l, p_r, now = network.predict(levers, p, p, speeds, inertia)
    assert now[0] == pytest.approx(equation(u, w, 5e5), abs=1e-7)
    assert p_l[0] == p_r[0] == 2e6
    rows = [torch.tensor(v.T) for v in (levers, p, p, speeds)]
    ours = Drive([network], dtype=torch.float64)(rows[0], rows[1], rows[2], rows[3], torch.tensor(inertia))
    assert float(ours[2][0]) == pytest.approx(float(now[0]), abs=1e-9)
