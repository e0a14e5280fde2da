"""Tuning: its trials, its budget, that it resumes, what it keeps; gains in files."""

import json
from pathlib import Path

import numpy as np
import pytest

from baselines import gains, registry, variants
from baselines.registry import Range
from baselines.tuning import cost, search
from specs.errors import InputError
from tests.conftest import Command
from verification.plants import plant as plants
from verification.plants.plant import Plant

PARABOLA = registry.find("parabola")
RANGES = (Range("a", 0.1, 10.0), Range("b", -1.0, 1.0, log=False))


def test_trials_mix_tasks_and_what_is_told() -> None:
    trials = cost.trials("tuning", 4)
    radii = [np.hypot(*t.targets[:, :2].T) for t in trials]
    assert [np.ptp(r) < 1e-9 for r in radii] == [True, False, True, False]  # slew only, full
    assert [t.told == t.parameters["load_mass"] for t in trials] == [True, True, False, False]
    assert [t.told for t in trials[2:]] == [0.0, 0.0]
    again = cost.trials("tuning", 2)
    assert again[1].parameters == trials[1].parameters
    with pytest.raises(InputError, match="sealed"):
        cost.trials("test", 1)


def test_the_cube_goes_both_ways() -> None:
    for x in ([0.0, 0.0], [0.5, 0.25], [1.0, 1.0]):
        point = search.from_cube(RANGES, np.array(x))
        np.testing.assert_allclose(search.to_cube(RANGES, point), x, atol=2e-3)
    assert search.from_cube(RANGES, np.array([0.5, 0.5])) == {"a": 1.0, "b": 0.0}
    np.testing.assert_array_equal(search.to_cube(RANGES, {"a": 100.0, "b": -3.0}), [1.0, 0.0])


