"""The table of ideas: differences of recipes, rows by seeds."""

from pathlib import Path
from typing import Any

import pytest

from fmus.models.slew_nn.untrained import untrained
from learning.policy import session
from learning.policy.session import Options
from specs.errors import InputError
from verification.evaluation import ablation


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
        {"pace": pace, "loads": {at: {**cell, "tool": tool} for at in ablation.LOADS}, "runs": runs(tool)}
        for pace, tool in ((1.0, 8.0), (1.5, 6.0))
    ]
    lines = ablation.table({names[0]: seeds, names[2]: seeds[:1]}).splitlines()[2:]
    assert lines[0] == (
        "| base | 5 × 8 × 15 s | 2 | 1.25 | 11.00 | 0.50 | 0.10 | 7.00 | 7.00 | 7.00 | 7.00 ± 12.71 | – | 0 |"
    )
    assert lines[1].endswith("| 8.00 ± 12.71 | +1.00 ± 0.00 | 0 |")


def runs(tool: float) -> list[dict[str, Any]]:
    """Two machines, 1 below and 1 above; what failed does not count."""
    good = [{"draw": d, "failed": "", "tool": tool + off} for d, off in (("a", -1.0), ("b", 1.0))]
    return [*good, {"draw": "c", "failed": "it fell"}]


def test_a_folder_without_a_training_or_its_policy_is_refused(tmp_path: Path) -> None:
    """With the folder's name."""
    with pytest.raises(InputError, match=str(tmp_path)):
        ablation.recipe_of(tmp_path)
    with pytest.raises(InputError, match=f"{tmp_path} holds no policy"):
        ablation.policy_of(tmp_path)


def test_the_page_has_a_row_a_recipe_and_what_trained_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two tiny trainings; what they reach is told, no machine is driven."""
    network = tmp_path / "small.npz"
    untrained(1, residual=True).save(network)
    outs = [tmp_path / "one", tmp_path / "other"]
    for out, changed in zip(outs, ({}, {"history": 2}), strict=True):
        tiny = Options("full", seed=1, budget="tiny", networks=(network,), out=out, changed=changed)
        session.run(tiny, lambda *said: None)
    cell = {"speed": 11.0, "overshoot": 0.5, "error": 0.1, "tool": 6.0, "missed": 0}
    found = {"pace": 1.0, "loads": dict.fromkeys(ablation.LOADS, cell), "runs": runs(6.0)}
    monkeypatch.setattr(ablation.evaluation, "evaluate", lambda paths, results, asked: found)
    page = tmp_path / "page.md"
    page.write_text("# Ideas\n\n<!-- old:begin -->\n<!-- old:end -->\n")
    ablation.main([*map(str, outs), "--page", str(page), "--mark", "old", "--machines", "2"])
    text = page.read_text()
    assert "| base | 3 × 32 × 1 s | 1 | 1.00 | 11.00 |" in text
    assert "| history 2 | " in text
    assert text.count("slewright train policy --task full --seed 1") == 2
    assert "on 2 machines of the validation draws, simulated" in text


def test_other_slew_networks_are_a_difference(tmp_path: Path) -> None:
    """They are no field of the recipe, but a training of its own."""
    told = []
    for number in (1, 2):
        network = tmp_path / f"{number}.npz"
        untrained(number, residual=True).save(network)
        out = tmp_path / str(number)
        session.run(Options("full", budget="tiny", networks=(network,), out=out), lambda *said: None)
        told.append(ablation.recipe_of(out))
    assert ablation.named(told)[1][0].startswith("slew networks ")
