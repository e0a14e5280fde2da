"""Policy less controller, paired by machine."""

import json
from pathlib import Path

import pytest

from slewright import beside
from specs.errors import InputError

FIGURES = {"speed": 11.0, "overshoot": 1.0, "error": 0.2, "slew_error": 0.4, "tool": 9.0}


def results(path: Path, **speeds: float) -> Path:
    """Three machines of each controller at pace 1, and one run at another pace."""
    keys = [(f"{n}/full/empty/1/reference/d-{i}", v) for n, v in speeds.items() for i in range(3)]
    keys.append(("slow/full/empty/0.5/reference/d-0", 5.0))
    lines = [json.dumps({"key": key, "figures": {**FIGURES, "speed": speed}}) for key, speed in keys]
    path.write_text("\n".join(lines))
    return path


def rows() -> list[dict]:
    """Three machines, two seeds each: 0.5 °/s faster, and a tool that is 1, 2 or 3 °/s quieter."""
    cell = {"load": "empty", "failed": None, "overshoot": 1.0, "error": 0.2, "speed": 11.5}
    return [{**cell, "draw": f"d-{i}", "tool": 8.0 - i + seed} for i in range(3) for seed in (-0.5, 0.5)]


def test_controllers_of_about_the_same_speed_are_compared(tmp_path: Path) -> None:
    """Seeds are averaged first; bold where zero is outside of the interval."""
    others = beside.known(results(tmp_path / "results.jsonl", near=11.0, far=14.0), "full")
    text = beside.table(rows(), ["empty"], others, "m")
    (line,) = [one for one in text.splitlines() if one.startswith("| empty")]
    assert line.startswith("| empty | near | **+0.50 ± 0.00** | +0.00 ± 0.00 | +0.00 ± 0.00 | −2.00 ± 2.48 |")
    assert line.endswith("| 3 |")


def test_results_without_the_task_are_refused(tmp_path: Path) -> None:
    """And a file that is none."""
    with pytest.raises(InputError, match="no run of task slew"):
        beside.known(results(tmp_path / "results.jsonl", near=11.0), "slew")
    with pytest.raises(InputError, match="slewright compare writes one"):
        beside.known(tmp_path / "none.jsonl", "full")
