"""An FMU from a Python class: its values, here and in FMPy; states; what is refused."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from fmus.python.pack import build_python_fmu
from orchestrator.fmi.instance import Instance
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from specs.errors import InputError, RunError
from tests.conftest import Command

SOURCE = Path(__file__).parent / "controller.py"
OUTPUTS = ["u", "filtered", "steps", "settled"]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("python") / "controller.fmu"
    path.write_bytes(build_python_fmu(SOURCE))
    return path


@pytest.mark.parametrize("trust", [True, False])
def test_it_computes_what_the_class_does(built: Path, trust: bool) -> None:
    record = simulate(
        load_system(built), 20, record=OUTPUTS, parameters={"Controller.gain": 3.0}, trust=trust
    )
    expected = 3.0 + 0.1 * np.arange(1, 21)
    assert np.allclose(record.column("u")[1:], expected, rtol=1e-15)
    assert np.allclose(record.column("filtered[3]")[3:], expected[:-2], rtol=1e-15)
    assert record.column("steps").tolist() == list(range(21))
    assert not record.column("settled").any()


def test_other_importers_run_it(built: Path) -> None:
    from fmpy import simulate_fmu
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(built)) == []
    result = simulate_fmu(str(built), stop_time=1.0, step_size=0.1, output_interval=0.1, output=["u"])
    assert result["u"][-1] == pytest.approx(2.0 + 1.0)


def test_its_state_is_taken_back(built: Path) -> None:
    system = load_system(built)
    with Instance(system.components["Controller"]) as fmu:
        fmu.enter_initialisation()
        fmu.exit_initialisation()
        fmu.step(0.0, 0.1)
        state = fmu.get_state()
        fmu.step(0.1, 0.1)
        later = fmu.get("u", "steps").tolist()
        bytes_ = fmu.serialize_state(state)
        fmu.set_state(fmu.deserialize_state(bytes_))
        assert fmu.get("steps").tolist() == [1.0]
        fmu.step(0.1, 0.1)
        assert fmu.get("u", "steps").tolist() == later


def test_what_the_class_raises_is_said(built: Path) -> None:
    with pytest.raises(RunError, match=r"ValueError: no way on \(controller.py line \d+\)"):
        simulate(load_system(built), 20, parameters={"Controller.fails_at": 0.5})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("class A:\n    inputs = {'a': 'x'}\n    def step(self, t, h): ...", "start 'x' is no number"),
        (
            "class A:\n    inputs = {'a': {'unit': 'radd'}}\n    def step(self, t, h): ...",
            "unknown unit 'radd'",
        ),
        ("class A:\n    inputs = {'a b': 1}\n    def step(self, t, h): ...", "'a b', which is no name"),
        ("class A:\n    inputs = {'a': {'strat': 1}}\n    def step(self, t, h): ...", "attribute 'strat'"),
        ("class A:\n    inputs = {'a': {'start': 2.0, 'max': 1.0}}\n    def step(self, t, h): ...", "bounds"),
        ("class A:\n    def step(self, t, h): ...", "declares neither inputs nor outputs"),
        ("class A: ...", "must have one class with step, or --class NAME say which; it has: none"),
        ("import nothing_of_this_name", "cannot be imported: ModuleNotFoundError"),
    ],
)
def test_what_cannot_be_an_fmu_is_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.py").write_text(text)
    with pytest.raises(InputError) as refusal:
        build_python_fmu(tmp_path / "a.py")
    assert words in str(refusal.value)


def test_the_command(slewright: Command, tmp_path: Path) -> None:
    out = tmp_path / "c.fmu"
    assert slewright("fmu", str(SOURCE), "--out", str(out), "--class", "Controller").returncode == 0
    assert out.is_file()
    refused = slewright("fmu", str(SOURCE), "--out", str(out), "--class", "Controler")
    assert refused.returncode == 2
    assert "has no class 'Controler'" in refused.stderr
    assert importlib.util.find_spec("controller") is None
