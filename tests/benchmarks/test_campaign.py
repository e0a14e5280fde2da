"""`python -m benchmarks campaign` with a tiny budget."""

import json
from pathlib import Path

import pytest

from tests.benchmarks.command import benchmarks


@pytest.mark.long
def test_every_figure_is_written(tmp_path: Path) -> None:
    figures = tmp_path / "f.json"
    code = benchmarks("campaign", "--blocks", "1", "--runs", "32", "--json", figures)
    assert code in (0, 1)  # how fast it is is not this test's matter
    found = json.loads(figures.read_text())
    assert {"scaling", "scaling_independent", "scaling_ratio", "overhead_ms"} <= set(found)
    assert all(found["runs_per_second"][way] > 0.0 for way in ("campaign_1", "independent_2"))
