"""Tuning: what the cost says, that trials are reachable and reproducible, that values land in the file."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from baselines import parameter_file
from baselines.pi import objective, tune
from fmus.equations import kinematics
from specs import parameters
from specs.errors import InputError

TARGET, BEFORE = np.array([1.5, 9.0, 5.0]), np.array([0.0, 10.0, 6.0])


def _joints(slew: float, radius: float, height: float) -> np.ndarray:
    _, q_boom, q_stick = kinematics.inverse(radius, 0.0, height, kinematics.geometry())
    return np.tile([[slew], [q_boom], [q_stick]], objective.INTERVAL)


def test_cost_is_zero_at_the_target_and_three_where_nothing_moves() -> None:
    assert objective.target_cost(_joints(*TARGET), TARGET, BEFORE) == pytest.approx(0.0, abs=1e-6)
    assert objective.target_cost(_joints(*BEFORE), TARGET, BEFORE) == pytest.approx(3.0, rel=2e-3)


def test_late_errors_cost_more() -> None:
    there, away = _joints(*TARGET), _joints(1.4, *TARGET[1:])
    half = objective.INTERVAL // 2
    early = np.hstack([away[:, :half], there[:, half:]])
    late = np.hstack([there[:, :half], away[:, half:]])
    costs = [objective.target_cost(q, TARGET, BEFORE) for q in (early, late)]
    assert costs[1] > 2.0 * costs[0] > 0


def test_trials_are_reproducible_reachable_and_different() -> None:
    tuning, again = objective.trials("tuning", 4), objective.trials("tuning", 4)
    for a, b in zip(tuning, again, strict=True):
        assert a.parameters == b.parameters
        np.testing.assert_array_equal(a.targets, b.targets)
    everything = [*tuning, *objective.trials("validation", 4)]
    for trial in everything:
        travel = np.abs(np.diff([0.0, *trial.targets[:, 0]]))
        assert np.all((travel >= np.radians(45)) & (travel <= np.radians(135)))
        assert all(kinematics.reachable(radius, 0.0, height) is None for _, radius, height in trial.targets)
    for a, b in itertools.combinations(everything, 2):
        assert a.parameters != b.parameters
        assert not np.allclose(a.targets, b.targets)


def test_tuning_never_opens_the_test_set() -> None:
    with pytest.raises(InputError, match="sealed"):
        objective.trials("test", 1)


def test_scaling_to_the_unit_cube_goes_both_ways() -> None:
    gains = dict(zip(tune.NAMES, (1.25, 0.05, 0.6, 1.1), strict=True))
    assert tune.from_cube(tune.to_cube(np.array(list(gains.values())))) == pytest.approx(gains, rel=5e-3)
    assert tune.from_cube(np.zeros(4)) == pytest.approx(dict(zip(tune.NAMES, tune.LOW, strict=True)))
    assert tune.from_cube(np.ones(4)) == pytest.approx(dict(zip(tune.NAMES, tune.HIGH, strict=True)))


def test_search_improves_and_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A few evaluations on one machine; a second search costs no simulation and ends the same."""
    monkeypatch.setattr(tune, "CACHE", tmp_path / "pi.json")
    system = objective.reference_system()
    start = dict(zip(tune.NAMES, (0.25, 0.02, 0.6, 1.0), strict=True))
    best = tune.search(system, start, 4, 1, lambda n: None)
    runs = objective.trials("tuning", 1)
    assert objective.cost(system, best, runs) < objective.cost(system, start, runs)
    monkeypatch.setattr(objective, "cost", lambda *_: pytest.fail("the search does not resume"))
    assert tune.search(system, start, 4, 1, lambda n: None) == best


def test_the_better_candidate_on_validation_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = {"a": 0.4, "b": 0.3}
    monkeypatch.setattr(objective, "cost", lambda _, gains, runs: costs[gains["name"]])
    kept, found = tune.keep_better(None, {n: {"name": n} for n in costs}, 1)  # type: ignore[arg-type]
    assert kept == {"name": "b"}
    assert found == costs


def _copy(folder: Path) -> Path:
    text = parameters.path_of("pi").read_text(encoding="utf-8")
    (folder / "pi.toml").write_text(text, encoding="utf-8")
    return folder / "pi.toml"


def test_update_changes_value_source_and_status_only(tmp_path: Path) -> None:
    path = _copy(tmp_path)
    before = path.read_text(encoding="utf-8").splitlines()
    parameter_file.update("pi", {"pi_slew_gain": 1.23456789}, "a test", folder=tmp_path)
    after = path.read_text(encoding="utf-8").splitlines()
    assert len(after) == len(before)
    changed = [line for line, old in zip(after, before, strict=True) if line != old]
    assert set(changed) <= {"value = 1.23457", 'source = "a test"', 'status = "identified"'}
    assert "value = 1.23457" in changed


@pytest.mark.parametrize(
    ("values", "message"),
    [({"pi_slew_gain": 1.0, "pi_slew_gian": 1.0}, "pi_slew_gian"), ({"pi_slew_limit": 7.0}, "pi_slew_limit")],
)
def test_a_wrong_update_leaves_the_file_alone(tmp_path: Path, values: dict[str, float], message: str) -> None:
    path = _copy(tmp_path)
    before = path.read_text(encoding="utf-8")
    with pytest.raises(InputError, match=message):
        parameter_file.update("pi", values, "a test", folder=tmp_path)
    assert path.read_text(encoding="utf-8") == before
