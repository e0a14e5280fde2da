"""The control core as an FMU: what `slewright verify --bundle` runs is what the runtime runs."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from deployment.bundling import fmu
from deployment.hil.lockstep import lockstep
from orchestrator.run.master import Master, Options
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.layout import lay_out
from orchestrator.system.stimuli import Stimuli
from slewright import __main__ as entry
from specs import scenario
from tests.runtime.bundles import built, core
from verification.reference import compare, experiments
from verification.runs import plant_parameters

TICKS, SEED = 300, 5


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fmu.system_of(built(), tmp_path_factory.mktemp("systems"))


def test_the_fmu_does_what_the_loaded_core_does_bit_for_bit(packed: Path) -> None:
    chosen = scenario.load("five_targets_2t")
    system = load_system(packed)
    values = plant_parameters(system, "reference", chosen.parameters(SEED))
    simulated = simulate(system, TICKS, Stimuli(chosen.stimuli()), values, seed=SEED)
    stepped = lockstep(core(), chosen, SEED, TICKS)
    assert set(simulated.column("control_mode")[1:]) == {3.0}
    for name in (*fmu.COMMANDS[:3], "true_q_slew", "true_tool_x", "p_pump", "imu_tool_roll"):
        assert np.array_equal(simulated.column(name), stepped.column(name)), name
    for name in (*fmu.COMMANDS[3:], *fmu.SHOWN):  # in lock-step shown as sent, a tick before
        assert np.array_equal(simulated.column(name)[1:], stepped.column(name)[:-1]), name


def test_the_fmu_of_fmi_3_gives_the_same_records(packed: Path, tmp_path: Path) -> None:
    chosen = scenario.load("five_targets_2t")
    records = []
    for path in (packed, fmu.system_of(built(), tmp_path, 3)):
        system = load_system(path)
        values = plant_parameters(system, "reference", chosen.parameters(SEED))
        records.append(simulate(system, TICKS, Stimuli(chosen.stimuli()), values, seed=SEED))
    assert system.components["core"].model.fmi_version == 3
    assert all(np.array_equal(records[0].column(n), records[1].column(n)) for n in records[0].names)


def test_what_cannot_become_an_fmu_is_refused_before_anything_is_built(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "pd.bundle"
    for more, words in (
        (["--fmu", "core.zip"], "--fmu core.zip: not a name of an FMU or system"),
        (["--can"], "there is no --fmu"),
        (["--fmu", "core.fmu", "--engine", "onnxruntime"], "onnxruntime evaluates the policy outside"),
    ):
        assert entry.run(["bundle", "pd", "--out", str(out), *more]) == 2
        assert words in capsys.readouterr().err
    assert not out.exists()


def test_its_state_can_be_saved_in_the_middle(packed: Path) -> None:
    chosen = scenario.load("four_targets_empty")
    system = load_system(packed)
    start = system.start_values(plant_parameters(system, "reference", chosen.parameters(SEED)))
    layout = lay_out(system, ["u_slew", "u_boom", "u_stick", "true_tool_x"])
    with Master(system, layout, start, Options(stimuli=Stimuli(chosen.stimuli()).changes)) as master:
        master.plan.log(4 * TICKS)
        master.initialise()
        master.run(70)
        master.take(1, 4 * TICKS, 0)
        snapshot = master.snapshot()
        master.run(120)
        first = master.take(1, 4 * TICKS, 0)
        master.restore(snapshot)
        master.run(120)
        again = master.take(1, 4 * TICKS, 0)
        assert len(first) > 40
        assert np.array_equal(first, again)
        master.log_finish()


def test_fmu_is_valid(packed: Path, tmp_path: Path) -> None:
    from fmpy.validation import validate_fmu

    with zipfile.ZipFile(packed) as archive:
        found = archive.extract(f"resources/{fmu.NAME}.fmu", tmp_path)
    assert validate_fmu(found) == []


def test_what_excludes_each_other_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    folder = str(built().folder)
    assert entry.run(["verify", "--bundle", folder, "--controller", "pd"]) == 2
    assert "--bundle excludes --controller and --model" in capsys.readouterr().err
    assert entry.run(["verify", "--bundle", folder, "--system", "nominal"]) == 2
    assert "only --system reference" in capsys.readouterr().err
    assert entry.run(["verify", "--bundle", "/nowhere"]) == 2
    assert "is no bundle" in capsys.readouterr().err


def test_the_fmu_does_what_it_carries(packed: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(packed) as archive:
        found = Path(archive.extract(f"resources/{fmu.NAME}.fmu", tmp_path))
    (experiment,) = experiments.read(found)
    signals, notes = compare.run(found, experiment, "any", None)
    assert notes == []
    assert {s.name for s in signals if s.agrees} == {*fmu.COMMANDS, *fmu.SHOWN}