def _bowl(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """In place of simulation: a bowl with its bottom at the middle of the ranges; counts its runs."""
    calls: list[int] = []

    def fake(_, controller, values, runs):
        calls.append(len(runs))
        return float(np.sum((search.to_cube(controller.tuned, values) - 0.55) ** 2)), {"speed": 1.0}

    monkeypatch.setattr(cost, "cost", fake)
    return calls


class _NoSystem:
    components = {}  # noqa: RUF012


def test_the_search_keeps_its_budget_finds_the_bowl_and_resumes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = _bowl(monkeypatch)
    monkeypatch.setattr(search, "robust", lambda controller, gains: True)
    start = {r.name: r.high for r in PARABOLA.tuned}
    budget = 6.0

    def once() -> tuple[dict[str, float], float]:
        cache = search.Cache(tmp_path / "parabola.json", _NoSystem(), PARABOLA)  # type: ignore[arg-type]
        found = search.Search(_NoSystem(), PARABOLA, cache, budget, lambda h: None)  # type: ignore[arg-type]
        return found.run(start), found.spent_h

    best, spent = once()
    assert budget - search.DRAWS * cost.RUN_H < spent <= budget + 1e-9
    assert np.abs(search.to_cube(PARABOLA.tuned, best) - 0.55).max() < 0.3
    assert sum(calls) * cost.RUN_H <= spent + 1e-9
    calls.clear()
    assert once() == (best, spent)
    assert calls == []


@pytest.mark.parametrize(("kept", "better"), [("search", True), ("start", False)])
def test_only_what_is_better_on_validation_is_written(
    kept: str, better: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: dict[str, float] = {}
    known = {r.name: search.parameters.load("parabola")[r.name].value for r in PARABOLA.tuned}

    def fake(_, controller, values, runs):
        same = dict(values) == known
        return (1.0 if same == better else 0.5), {"speed": 1.0}

    monkeypatch.setattr(cost, "cost", fake)
    monkeypatch.setattr(cost, "system", lambda _: _NoSystem())
    monkeypatch.setattr(search, "BUILD", tmp_path)
    monkeypatch.setattr(search.Search, "run", lambda self, start: {n: 1.01 * v for n, v in start.items()})
    monkeypatch.setattr(search, "update", lambda name, values, how: written.update(values))
    figures = search.run(PARABOLA, budget_h=0.1)
    assert figures["kept"] == kept
    assert bool(written) == better
    assert figures["budget_machine_hours"] == 0.1


def test_gains_without_margin_are_not_simulated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = _bowl(monkeypatch)
    monkeypatch.setattr(search, "robust", lambda controller, gains: gains["parabola_slope"] < 1.0)
    cache = search.Cache(tmp_path / "parabola.json", _NoSystem(), PARABOLA)  # type: ignore[arg-type]
    found = search.Search(_NoSystem(), PARABOLA, cache, 3.0, lambda h: None)  # type: ignore[arg-type]
    best = found.run({r.name: r.low for r in PARABOLA.tuned})
    assert best["parabola_slope"] < 1.0
    assert 0 < sum(calls) * cost.RUN_H <= found.spent_h <= 3.0


def test_what_has_no_margin_is_not_robust() -> None:
    assert search.robust(PARABOLA, {"parabola_speed_gain": 1.5, "parabola_slope": 0.8})
    assert not search.robust(PARABOLA, {"parabola_speed_gain": 5.0, "parabola_slope": 2.0})
    assert search.robust(registry.find("operator_experienced"), {})


def test_an_operator_is_not_tuned() -> None:
    with pytest.raises(InputError, match="model of an experienced operator"):
        search.run(registry.find("operator_experienced"))


def test_a_variant_keeps_its_gains_beside_those_of_its_family(tmp_path: Path) -> None:
    path = tmp_path / "variants.toml"
    assert variants.read(path) == {}
    variants.update("zvd", "shaper", {"shaper_speed_limit": 0.4}, "a test", path)
    variants.update("ei", "shaper", {"shaper_speed_limit": 0.5}, "a test", path)
    variants.update("zvd", "shaper", {"shaper_speed_limit": 0.45}, "another", path)
    assert variants.read(path) == {"ei": {"shaper_speed_limit": 0.5}, "zvd": {"shaper_speed_limit": 0.45}}
    before = path.read_text(encoding="utf-8")
    for wrong, message in (({"shaper_sped": 1.0}, "shaper_sped"), ({"shaper_speed_limit": 9.0}, "9")):
        with pytest.raises(InputError, match=message):
            variants.update("zvd", "shaper", wrong, "wrong", path)
    assert path.read_text(encoding="utf-8") == before


def test_every_shaper_is_tuned_and_only_one_for_the_family() -> None:
    shapers = [c for c in registry.select() if c.folder == "shaper"]
    assert [c.name for c in shapers if not c.family] == ["zv_sway"]
    assert {c.family for c in shapers} == {"", "zv_sway"}
    for c in shapers:
        assert ("shaper_sway_gain" in {r.name for r in c.tuned}) == (c.settings["shaper_sway"] == 1.0)
    tuned = variants.read()
    assert set(tuned) <= {c.name for c in shapers if c.family}
    for c in shapers:
        assert tuned.get(c.name, {}).items() <= c.settings.items()
        assert set(tuned.get(c.name, {})) <= {r.name for r in c.tuned}


def test_a_budget_is_at_least_one_evaluation() -> None:
    with pytest.raises(InputError, match=r"a budget of 0\.05 machine-hours: an evaluation takes 0\.0667"):
        search.run(PARABOLA, budget_h=0.05)


def _file(tmp_path: Path, **content: object) -> Path:
    whole = {
        "controller": "parabola",
        "machine": gains.machine(),
        "gains": {"parabola_slope": 1.5},
        **content,
    }
    path = tmp_path / "gains.json"
    path.write_text(json.dumps(whole))
    return path


def test_gains_of_a_file_go_over_the_controllers_own(tmp_path: Path) -> None:
    assert gains.apply(PARABOLA, _file(tmp_path)).settings == {"parabola_slope": 1.5}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"controller": "pd"}, "gains of controller pd, not of parabola"),
        ({"machine": "another"}, "gains for another machine"),
        ({"gains": {"parabola_slop": 1.0}}, "no gain 'parabola_slop'; did you mean parabola_slope"),
        ({"gains": {"parabola_slope": 50.0}}, "parabola_slope = 50.0 outside"),
        ({"gains": 3}, "no gains in it"),
    ],
)
def test_a_gain_file_for_something_else_is_refused(tmp_path: Path, content: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        gains.apply(PARABOLA, _file(tmp_path, **content))


def test_the_command_names_a_wrong_gain_file(slewright_here: Command, tmp_path: Path) -> None:
    path = _file(tmp_path, controller="pd")
    done = slewright_here("compare", "--quick", "--controller", "parabola", "--gains", f"parabola={path}")
    assert done.returncode == 2
    assert "gains of controller pd, not of parabola" in done.stderr


def _on(*names: str) -> list[Plant]:
    return [plants.find(name) for name in names]


def test_the_cost_over_plants_is_that_of_the_worst_one() -> None:
    """A plant is as it is: of the trial it has pose and load, not the draw of the reference machine."""
    pd, on = registry.find("pd"), _on("nominal", "published")
    start = {r.name: search.parameters.load("pd")[r.name].value for r in pd.tuned}
    family, runs = cost.several(pd, on), cost.trials("tuning", 1)
    alone = [cost.cost(family.systems[p.name], pd, start, runs) for p in on]
    assert cost.cost(family, pd, start, runs) == max(alone, key=lambda found: found[0])
    assert alone[0][0] != alone[1][0]
    placed = cost._placed(family.systems["nominal"], runs[0].parameters)
    assert {name.partition(".")[2] for name in placed} == {*cost.PLACED}
    assert not any(name.startswith("controller.") for name in placed)
    assert cost.hours(family, runs) == pytest.approx(2 * cost.RUN_H)


@pytest.mark.parametrize(("machine", "kept"), [(1.05, "search"), (1.2, "start")])
def test_gains_for_plants_are_kept_only_where_the_machine_bears_them(
    machine: float, kept: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`machine`: what the found gains cost on the reference machine over what the old ones do."""
    written: list[str] = []
    known = {r.name: search.parameters.load("parabola")[r.name].value for r in PARABOLA.tuned}

    def fake(system, controller, values, runs):
        old = dict(values) == known
        on_plants = isinstance(system, cost.Several)
        return (1.0 if old else 0.5 if on_plants else machine), {"speed": 1.0}

    monkeypatch.setattr(cost, "cost", fake)
    monkeypatch.setattr(cost, "system", lambda _: _NoSystem())
    monkeypatch.setattr(cost, "several", lambda _, on: cost.Several({p.name: _NoSystem() for p in on}))  # type: ignore[arg-type]
    monkeypatch.setattr(search, "BUILD", tmp_path)
    monkeypatch.setattr(search.Search, "run", lambda self, start: {n: 1.01 * v for n, v in start.items()})
    monkeypatch.setattr(search, "update", lambda name, values, how: written.append(how))
    figures = search.run(PARABOLA, on=_on("nominal", "published"))
    assert figures["kept"] == kept
    assert figures["machine_costs"] == {"start": 1.0, "search": machine}
    assert figures["budget_machine_hours"] == 2 * search.BUDGET_H
    assert all("--plant nominal --plant published" in how for how in written)
    assert len(written) == (kept == "search")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("pi", "--plant", "nominal"), "--plant: the PI has a search of its own"),
        (("pd", "--plant", "moon"), "no plant 'moon': valid: family, "),
        (("pd", "--plant", "family", "--hours", "0.1"), "an evaluation takes 0.4, on 4 draws"),
    ],
)
def test_bad_plants(slewright_here: Command, words: tuple[str, ...], said: str) -> None:
    done = slewright_here("tune", *words)
    assert done.returncode == 2
    assert said in done.stderr


@pytest.mark.parametrize(
    "path", sorted((Path(search.__file__).parent / "family").glob("*.json")), ids=lambda p: p.stem
)
def test_gains_for_the_family_are_better_there_and_no_worse_on_the_machine(path: Path) -> None:
    figures = json.loads(path.read_text(encoding="utf-8"))
    assert figures["kept"] == "search"
    assert figures["plants"] == plants.names()
    costs = {name: found["cost"] for name, found in figures["validation"].items()}
    assert costs["search"] < costs["start"]
    assert figures["machine_costs"]["search"] <= search.MOST_WORSE * figures["machine_costs"]["start"]
    used = gains.apply(registry.find(path.stem), path)
    assert figures["gains"].items() <= used.settings.items()
