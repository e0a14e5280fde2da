"""Policies that see their way and things: features, files, starts, both methods of training."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from fmus.models.slew_nn.untrained import untrained
from learning.policy import controller, export, unseeing
from learning.policy.export import Policy
from learning.policy.features import OUTPUTS, features, mirrored
from learning.policy.gradient import GradientTrainer, begin
from learning.policy.network import Interface, perceptron, shaped, weights_of
from learning.policy.ppo import PpoTrainer
from learning.policy.recipe import recipe
from learning.policy.simulation.rewards import KEEP_M, Shape, clearance
from specs import policy as specs
from specs.ahead import Ahead
from specs.errors import InputError
from tests.learning.policy.test_export import LAYERS, PARITY, SHIPPED, answers
from tests.learning.policy.test_features import observations

SEES = Ahead((0.0, 0.8), 3.0)
PATH = next(path for path in SHIPPED if path.name == "path.onnx")


def seen(n: int) -> np.ndarray:
    """Observations [n, N] with places and distances."""
    rng = np.random.default_rng(8)
    entry = {"slew": (-0.5, 0.5), "radius": (7.0, 13.0), "z": (3.0, 9.0)}
    places = [rng.uniform(*entry[name], n) for _ in SEES.waypoints_s for name in entry]
    planes = [rng.uniform(low, high, n) for _ in range(3) for low, high in ((0, 3), *[(-9, 9)] * 3)]
    return np.hstack([observations(n), np.stack([*places, *planes], axis=1)])


def made(seed: int = 1) -> Policy:
    """A policy with random weights that sees."""
    torch.manual_seed(seed)
    mlp = perceptron([features("full", 5, SEES).numel_out(0), *LAYERS, OUTPUTS["full"]])
    told = specs.contract("full", lead_s=1.2, waypoints_s=SEES.waypoints_s, field_m=SEES.field_m)
    return Policy(told, weights_of(mlp))


def test_what_others_see_is_seen_as_before_and_the_rest_comes_last() -> None:
    rows = seen(6)
    plain, more = features("full", 5), features("full", 5, SEES)
    for row in rows:
        found = np.array(more(row)).ravel()
        np.testing.assert_array_equal(found[: plain.numel_out(0)], np.array(plain(row[:69])).ravel())
        near = found[-12::4]
        np.testing.assert_allclose(near, 1.0 - row[[-12, -8, -4]] / SEES.field_m)
    batch = torch.tensor(rows.T, dtype=torch.float32)
    by_torch = Interface("full", 5, ahead=SEES).features(batch).numpy()
    np.testing.assert_allclose(by_torch, [np.array(more(row)).ravel() for row in rows], atol=5e-6, rtol=1e-5)


def test_a_place_at_the_target_is_seen_as_the_target_is() -> None:
    """The same errors of slew, boom and stick."""
    row = seen(1)[0]
    names = specs.layout(5, SEES)
    for place, told in (("slew", "slew_error[0]"), ("radius", "target_radius"), ("z", "target_z")):
        row[names.index(f"way_{place}[0.8]")] = row[names.index(told)]
    found = np.array(features("full", 5, SEES)(row)).ravel()
    first = features("full", 5).numel_out(0)
    second_place = found[first + 6 : first + 12]
    of_target = [k for k in range(first) if np.isclose(found[k], second_place, rtol=1e-9).any()]
    assert len(of_target) >= 6


def test_left_and_right_change_places_in_what_is_ahead() -> None:
    signs = mirrored("full", 5, "inputs", SEES)
    assert signs[: len(mirrored("full", 5, "inputs"))] == mirrored("full", 5, "inputs")
    assert signs[-12:] == (1.0, -1.0, 1.0, 1.0) * 3
    assert signs[-24:-12] == (-1.0, -1.0, 1.0, 1.0, 1.0, 1.0) * 2


def test_the_file_answers_as_the_equations_do_and_is_read_again(tmp_path: Path) -> None:
    path, rows = export.write(made(), tmp_path / "seeing.onnx"), seen(10)
    policy = export.read(path)
    assert policy.contract.ahead == SEES
    ours = np.array([policy(row.astype(np.float32).astype(float)) for row in rows])
    assert np.abs(ours - answers(path, rows)).max() <= PARITY
    with pytest.raises(InputError, match="no signal tells"):
        controller.of_policy(policy)


def test_training_begins_with_the_answers_of_a_policy_that_sees_less() -> None:
    told = recipe("path_field", waypoints_s=SEES.waypoints_s)
    way = Interface(told.task, told.history, told.prior, ahead=told.ahead)
    mlp = shaped(told, way)
    begin(mlp, told, way)
    rows, start = seen(5), export.read(PATH)
    batch = torch.tensor(rows.T, dtype=torch.float32)
    found = way.limited(way.asked(mlp(way.features(batch)), batch)).detach().numpy().T
    np.testing.assert_allclose(found, [start(row[:69]) for row in rows], atol=1e-5)


def test_a_start_that_sees_something_else_is_refused(tmp_path: Path) -> None:
    path = export.write(made(), tmp_path / "other.onnx")
    told = recipe("path_field", start=str(path), layers=LAYERS)
    with pytest.raises(InputError, match="not a full policy"):
        begin(shaped(told, way := Interface("full", 5, ahead=told.ahead)), told, way)


@pytest.mark.parametrize(("name", "kind"), [("path_field", GradientTrainer), ("path_field_ppo", PpoTrainer)])
def test_both_methods_train_it_from_its_start(name: str, kind: type) -> None:
    """Weights move, those of what is ahead among them; clearance is among the rewards."""
    told = recipe(name, True, envs=8, iterations=4, family=False)
    trainer = kind(told, [untrained(1, residual=True)], 1)
    before, start = weights_of(trainer.mlp), export.read(PATH.with_name(told.start)).weights
    first = features("full", 5).numel_out(0)
    np.testing.assert_allclose(before[0][0][:, :first], start[0][0][:, :first], atol=1e-5)
    figures = trainer.iterate()
    assert figures["reward/clearance"] <= 0.0
    assert np.abs(weights_of(trainer.mlp)[0][0] - before[0][0])[:, first:].max() > 0.0


def test_what_is_nearer_than_is_to_be_kept_costs() -> None:
    """Nothing from KEEP_M on, 1 for a contact, by the depth inside, with parts added."""
    from types import SimpleNamespace

    near = torch.tensor([[KEEP_M, 0.0, -KEEP_M, KEEP_M / 2], [9.0, 9.0, 9.0, KEEP_M / 2]])
    found = clearance(SimpleNamespace(near=near), Shape())  # type: ignore[arg-type]
    torch.testing.assert_close(found, torch.tensor([0.0, -1.0, -3.0, -0.5]))


@pytest.mark.parametrize(
    ("name", "changed", "named"),
    [
        ("path", {"weights": {"clearance": 1.0}}, "weights.clearance needs things"),
        ("full", {"field_m": 3.0}, "need ways"),
        ("path", {"waypoints_s": (1.0, 0.5)}, "waypoints_s = .*each later"),
        ("path", {"field_m": -1.0}, "field_m = -1"),
    ],
)
def test_recipes_that_cannot_be_are_refused(name: str, changed: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):
        recipe(name, **changed)


def test_those_that_ship_and_see_nothing_have_no_such_keys() -> None:
    told = export.read(PATH).contract
    assert not told.ahead
    assert replace(told).as_json().count("field_m") == 0


def test_without_its_distances_a_policy_answers_as_where_nothing_is_near(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = export.write(made(), tmp_path / "seeing.onnx"), tmp_path / "less.onnx"
    unseeing.main([str(file), "--out", str(out)])
    less, whole = export.read(out), export.read(file)
    assert less.contract.ahead == Ahead(SEES.waypoints_s)
    alone = [len(specs.layout(5, less.contract.ahead)) + k for k in (0, 4, 8)]
    for row in seen(5):
        row[alone] = SEES.field_m
        np.testing.assert_allclose(less(row[: -4 * 3]), whole(row), rtol=1e-12)
    with pytest.raises(SystemExit) as ended:
        unseeing.main([str(PATH), "--out", str(tmp_path / "none.onnx")])
    assert ended.value.code == 2
    assert "path.onnx sees no distances" in capsys.readouterr().err
    assert not (tmp_path / "none.onnx").exists()
