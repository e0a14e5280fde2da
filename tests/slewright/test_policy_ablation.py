"""The table of ideas: differences of recipes, rows by seeds."""

from pathlib import Path
from typing import Any

import pytest

from slewright import policy_ablation as ablation
from specs.errors import InputError


def test_differences_are_named_with_their_values() -> None:
    """Of inner fields too; what a training cost is no difference."""
    base = {"prior": "pd", "fade": 1.0, "weights": {"sway": 1.0}, "envs": 64, "random": {"pace": [0.5, 1.5]}}
    other = {"prior": "", "fade": 0.97, "weights": {"sway": 2.0}, "envs": 32, "random": {"pace": [0.4, 1.5]}}
    found = ablation.difference(base, other)
    assert found == ["prior none", "fade 0.97", "weights.sway 2", "random.pace 0.4 … 1.5"]
    assert ablation.difference(base, base) == []
    assert ablation.difference(base, {**base, "weights": {}}) == ["weights.sway none"]


def test_seeds_share_a_row_and_many_ranges_are_one() -> None:
    """The mean of the seeds; a row says what its trainings cost."""
    cost = {"iterations": 5, "envs": 8, "episode_s": 15.0}
    wide = {n: [0.0, 1.0] for n in ("load", "gain", "latency", "dead_band")}
    base: dict[str, Any] = {**cost, "random": {}, "spatial": True}
    names = ablation.named([base, base, {**base, "random": wide, "spatial": False}])
    assert names[0] == names[1] == ("base", "5 × 8 × 15 s")
    assert names[2][0] == "spatial no, other ranges of load, gain, latency, dead_band"
    cell = {"speed": 11.0, "overshoot": 0.5, "error": 0.1, "missed": 0}
    seeds = [
        {"pace": pace, "loads": {load: {**cell, "tool": tool} for load in ablation.LOADS}}
        for pace, tool in ((1.0, 8.0), (1.5, 6.0))
    ]
    row = ablation.table({names[0]: seeds}).splitlines()[2]
    assert row == ("| base | 5 × 8 × 15 s | 2 | 1.25 | 11.00 | 0.50 | 0.10 | 7.00 | 7.00 | 7.00 | 7.00 | 0 |")


def test_a_folder_without_a_training_is_refused(tmp_path: Path) -> None:
    """With the folder's name."""
    with pytest.raises(InputError, match=str(tmp_path)):
        ablation.recipe_of(tmp_path)
