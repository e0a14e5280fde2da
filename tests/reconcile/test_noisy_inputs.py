"""Inputs that were measured with noise, beside commands that really jump."""

from dataclasses import replace

import numpy as np
import pytest

from reconcile.equations.model import Folder
from reconcile.judging.inputs import without_noise
from reconcile.recordings import noisy_inputs
from reconcile.recordings.data import Run, runs_of, split
from reconcile.search.core import Core
from tests.reconcile.truth import PERIOD, Truth, excitation, record_driven

NOISE = 1.5  # N, beside a force of 2.9 N rms


def driven(rig: Folder, command: np.ndarray, noise: float) -> list[Run]:
    """Runs of a recording whose force was measured with noise (N)."""
    told = record_driven(Truth(mass=2.0), command)
    force = told["force"]
    shown = force.values + noise * np.random.default_rng(7).standard_normal(len(command))
    return runs_of(
        replace(told, channels={**told.channels, "force": replace(force, values=shown)}), rig, "run"
    )


def smooth(seconds: float = 40.0) -> np.ndarray:
    """A force as a controller makes it: without jumps."""
    t = PERIOD * np.arange(round(seconds / PERIOD))
    return 3.0 * np.sin(2.0 * np.pi * 0.31 * t) + 2.5 * np.sin(2.0 * np.pi * (0.1 + 0.01 * t) * t)


def test_the_noise_of_a_measured_force_is_taken_out_and_the_mass_is_right(rig):
    given = [driven(rig, smooth(), NOISE), [], []]
    masses = [Core(rig, split(*runs)).base.values["mass"] for runs in (given, without_noise(rig, given))]
    assert abs(masses[1] - 2.0) < 0.25 * abs(masses[0] - 2.0)
    assert masses[1] == pytest.approx(2.0, rel=0.05)
    (note,) = without_noise(rig, given)[0][0].notes
    assert note.startswith("noise of ")
    assert float(note.split()[2]) == pytest.approx(NOISE, rel=0.1)
    assert note.endswith(" N is taken out of force")


@pytest.mark.parametrize(
    "command",
    [excitation(40.0, 3), smooth(), np.random.default_rng(1).uniform(-8.0, 8.0, 2000)],
    ids=["held", "smooth", "another one every sample"],
)
def test_a_command_is_left_as_it_is(rig, command):
    given = [driven(rig, command, 0.0), [], []]
    assert without_noise(rig, given) is given


def test_a_command_that_jumps_every_sample_looks_noisy_and_only_the_outputs_tell(rig):
    jumps = np.random.default_rng(1).uniform(-8.0, 8.0, 2000)
    assert noisy_inputs.noisy(driven(rig, jumps, 0.0)) == ["force"]
