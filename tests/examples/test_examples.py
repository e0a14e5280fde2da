"""Every example runs as its README says, and says and draws what it should."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

FOLDER = ROOT / "examples"
SAID = {
    "simulate_ssp": ["751 rows", "inputs: target_x"],
    "own_controller": ["damped (verified)", "Not accepted: 4 of 6 limits met"],
    "own_controller_fmu": ["pd (verified)", "│ reference │ 12.68 │"],
    "calibrate_lut": ["dead band positive: 0.1", "points without data: none"],
    "reconcile_rig": ["The model lacks coulomb_friction.", "put into the simulation: 1.2 N"],
    "read_record": ["complete: True", "q_slew"],
    "drive_over_modbus": ["mode 3, fault 0, slew angle 0."],
}
LONG = ("own_controller_fmu", "calibrate_lut", "reconcile_rig", "drive_over_modbus")


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200", "MPLBACKEND": "agg"}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.long] if n in LONG else []) for n in SAID]
)
def test_it_runs_and_draws_its_picture(name: str, tmp_path: Path) -> None:
    command = [sys.executable, str(FOLDER / f"{name}.py"), "made"]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=280
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for text in SAID[name]:
        assert text in done.stdout
    assert (tmp_path / "made" / f"{name}.svg").read_text().count("<path") > 5


def test_the_cells_of_the_notebook_run_in_order(tmp_path: Path) -> None:
    cells = json.loads((FOLDER / "read_record.ipynb").read_text())["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=280
    )
    assert done.returncode == 0, done.stderr
    assert "complete: True" in done.stdout


def test_every_example_is_tested_listed_and_shown() -> None:
    names = sorted(path.stem for path in FOLDER.glob("*.py"))
    assert names == sorted(SAID)
    listed = (FOLDER / "README.md").read_text()
    page = (ROOT / "docs" / "how-to" / "examples.md").read_text()
    for name in names:
        assert f"({name}.py)" in listed
        assert f"(examples/{name}.svg)" in page
        assert (ROOT / "docs" / "how-to" / "examples" / f"{name}.svg").is_file()
