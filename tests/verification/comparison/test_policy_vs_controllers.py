"""Policy less controller, paired by machine."""

import json
from pathlib import Path

import pytest

from specs.errors import InputError
from verification.comparison import policy_vs_controllers

FIGURES = {"speed": 11.0, "overshoot": 1.0, "error": 0.2, "slew_error": 0.4, "tool": 9.0}


def results(path: Path, runs: dict[str, dict[float, tuple[float, float]]]) -> Path:
    """Controllers by name: pace -> (speed, tool) of three machines that are 0, 0.1 and 0.2 °/s faster."""
    lines = [
        json.dumps({
            "key": f"{name}/full/empty/{pace:g}/reference/d-{i}",
            "figures": {**FIGURES, "speed": speed + i / 10, "tool": tool},
        })
        for name, paces in runs.items() for pace, (speed, tool) in paces.items() for i in range(3)
    ]  # fmt: skip
    path.write_text("\n".join(lines))
    return path


def rows() -> list[dict]:
    """Three machines, two seeds each: 11.1 °/s, and a tool of 6, 7 and 8 °/s."""
    cell = {"load": "empty", "failed": None, "overshoot": 1.0, "error": 0.2, "speed": 11.1}
    return [{**cell, "draw": f"d-{i}", "tool": 8.0 - i + seed} for i in range(3) for seed in (-0.5, 0.5)]


def line_of(text: str, name: str) -> list[str]:
    """Cells of a controller's row."""
    (line,) = [one for one in text.splitlines() if f"| {name} |" in one]
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_a_controller_is_taken_at_the_policys_speed(tmp_path: Path) -> None:
    """Between paces each machine's figures are linear; bold where zero is outside of the interval."""
    runs = {"far": {1.0: (14.0, 20.0)}, "near": {0.5: (10.0, 8.0), 1.0: (12.0, 12.0), 1.5: (13.0, 30.0)}}
    others = policy_vs_controllers.known(results(tmp_path / "results.jsonl", runs), "full")
    text = policy_vs_controllers.table(rows(), ["empty"], others, "m")
    found = line_of(text, "near")
    assert found[2] == "0.75"  # 11.1 of 10.1 … 12.1, the mean of their machines
    assert found[3:6] == ["+0.00 ± 0.25", "+0.00 ± 0.00", "+0.00 ± 0.00"]
    assert found[6:] == ["**−3.00 ± 2.48**", "3"]
    assert "far (empty, 14.1)" in text
    assert "| far |" not in text


def test_a_pace_of_that_speed_needs_no_other(tmp_path: Path) -> None:
    """Within 2 %; and the policy's own older runs are left out."""
    runs = {"same": {1.0: (11.2, 6.0)}, "full": {1.0: (11.0, 1.0)}}
    others = policy_vs_controllers.known(results(tmp_path / "results.jsonl", runs), "full")
    text = policy_vs_controllers.table(rows(), ["empty"], others, "m", own="full")
    assert line_of(text, "same")[2] == "1"
    assert "full" not in text


def test_results_without_the_task_are_refused(tmp_path: Path) -> None:
    """And a file that is none."""
    with pytest.raises(InputError, match="no run of task slew"):
        policy_vs_controllers.known(results(tmp_path / "results.jsonl", {"near": {1.0: (11.0, 8.0)}}), "slew")
    with pytest.raises(InputError, match="slewright compare writes one"):
        policy_vs_controllers.known(tmp_path / "none.jsonl", "full")
