"""The control core drives the reference machine in lock-step: as the simulated system does, bit for bit."""

from pathlib import Path

import numpy as np
import pytest

from deployment.hil.lockstep import lockstep
from deployment.hil.wires import Wires
from fmus.toolchain.loader import model_folders
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from orchestrator.system.stimuli import Stimuli
from records.metrics import compute
from records.record import Record
from runtime.image import OUTPUT
from specs import scenario
from tests.runtime.bundles import NO_RATE_LIMIT, core
from verification.runs import plant_parameters

TICKS = 500
SEED = 3
AUTOMATIC = 3.0


@pytest.fixture(scope="module")
def verified() -> Record:
    """The first seconds of a scenario as `slewright verify` runs them."""
    chosen = scenario.load("four_targets_empty")
    system = load_system(pack_system("reference"))
    values = plant_parameters(system, "reference", chosen.parameters(SEED))
    return simulate(system, TICKS, Stimuli(chosen.stimuli()), values, seed=SEED)


def test_without_a_rate_limit_it_is_the_simulated_system_bit_for_bit(verified: Record) -> None:
    found = lockstep(core("pi", NO_RATE_LIMIT), scenario.load("four_targets_empty"), SEED, TICKS)
    shared = [n for n in verified.names if n in found.names]
    assert {"u_slew", "u_boom", "u_stick", "imu_tool_roll", "true_tool_x"} <= set(shared)
    for name in shared:
        later = 1 if name in ("qd_boom_ref", "qd_stick_ref") else 0  # shown as they are sent, a tick before
        ours, theirs = found.column(name)[: TICKS + 1 - later], verified.column(name)[later:]
        assert np.array_equal(ours, theirs), name


@pytest.mark.slow
@pytest.mark.long
def test_predictive_control_is_the_same_bit_for_bit_in_a_core(tmp_path: Path) -> None:
    """Its solver is C code like the rest."""
    chosen = scenario.load("four_targets_empty")
    system = load_system(pack_system("reference", out=tmp_path, models={"pi": model_folders()["nmpc"]}))
    values = plant_parameters(system, "reference", chosen.parameters(SEED))
    wanted = simulate(system, TICKS, Stimuli(chosen.stimuli()), values, seed=SEED)
    found = lockstep(core("nmpc", NO_RATE_LIMIT), chosen, SEED, TICKS)
    assert np.ptp(wanted.column("u_slew")) > 0.2
    for name in ("u_slew", "u_boom", "u_stick", "true_q_slew"):
        assert np.array_equal(found.column(name)[: TICKS + 1], wanted.column(name)), name


@pytest.mark.slow
@pytest.mark.long
def test_metrics_are_those_of_verification() -> None:
    """The gate's rate limit is the only difference: 60 ms in a start or stop."""
    chosen = scenario.load("four_targets_empty")
    with_gate = compute(lockstep(core(), chosen, 1))
    without = compute(lockstep(core("pi", NO_RATE_LIMIT), chosen, 1))
    assert with_gate.missed == without.missed
    assert with_gate.speed == pytest.approx(without.speed, abs=0.05)
    assert with_gate.overshoot == pytest.approx(without.overshoot, abs=0.1)
    assert with_gate.error == pytest.approx(without.error, abs=0.02)
    assert with_gate.tool == pytest.approx(without.tool, rel=0.05)


@pytest.mark.slow
def test_through_the_wires_it_drives_the_same() -> None:
    """Quanta, cycles of 100 ms and one frame's way back change the slew by less than half a degree."""
    chosen = scenario.load("four_targets_empty")
    bare, wired = (lockstep(core(), chosen, SEED, TICKS, wires=w) for w in (None, Wires()))
    assert set(wired.column("control_mode")) == {AUTOMATIC}
    assert set(wired.column("fault_code")) == {0.0}
    apart = np.degrees(np.abs(bare.column("true_q_slew") - wired.column("true_q_slew")))
    assert np.degrees(np.ptp(bare.column("true_q_slew"))) > 30.0
    assert 0.0 < apart.max() < 0.5
    assert not np.array_equal(bare.column("u_slew"), wired.column("u_slew"))


def test_automatic_from_the_first_tick_and_no_fault() -> None:
    found = lockstep(core(), scenario.load("four_targets_2t"), SEED, 100)
    assert set(found.column("control_mode")) == {AUTOMATIC}
    assert set(found.column("fault_code")) == {0.0}
    assert found.meta["bundle"] == core().bundle.digest
    assert set(OUTPUT.index) <= set(found.names)
