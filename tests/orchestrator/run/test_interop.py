"""The project's systems give the same result in other people's masters (see other_masters.py)."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.orchestrator.masters import Ends
from orchestrator.run.simulate import simulate
from orchestrator.system.stimuli import Stimuli
from tests.conftest import ROOT
from tests.orchestrator.other_masters import SEED, START, outputs, project_system, seeded

TICKS = 150
CASES = [
    ("fmucontainer", 2),
    ("fmucontainer", 3),
    ("ecos", 2),
    ("ecos", 3),
    ("libcosim", 2),  # with FMI 3 it ends the process
]


def by_us(name: str, fmi_version: int, folder: Path) -> Ends:
    """The same case run by our master: noise off, Jacobi exchange."""
    system = project_system(name, fmi_version, folder)
    names = [f"{component}.{variable}" for component, variable in outputs(system)]
    quiet = {f"{component}.{SEED}": 0.0 for component in seeded(system)}
    record = simulate(system, TICKS, Stimuli({0: START}), quiet, algorithm="jacobi", record=names)
    return {n: float(record.column(n)[-1]) for n in names}


@pytest.mark.interop
@pytest.mark.parametrize("name", ["nominal", "reference"])
@pytest.mark.parametrize(("master", "fmi_version"), CASES)
def test_another_master_agrees(tmp_path: Path, master: str, fmi_version: int, name: str) -> None:
    out = tmp_path / "ends.json"
    case = [master, name, str(fmi_version), str(TICKS), str(out)]
    command = [sys.executable, "-m", "tests.orchestrator.other_masters", *case]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=200)
    assert done.returncode == 0, (done.stdout + done.stderr)[-2000:]
    theirs, ours = json.loads(out.read_text()), by_us(name, fmi_version, tmp_path)
    assert set(theirs) == set(ours)
    for key, value in ours.items():
        assert theirs[key] == pytest.approx(value, rel=1e-9, abs=1e-9), key
