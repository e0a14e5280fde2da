"""The four metrics do not depend on the machine's internal step: a scenario run twice, end to end."""

from pathlib import Path

import pytest

from records.metrics import compute
from verification.verify import Controller, verify

SCENARIO = "four_targets_2t"
TOLERANCE = {"speed": 0.05, "overshoot": 0.05, "error": 0.01, "tool": 0.05}  # °/s, °, m, °/s; or 1 %
HALF = """
from dataclasses import replace

from fmus.models.machine.model import MODEL as NOMINAL

MODEL = replace(NOMINAL, step=NOMINAL.step / 2)
"""


@pytest.mark.long
def test_halving_the_internal_step_does_not_move_the_metrics(tmp_path: Path) -> None:
    folder = tmp_path / "machine"
    folder.mkdir()
    (folder / "model.py").write_text(HALF)
    found = []
    for name, model in (("whole", None), ("half", folder)):
        line = {"out": tmp_path / name, "controller": Controller(models=[model] if model else ()), "jobs": 1}
        runs = verify([SCENARIO], ["reference"], **line).own.runs
        found.append(compute(runs[SCENARIO]["reference"]))
    for metric, absolute in TOLERANCE.items():
        whole, half = (getattr(f, metric) for f in found)
        assert half == pytest.approx(whole, rel=0.01, abs=absolute), metric
    assert found[0] != found[1]  # the step was halved indeed
