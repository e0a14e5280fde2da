"""A policy's FMU in the simulated system and the same policy in the control core: the same bits."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from deployment.bundling.build import bundle
from deployment.hil.lockstep import lockstep
from learning.policy import controller, export
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from orchestrator.system.stimuli import Stimuli
from runtime.policy import open_core
from specs import scenario
from tests.learning.policy.test_export import made
from tests.runtime.bundles import NO_RATE_LIMIT
from verification.runs import plant_parameters

TICKS, SEED = 300, 2


@pytest.mark.slow
@pytest.mark.long
def test_what_was_simulated_is_what_runs(tmp_path: Path) -> None:
    policy, chosen = made("full"), scenario.load("four_targets_empty")
    folder = controller.write_folder(policy, "random_policy", tmp_path)
    system = load_system(pack_system("reference", out=tmp_path, models={"pi": folder}))
    values = plant_parameters(system, "reference", chosen.parameters(SEED))
    simulated = simulate(system, TICKS, Stimuli(chosen.stimuli()), values, seed=SEED)
    file = export.write(policy, tmp_path / "random.onnx")
    control = open_core(bundle(str(file), tmp_path / "bundle", changes=dict(NO_RATE_LIMIT)))
    stepped = lockstep(control, chosen, SEED, TICKS)
    assert np.ptp(simulated.column("u_slew")) > 0.005
    for name in ("u_slew", "u_boom", "u_stick", "imu_tool_roll", "true_tool_x"):
        assert np.array_equal(simulated.column(name), stepped.column(name)), name
