"""Scores and intervals against numbers worked out by hand; bad recordings are refused by name."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from learning.slew import ablation, checks
from learning.slew.ablation import Outcome, table, winner
from learning.slew.data import Data, load, of_traces
from learning.slew.score import Score, score
from learning.slew.trajectory import Trajectory, windows
from specs.errors import InputError


def trajectory(name: str = "a", n: int = 400, **changed: np.ndarray) -> Trajectory:
    k = np.arange(n)
    values = {
        "u": np.sin(0.1 * k), "p_l": 2e6 + 1e6 * np.sin(0.13 * k), "p_r": 2e6 + 1e6 * np.cos(0.13 * k),
        "omega": 0.5 * np.sin(0.1 * k - 0.5), "inertia": np.full(n, 4e5),
    }  # fmt: skip
    return Trajectory(name, **(values | changed))


def test_a_constant_error_of_speed_adds_up_in_the_angle() -> None:
    of = windows([trajectory()], 20, 100, 10)
    found = score(lambda w: w.omega[:, w.before :] + np.radians(2.0), of)
    assert found.velocity_mae == pytest.approx(2.0)
    assert found.position_mae == pytest.approx(2.0 * 0.1 * np.mean(np.arange(1, 101)))


def outcome(variant: str, seed: int, errors: list[float]) -> Outcome:
    owner = np.array([0, 0, 1])
    made = Score(np.array(errors), 3 * np.array(errors), owner)
    return Outcome(variant, seed, {"test": made, "validation": made})


DATA = Data((), (), (trajectory("a"), trajectory("b")), {}, "", "made up")


def test_means_are_over_windows_and_seeds() -> None:
    found = table([outcome("proposed", 1, [1.0, 2.0, 3.0]), outcome("proposed", 2, [3.0, 4.0, 5.0])], DATA)
    assert found["proposed"]["velocity_mae"] == pytest.approx(3.0)
    assert found["proposed"]["position_mae"] == pytest.approx(9.0)
    low, high = found["proposed"]["ci95"]["velocity_mae"]
    assert 1.5 <= low < 3.0 < high <= 5.0
    assert found["proposed"]["noise"]["velocity_mae"] == pytest.approx(3 * np.sqrt(2.0))


def test_ratios_are_paired_over_recordings() -> None:
    """One recording is ten times as hard for both: the ratio stays exact, the figures themselves spread."""
    both = [outcome("proposed", 1, [1.0, 1.0, 10.0]), outcome("tcn", 1, [2.0, 2.0, 20.0])]
    found = table(both, DATA)["tcn"]
    assert found["ratio_to_proposed"]["velocity_mae"]["ci95"] == pytest.approx([2.0, 2.0])
    low, high = found["ci95"]["velocity_mae"]
    assert high > 2 * low


def test_validation_chooses_not_the_test() -> None:
    def figures(validation: float, test: float) -> dict:
        return {"validation": {"velocity_mae": validation, "position_mae": 1.0}, "velocity_mae": test}

    assert winner({"a": figures(1.0, 9.0), "b": figures(2.0, 0.1)}, ["a", "b"]) == "a"


def test_the_traces_split_into_steps_and_everything_else() -> None:
    data = of_traces()
    assert len(data.train) == 40
    assert len(data.test) == 16
    assert not {t.name for t in data.train} & {t.name for t in data.test}
    assert len(data.sha256) == 64


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"u": np.full(400, 0.4)}, "constant excitation: u_slew has fewer than 3 values"),
        ({"u": 100.0 * np.sin(np.arange(400) / 20)}, r"a: \|u_slew\| is up to 1\d\d; valid is -1 … 1"),
        ({"omega": np.zeros(400)}, r"the joystick never leaves the dead band: \|u_slew\| up to 1.00"),
        ({"omega": 0.5 * np.ones(400) * np.nan}, "the joystick never|qd_slew is not a number"),
        ({"p_r": np.minimum(4e7 * np.sin(np.arange(400) / 9) ** 2, 2.5e7)}, "p_slew_a is saturated.*cut off"),
        ({"p_l": np.full(400, 6e7)}, "a: p_slew_b is saturated: 100 %"),
    ],
)  # fmt: skip
def test_what_cannot_be_learned_from_is_refused(changed: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        checks.check([trajectory(**changed)])


def test_good_recordings_pass() -> None:
    checks.check([trajectory()])
    checks.check(of_traces().train)


def test_two_recordings_are_too_few(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.parquet").touch()
    with pytest.raises(InputError, match="three or more recordings"):
        load([tmp_path / "a.parquet", tmp_path / "b.parquet"])


def test_a_folder_without_manifest_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"collection\.json: No such file.*slewright collect"):
        load([tmp_path])


def test_without_closed_loop_leaves_those_recordings_out() -> None:
    some = (trajectory("a"), trajectory("b"))
    data = replace(DATA, train=some, kinds={"a": "steps", "b": "closed_loop"})
    assert [t.name for t in data.training(closed_loop=False)] == ["a"]
    assert len(data.training()) == 2


@pytest.mark.long
def test_what_was_trained_before_an_interruption_is_not_trained_again(tmp_path: Path) -> None:
    """What was kept is taken, also where DATA cannot be trained on; what is damaged is made anew."""
    kept = pickle.dumps(outcome("proposed", 1, [1.0, 2.0, 3.0]))
    (tmp_path / "proposed-1.pickle").write_bytes(kept)
    (tmp_path / "proposed-2.pickle").write_bytes(kept[:40])
    found = ablation.run(DATA, ["proposed"], [1, 2], 1, tmp_path, tiny=True)
    assert next(found).scores["test"].velocity_mae == 2.0
    with pytest.raises(InputError, match="no recording is long enough"):
        next(found)
