"""Noise of sensors that lasts for some samples."""

import numpy as np
import pytest
from scipy.signal import lfilter

from reconcile.recordings.data import runs_of
from reconcile.workflow import examine
from tests.reconcile.truth import Truth, coulomb, excitation, record_driven

PART = 0.8  # of a sample's noise that is in the next one
SIZES = {"position": 0.004, "velocity": 0.04}


def lasting(name: str, shape: tuple[int, ...]) -> np.ndarray:
    """Noise of a sensor with a memory of a few samples."""
    white = np.random.default_rng(len(name)).standard_normal(shape)
    return SIZES[name] * np.sqrt(1.0 - PART**2) * lfilter([1.0], [1.0, -PART], white)


@pytest.mark.long
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_noise_that_lasts_is_no_force_and_hides_none(rig, friction: float):
    measured = record_driven(Truth(**(coulomb(friction) if friction else {})), excitation(20.0, 5, 4.0), 5)
    for name in SIZES:
        measured[name].values[:] += lasting(name, measured[name].values.shape)
    figures, _ = examine(rig, runs_of(measured, rig, "run"))
    assert [e["name"] for e in figures["effects"]] == ["coulomb_friction"] * (friction > 0.0)
    if friction:
        assert figures["effects"][0]["parameters"]["Fc"]["value"] == pytest.approx(friction, abs=0.08)
    notes = " ".join(figures["nuisances"]["run"]["mended"])
    assert "noise of velocity of 0.0" in notes
    assert "has a memory of 0." in notes
