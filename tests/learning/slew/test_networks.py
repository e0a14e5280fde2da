"""The networks: their shapes, their symmetry, and that plain weights say the same as PyTorch."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from fmus.models.slew.traces import load
from fmus.models.slew_nn.fmu import build_from
from fmus.models.slew_nn.network import HISTORY, SlewNetwork
from learning.slew.disagreement import disagreement, ensemble, members
from learning.slew.exchange import to_onnx
from learning.slew.networks import Pair, Scales, plain
from learning.slew.recipe import RECIPES, Recipe, exportable, recipe
from learning.slew.region import with_region
from learning.slew.score import predictor, roll_out as roll_out_plain, score
from learning.slew.training import roll_out, train
from learning.slew.trajectory import of_trace, windows
from specs.errors import InputError, RunError

TRACES = [of_trace(t) for name, t in load().items() if name.startswith(("sine", "bump"))]
WINDOWS = windows(TRACES, HISTORY, 30, 20)


def untrained(chosen: Recipe, seed: int = 0) -> Pair:
    torch.manual_seed(seed)
    return Pair(chosen, Scales.of(windows(TRACES, HISTORY, 1, 5)))


def test_the_papers_networks_have_the_papers_sizes() -> None:
    network = plain(untrained(RECIPES["proposed"]))
    assert network.pressure[0].sizes == (41, 128, 128, 128, 128, 32, 2)
    assert network.velocity[0].sizes == (41, 128, 128, 128, 32, 1)


@pytest.mark.parametrize("name", [n for n, r in RECIPES.items() if exportable(r)])
def test_plain_weights_predict_what_pytorch_predicts(name: str) -> None:
    pair = untrained(RECIPES[name])
    _, _, omega = roll_out_plain(plain(pair), WINDOWS)
    assert np.abs(omega - roll_out(pair, WINDOWS)).max() < 1e-5 * (1 + np.abs(omega).max())


def test_symmetric_networks_are_symmetric_and_others_are_not() -> None:
    mirrored = windows([t.mirrored() for t in TRACES], HISTORY, 30, 20)
    for name, same in (("symmetric", True), ("proposed", False)):
        network = plain(untrained(RECIPES[name]))
        (left, right, omega), (left_m, right_m, omega_m) = (
            roll_out_plain(network, w) for w in (WINDOWS, mirrored)
        )
        assert np.allclose(omega, -omega_m, atol=1e-9) == same
        assert np.allclose(left, right_m, rtol=1e-9) == same
        assert np.allclose(right, left_m, rtol=1e-9) == same


@pytest.mark.parametrize("name", ["no_pressure", "no_inertia"])
def test_what_a_variant_does_not_see_changes_nothing(name: str) -> None:
    pair = untrained(RECIPES[name])
    unseen = {"no_pressure": ("p_l", "p_r"), "no_inertia": ("inertia",)}[name]
    changed = replace(WINDOWS, **{k: getattr(WINDOWS, k) * 1.7 for k in unseen})
    assert np.array_equal(roll_out(pair, WINDOWS), roll_out(pair, changed))
    whole = untrained(RECIPES["proposed"])
    assert not np.array_equal(roll_out(whole, WINDOWS), roll_out(whole, changed))


@pytest.mark.parametrize("name", RECIPES)
def test_no_prediction_knows_the_future(name: str) -> None:
    pair = untrained(RECIPES[name])
    changed = {}
    for key in ("p_l", "p_r", "omega"):
        changed[key] = getattr(WINDOWS, key).copy()
        changed[key][:, HISTORY:] = 0.0
    assert np.array_equal(roll_out(pair, WINDOWS), roll_out(pair, replace(WINDOWS, **changed)))


@pytest.mark.long
def test_training_learns_and_repeats_itself() -> None:
    chosen = replace(recipe("proposed", tiny=True), epochs=6, batch=128)
    before = score(predictor(plain(untrained(chosen))), WINDOWS)
    trained = [train(TRACES, chosen, seed).network() for seed in (1, 1, 2)]
    scores = [score(predictor(n), WINDOWS).velocity_mae for n in trained]
    assert scores[0] < 0.5 * before.velocity_mae
    assert scores[0] == scores[1] != scores[2]


def test_an_ensemble_predicts_the_mean_of_its_members() -> None:
    networks = [plain(untrained(RECIPES["proposed"], seed)) for seed in range(3)]
    one, whole = windows(TRACES, HISTORY, 1, 20), ensemble(networks)
    pressures = [roll_out_plain(n, one)[0] for n in networks]
    assert np.allclose(roll_out_plain(whole, one)[0], np.mean(pressures, axis=0))
    assert [roll_out_plain(m, one)[0].tolist() for m in members(whole)] == [p.tolist() for p in pressures]
    assert disagreement(whole, WINDOWS).min() > 0
    assert not disagreement(networks[0], WINDOWS).any()


def test_a_loss_that_is_no_number_stops_the_training() -> None:
    bad = [replace(t, omega=np.where(np.arange(len(t)) == 40, np.nan, t.omega)) for t in TRACES]
    with pytest.raises(RunError, match="training of proposed: the loss is nan in epoch 1"):
        train(bad, recipe("proposed", tiny=True), 1)


def test_other_interfaces_are_not_exported() -> None:
    with pytest.raises(InputError, match="recipe tcn has another interface"):
        train(TRACES[:1], replace(recipe("tcn", tiny=True), epochs=1), 1).network()


@pytest.mark.parametrize("name", ["no_pressure", "no_inertia"])
def test_a_model_that_lacks_an_input_is_kept_but_does_not_stand_in_for_the_drive(name: str, tmp_path) -> None:
    network = plain(untrained(RECIPES[name]))
    network.save(tmp_path / "n.npz")
    found = SlewNetwork.load(tmp_path / "n.npz")
    assert np.array_equal(roll_out_plain(found, WINDOWS), roll_out_plain(network, WINDOWS))
    with pytest.raises(InputError, match=f"trained without {name.removeprefix('no_')}"):
        build_from(found, "less", tmp_path)
    with pytest.raises(InputError, match=f"trained without {name.removeprefix('no_')}"):
        to_onnx(found, tmp_path)


def test_the_region_travels_with_the_weights(tmp_path) -> None:
    network = with_region(plain(untrained(RECIPES["proposed"])), TRACES, mirror=True)
    network.save(tmp_path / "n.npz")
    found = SlewNetwork.load(tmp_path / "n.npz")
    middle, ahead = TRACES[0], 50
    known = (middle.inertia[ahead], middle.u[ahead], middle.omega[ahead])
    assert not found.outside(*map(np.array, ([v] for v in known)))[0]
    assert found.outside(np.array([2e6]), np.array([0.0]), np.array([0.0]))[0]
    assert found.outside(np.array([known[0]]), np.array([0.9]), np.array([-found.region["omega"][1]]))[0]


def test_unknown_recipe_is_named() -> None:
    with pytest.raises(InputError, match="no recipe 'unroled'; did you mean unrolled"):
        recipe("unroled")
