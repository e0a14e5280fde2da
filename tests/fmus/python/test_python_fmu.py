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


def test_a_python_that_is_named_and_not_there_is_not_replaced(
    slewright: Command, built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLEWRIGHT_FMU_PYTHON", "/nowhere/python")
    done = slewright("simulate", str(built), "--stop", "1", "--out", str(tmp_path / "r.parquet"))
    assert done.returncode == 2
    assert "/nowhere/python cannot be started; SLEWRIGHT_FMU_PYTHON names it" in done.stderr


def test_what_the_class_raises_is_said(built: Path) -> None:
    with pytest.raises(RunError, match=r"ValueError: no way on \(controller.py line \d+\)"):
        simulate(load_system(built), 20, parameters={"Controller.fails_at": 0.5})


def declared(said: str, group: str = "inputs") -> str:
    return f"from math import inf, nan\nclass A:\n    {group} = {said}\n    def step(self, t, h): ..."


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
        (declared("{'a': nan}"), "a: start nan is not finite"),
        (declared("{'a': inf}"), "a: start inf is not finite"),
        (declared("{'a': {'unit': 3}}"), "a: unit must be a text, not 3"),
        (declared("{'a': {'description': 3}}"), "a: description must be a text, not 3"),
        (declared("{'a': {'start': 1, 'unit': 'rad'}}"), "write start with a point, as 1.0"),
        (declared("{'a': {'min': 'low'}}"), "min = 'low' is no bound of a Float64"),
        (declared("{'a': {'min': nan}}"), "min = nan is no bound of a Float64"),
        (declared("{'a': {'start': 1, 'max': 2.5}}"), "max = 2.5 must be whole"),
        (declared("{'a': {'start': True, 'max': 1}}"), "max = 1 is no bound of a Boolean"),
        (declared("{'a': {'min': 2.0, 'max': 1.0}}"), "min 2 is above max 1"),
        (declared("{'a': 2**40}"), "start 1099511627776 is out of its bounds -2147483648 … 2147483647"),
        (declared("{'a': 1.0}\n    def a(self): ..."), "'a', which is a method of the class, too"),
        (declared("{'a': 1.0}\n    step_s = 'fast'"), "step_s must be a positive time in s, not 'fast'"),
        (declared("{'a': 1.0}\n    step_s = -1"), "step_s must be a positive time in s, not -1"),
        (declared("{'a': 1.0}").replace("A:", "Ä:"), "the name of an FMU's class has letters a to z"),
        ("import sys\nsys.exit(0)", "cannot be imported: SystemExit: 0"),
        ("import nothing_of_this_name", "cannot be imported: ModuleNotFoundError"),
    ],
)
def test_what_cannot_be_an_fmu_is_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.py").write_text(text)
    with pytest.raises(InputError) as refusal:
        build_python_fmu(tmp_path / "a.py")
    assert words in str(refusal.value)


ODD = """
from __future__ import annotations
from dataclasses import dataclass
import numpy as np

@dataclass
class State:  # its annotations are texts: dataclasses look for the module
    x: float = 0.0

class Odd:
    inputs = {"on": False}
    outputs = {"y": OUTPUT, "is_bool": False}
    parameters = {"k": {"start": np.float64(1.0), "min": 0.0, "max": float("inf"), "unit": None},
                  "n": {"start": 1, "min": 0.0}}

    def step(self, time, h):
        self.is_bool = self.on is False
        self.y = VALUE
"""


def odd(folder: Path, output: str, value: str) -> Path:
    (folder / "odd.py").write_text(ODD.replace("OUTPUT", output).replace("VALUE", value))
    (folder / "odd.fmu").write_bytes(build_python_fmu(folder / "odd.py"))
    return folder / "odd.fmu"


@pytest.mark.long
def test_booleans_bounds_and_large_arrays(tmp_path: Path) -> None:
    built = odd(tmp_path, "np.zeros(400_000)", "np.arange(400_000.0)")
    record = simulate(load_system(built, 0.1), 3, record=["is_bool"])
    assert record.column("is_bool").tolist() == [0, 1, 1, 1]


@pytest.mark.parametrize(
    ("output", "value", "words"),
    [
        ("0.0", "None", "output y must be a number, not None"),
        ("0.0", "'1.5'", "output y must be a number, not '1.5'"),
        ("0.0", "np.zeros(2)", "output y must be a number, not array"),
        ("[0.0, 0.0]", "1.0", "output y must be an array of 2 numbers, not 1.0"),
        ("[0.0, 0.0]", "[1.0]", "output y has 1 elements, not 2"),
        ("0", "2.7", "output y is 2.7, no whole number of 32 bits"),
        ("0", "2**40", "output y is 1099511627776, no whole number of 32 bits"),
        ("0.0", "exit(3)", "SystemExit: 3"),
    ],
)
def test_outputs_of_another_form_are_named(tmp_path: Path, output: str, value: str, words: str) -> None:
    with pytest.raises(RunError) as failure:
        simulate(load_system(odd(tmp_path, output, value), 0.1), 3)
    assert words in str(failure.value)


def test_the_command(slewright: Command, tmp_path: Path) -> None:
    out = tmp_path / "c.fmu"
    assert slewright("fmu", str(SOURCE), "--out", str(out), "--class", "Controller").returncode == 0
    assert out.is_file()
    refused = slewright("fmu", str(SOURCE), "--out", str(out), "--class", "Controler")
    assert refused.returncode == 2
    assert "has no class 'Controler'" in refused.stderr
    assert importlib.util.find_spec("controller") is None
    refused = slewright("fmu", str(tmp_path))
    assert refused.returncode == 2
    assert "there is no such file" in refused.stderr
    refused = slewright("fmu", str(SOURCE), "--out", str(tmp_path / "c.txt"))
    assert refused.returncode == 2
    assert "valid: .fmu" in refused.stderr
