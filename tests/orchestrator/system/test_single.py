"""A bare FMU runs as a system of one component."""

from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

from orchestrator.run.master import Master, Options
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.layout import lay_out
from orchestrator.system.single_fmu import system_of_fmu
from records.record import read
from specs.errors import InputError
from tests.conftest import Command
from tests.orchestrator.ssp.test_bad_files import repacked
from tests.orchestrator.systems import OSCILLATOR, component, connector, fmu, liar, load, ssd, write_ssp


def described(folder: Path, source: Path, *changes: tuple[str, str]) -> Path:
    """A copy of an FMU with its model description changed."""
    import zipfile

    with zipfile.ZipFile(source) as archive:
        text = archive.read("modelDescription.xml").decode()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return repacked(folder, source, {"modelDescription.xml": text.encode()})


@pytest.mark.parametrize("version", [2, 3])
def test_inputs_and_outputs_are_those_of_the_fmu(version: int) -> None:
    system = load_system(fmu("position", version))
    assert list(system.components) == ["position"]
    assert {n: (i.start, i.type, i.unit_name) for n, i in system.inputs.items()} == {
        "v": (0.25, "Real" if version == 2 else "Float64", "m/s")
    }
    assert [(o.name, o.link.source.owner, o.link.source.name) for o in system.outputs.values()] == [
        ("position", "position", "position")
    ]
    assert (system.step_s, system.stop_s) == (0.02, 10.0)  # of its default experiment
    assert system.warnings == ()


@pytest.mark.parametrize("version", [2, 3])
def test_it_runs_as_fmpy_runs_it(version: int) -> None:
    record = simulate(system_of_fmu(fmu("position", version), 0.01), 100)
    theirs = simulate_fmu(
        str(fmu("position", version)), stop_time=1.0, step_size=0.01, output_interval=0.01,
        output=["position"],
        fmi_type="CoSimulation",
    )  # fmt: skip
    np.testing.assert_allclose(record.column("position"), theirs["position"], rtol=0, atol=1e-12)
    assert record.column("position")[-1] == pytest.approx(1.25)


def test_types_are_kept(tmp_path: Path) -> None:
    system = load_system(liar(2, tmp_path))
    assert {i.type for i in system.inputs.values()} <= {"Real", "Integer", "Boolean"}
    assert all(o.type == system.components["liar"].model.variables[n].type for n, o in system.outputs.items())
    assert "names no step; it is run with 0.02 s" in " ".join(system.warnings)


def test_the_step(tmp_path: Path) -> None:
    path = fmu("position", 3)  # its fixed internal step is 0.01 s
    assert system_of_fmu(path, 0.05).step_s == 0.05
    for step, words in ((0.015, "a step of 0.015 s is no multiple of its fixed internal step, 0.01 s"),
                        (0.001, "no multiple"), (0.0, "must be a positive time"),
                        (float("nan"), "must be a positive time")):  # fmt: skip
        with pytest.raises(InputError, match=words):
            system_of_fmu(path, step)
    silent = described(tmp_path, path, ('stepSize="0.02"', ""), ('startTime="0"', 'startTime="3"'))
    system = load_system(silent)
    assert system.step_s == 0.02
    assert [w.split("changed.fmu ")[1] for w in system.warnings] == [
        "names no step; it is run with 0.02 s",
        "starts at 3 s (--start S chooses another time)",
    ]


def test_clocks_tick_on_its_steps(tmp_path: Path) -> None:
    clocks = (
        '<Clock name="beat" valueReference="901" causality="input" intervalVariability="constant" '
        'intervalDecimal="0.1" shiftDecimal="0.05"/>'
        '<Clock name="bang" valueReference="902" causality="input" intervalVariability="triggered"/>'
    )
    path = described(
        tmp_path, fmu("position", 3), ("<ModelVariables>", f"<ModelVariables>{clocks}"),
        ("<CoSimulation ", '<CoSimulation hasEventMode="true" '),
    )  # fmt: skip
    system = system_of_fmu(path, 0.05)
    assert system.components["position"].clocks == {"beat": (1, 2)}
    assert list(system.inputs) == ["v"]  # a clock is no signal
    assert "triggered clock bang is not connected and never ticks" in " ".join(system.warnings)
    inside = system_of_fmu(path, 0.02).components["position"]  # its FMU takes any step
    assert (inside.timed["beat"].shift_s, inside.timed["beat"].interval_s) == (0.05, 0.1)


@pytest.mark.parametrize("once", [False, True])
def test_a_second_instance_gets_a_process_where_one_allows_no_other(tmp_path: Path, once: bool) -> None:
    flag = 'canBeInstantiatedOnlyOncePerProcess="true" ' if once else ""
    path = described(tmp_path, fmu("position"), ("<CoSimulation ", f"<CoSimulation {flag}"))
    ends = (connector("v", "input"), connector("position", "output"))
    system = load(tmp_path, ssd([component(n, "p", *ends) for n in ("a", "b", "c")]), {"p": path})
    with Master(system, lay_out(system), system.start_values({}), Options(trust=True)) as master:
        local = [not instance.isolated for instance in master.instances]
    assert local == [True, not once, not once]


def test_files_that_are_no_fmu(tmp_path: Path) -> None:
    (tmp_path / "x.fmu").write_bytes(b"no zip")
    with pytest.raises(InputError, match=r"FMU .*x\.fmu is truncated or not a zip archive"):
        load_system(tmp_path / "x.fmu")
    with pytest.raises(InputError, match=r"FMU .*changed\.fmu holds no modelDescription\.xml"):
        load_system(repacked(tmp_path, fmu("speed"), {"modelDescription.xml": None}))


def test_the_command(tmp_path: Path, slewright: Command) -> None:
    out = tmp_path / "r.parquet"
    done = slewright("simulate", fmu("position"), "--out", out, "--stop", "1", "--step", "0.1")
    assert done.returncode == 0, done.stderr
    record = read(out)
    assert len(record) == 11
    assert record.column("position")[-1] == pytest.approx(1.25)
    stated = write_ssp(tmp_path, OSCILLATOR, ["position", "speed"])
    refused = slewright("simulate", stated, "--out", out, "--step", "0.1")
    assert refused.returncode == 2
    assert "states its step itself, 0.01 s; it cannot be run with 0.1 s" in refused.stderr
    silent = write_ssp(tmp_path, OSCILLATOR.replace('stepSize="0.01"', ""), ["position", "speed"])
    done = slewright("simulate", silent, "--out", out, "--step", "0.1", "--start", "2", "--stop", "3")
    assert done.returncode == 0, done.stderr
    assert list(read(out).time[[0, 1, -1]]) == [2.0, 2.1, 3.0]
