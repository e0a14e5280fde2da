"""The LQG design: gains are those of the design, the designed loop is stable, and it damps the roll."""

import numpy as np
import pytest

from baselines.lqr import design
from baselines.lqr.model import GAINS, STATES


def test_the_gains_that_ship_are_those_of_the_design() -> None:
    times = design.time_constants()
    np.testing.assert_allclose(GAINS["time_constant"], times, rtol=1e-3)
    for row, time_constant in zip(GAINS["regulator"], times, strict=True):
        np.testing.assert_allclose(row, design.regulator(time_constant), rtol=2e-3, atol=2e-3)
    np.testing.assert_allclose(
        GAINS["estimator"], design.estimator(times[design.NOMINAL]), rtol=2e-3, atol=2e-6
    )
    assert STATES == design.STATES
    assert GAINS["inertia"] == list(design.INERTIAS)


@pytest.mark.parametrize("time_constant", [0.9, 2.0, 5.0])
def test_the_designed_loop_is_stable_and_damps_the_roll(time_constant: float) -> None:
    a, b = design.sampled(time_constant)
    regulated = np.linalg.eigvals(a - b @ design.regulator(time_constant)[None, :])
    assert np.abs(regulated).max() < 1.0
    filtered = a - design.estimator(time_constant) @ np.eye(6)[[0, 1, 4, 5]] @ a
    assert np.abs(np.linalg.eigvals(filtered)).max() < 1.0
    swinging = [e for e in np.linalg.eigvals(design.matrices(time_constant)[0]) if e.imag > 0.5]
    assert len(swinging) == 1
    natural = [np.log(e) / design.STEP for e in regulated if np.log(e).imag > 0.5 * design.STEP]
    assert min(-e.real / abs(e) for e in natural) > 3 * -swinging[0].real / abs(swinging[0])


def test_heavier_machines_get_slower_drives() -> None:
    assert np.all(np.diff(GAINS["time_constant"]) > 0)
