"""The table of ideas: differences of recipes, figures at one speed."""

from pathlib import Path

import pytest

from learning.policy import ablation
from specs.errors import InputError

ZERO = dict.fromkeys(ablation.METRICS, 0.0)


def test_differences_are_named_with_their_values() -> None:
    """Of inner fields too; what a training cost is no difference."""
    base = {"prior": "pd", "fade": 1.0, "weights": {"sway": 1.0}, "envs": 64, "random": {"pace": [0.5, 1.5]}}
    other = {"prior": "", "fade": 0.97, "weights": {"sway": 2.0}, "envs": 32, "random": {"pace": [0.4, 1.5]}}
    found = ablation.difference(base, other)
    assert found == ["prior none", "fade 0.97", "weights.sway 2", "random.pace 0.4 … 1.5"]
    assert ablation.difference(base, base) == []
    assert ablation.difference(base, {**base, "weights": {}}) == ["weights.sway none"]


def test_figures_at_a_speed_are_linear_between_paces() -> None:
    """Marked where the speed is not reached."""
    points = [{**ZERO, "speed": 8.0, "tool": 4.0}, {**ZERO, "speed": 12.0, "tool": 8.0}]
    sign, found = ablation.at_speed(points, 9.0)
    assert (sign, found["speed"], found["tool"]) == ("", 9.0, 5.0)
    assert ablation.at_speed(points, 13.0) == ("<", points[1])
    assert ablation.at_speed(points, 7.0) == (">", points[0])


def test_a_folder_without_a_training_is_refused(tmp_path: Path) -> None:
    """With the folder's name."""
    with pytest.raises(InputError, match=str(tmp_path)):
        ablation.recipe_of(tmp_path)
