"""Trainings whose numbers are none any more: what is named, and what stays of them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from rsl_rl.algorithms import PPO

from fmus.models.slew_nn.network import SlewNetwork
from fmus.models.slew_nn.untrained import untrained
from learning.policy import export, session
from learning.policy.session import Options
from learning.policy.simulation import finite
from learning.policy.simulation.rewards import TERMS
from specs.errors import InputError, RunError
from tests.learning.policy.test_session import SMALL, curve, options, quiet


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small slew network."""
    path = tmp_path_factory.mktemp("networks") / "small.npz"
    untrained(1, residual=True).save(path)
    return path


def test_numbers_that_are_none_are_found_wherever_they_are() -> None:
    nan = float("nan")
    held = {"a": [1.0, {"b": torch.tensor([0.0, nan])}], "c": (nan,), "d": "nan", "e": None, "f": 3}
    assert finite.infinite(held) == ["a.1.b", "c.0"]
    assert finite.shown(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"


def failure(network: Path, out: Path, recipe: str, *more: Path, **changed: Any) -> str:
    """How a training ends."""
    told = Options("full", recipe, networks=(network, *more), out=out, changed={**SMALL, **changed})
    with pytest.raises(RunError) as error:
        session.run(told, quiet)
    return str(error.value)


def test_ppo_stops_before_it_keeps_weights_that_are_none(
    network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither iteration nor checkpoint; the loss, or the weights where the losses are numbers, are named."""
    wild = {"rate": 1e30, "schedule": "fixed", "epochs": 3}
    assert "loss/value" in failure(network, tmp_path / "wild", "paper", **wild)
    assert not list((tmp_path / "wild").glob("*.pt"))
    session.run(options(network, tmp_path, "paper", stop_after=2), quiet)
    kept = (tmp_path / "checkpoint.pt").read_bytes()
    update = PPO.update

    def spoilt(self: Any) -> Any:
        losses = update(self)
        torch.nn.init.constant_(self.actor.mlp[-1].bias, float("inf"))
        return losses

    with monkeypatch.context() as patch:
        patch.setattr(PPO, "update", spoilt)
        with pytest.raises(RunError, match=r"iteration 3: actor\.mlp\.2\.bias is .*last good checkpoint is"):
            session.run(options(network, tmp_path, "paper"), quiet)
    assert (tmp_path / "checkpoint.pt").read_bytes() == kept
    assert len(curve(tmp_path)) == 2
    assert session.run(options(network, tmp_path, "paper"), quiet)["resumed_at"] == 2


def test_without_a_checkpoint_none_is_named(network: Path, tmp_path: Path) -> None:
    """A weight beyond single precision, at once."""
    said = failure(network, tmp_path, "full", weights={"sway": 1e39})
    assert "iteration 1: reward term sway is not a number any more" in said
    assert said.endswith("there is no good checkpoint yet")


@pytest.mark.parametrize("recipe", ["full", "paper"])
def test_a_state_that_is_none_is_named_before_its_rewards(
    recipe: str, network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And which of the slew networks its machines have."""
    monkeypatch.setattr(SlewNetwork, "check_plant", lambda *told: None)  # which refuses such weights
    good = untrained(1, residual=True)
    last = good.velocity[0]
    broken = replace(last, weights=(*last.weights[:-1], last.weights[-1] * float("nan")))
    replace(good, velocity=(broken,)).save(tmp_path / "nan.npz")
    said = failure(network, tmp_path, recipe, tmp_path / "nan.npz")
    assert "the simulation's state (omega, q" in said
    assert f"with the slew network {tmp_path / 'nan.npz'} is" in said
    assert "reward term" not in said


def test_a_term_s_own_slope_that_is_none_is_named(
    network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A root at 0: its value is a number, its slope is not."""
    root = lambda i, s: -(0.0 * i.slew).square().sqrt()  # noqa: E731
    monkeypatch.setattr("learning.policy.simulation.rewards.TERMS", {**TERMS, "closing": root})
    said = failure(network, tmp_path, "full")
    assert "iteration 1: the gradient is not a number any more (of reward term closing)" in said


def test_a_gradient_that_grew_on_its_way_back_blames_no_term(
    network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.nn.utils, "clip_grad_norm_", lambda *told: torch.tensor(float("inf")))
    assert "all terms and their own slopes are finite" in failure(network, tmp_path, "full")


def test_a_checkpoint_without_finite_numbers_is_refused(network: Path, tmp_path: Path) -> None:
    """As one was written before weights were looked at; file and weights are named."""
    session.run(options(network, tmp_path, "full"), quiet)
    path = tmp_path / "checkpoint.pt"
    kept = torch.load(path, weights_only=True)
    name = next(iter(kept["state"]["mlp"]))
    kept["state"]["mlp"][name].fill_(float("nan"))
    torch.save(kept, path)
    with pytest.raises(InputError, match=rf"checkpoint\.pt: mlp\.{name} is not a finite number"):
        session.run(options(network, tmp_path, "full"), quiet)


def test_a_checkpoint_that_tells_no_processor_time_goes_on(network: Path, tmp_path: Path) -> None:
    """How long all of it took is not known then, and not told."""
    session.run(options(network, tmp_path, "full", stop_after=2), quiet)
    path = tmp_path / "checkpoint.pt"
    kept = torch.load(path, weights_only=True)
    del kept["state"]["processor_s"]
    torch.save(kept, path)
    done = session.run(options(network, tmp_path, "full"), quiet)
    assert done["resumed_at"] == 2
    assert done["processor_s"] is None
    assert export.read(Path(done["policy"])).contract.made["processor_s"] is None
