"""Networks with a structure: what they promise, and what they are exported as."""

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from learning.policy import controller, export
from learning.policy.export import Policy
from learning.policy.features import mirrored
from learning.policy.gradient import begin
from learning.policy.network import Interface, opened, perceptron, set_weights, shaped, weights_of
from learning.policy.recipe import recipe
from specs.errors import InputError
from specs.policy import CHANNELS, ONCE, contract
from tests.learning.policy.test_export import answers, check_fmu

LAYERS = (24, 16)


def built(task: str, network: str, history: int = 5) -> tuple[Interface, nn.Sequential]:
    """An interface and a network whose last layer is not near 0."""
    chosen = recipe(task, layers=LAYERS, network=network, history=history)
    way = Interface(task, history, chosen.prior)
    torch.manual_seed(3)
    mlp = shaped(chosen, way)
    for weight in mlp[-1].parameters():
        nn.init.normal_(weight, std=0.2)
    return way, mlp


def observations(history: int, n: int = 7) -> Tensor:
    """Any observations [N, n] with targets in reach."""
    draw = torch.Generator().manual_seed(1)
    rows = 0.1 * torch.randn(len(CHANNELS) * history, n, generator=draw)
    once = torch.tensor([9.0, 5.0, 500.0, 1.2])[:, None] + 0.1 * torch.randn(len(ONCE), n, generator=draw)
    return torch.cat([rows, once])


@pytest.mark.parametrize("task", ["slew", "full"])
@pytest.mark.parametrize("network", ["", "mirror", "convolution"])
@pytest.mark.parametrize("history", [1, 5])
def test_a_network_is_dense_layers(task: str, network: str, history: int) -> None:
    way, mlp = built(task, network, history)
    weights = weights_of(mlp)
    plain = perceptron([weights[0][0].shape[1], *(len(b) for _, b in weights)])
    set_weights(plain, weights)
    x = way.features(observations(history))
    assert x.shape[1] == weights[0][0].shape[1]
    np.testing.assert_allclose(plain(x).detach(), mlp(x).detach(), atol=2e-5)
    assert float(mlp(x).detach().std()) > 1e-2


def test_signs_of_a_mirror_are_signs() -> None:
    for task in ("slew", "full"):
        for end in ("inputs", "outputs"):
            assert set(mirrored(task, 5, end)) <= {-1.0, 1.0}
    assert mirrored("full", 5, "outputs") == (-1.0, 1.0, 1.0)


def test_an_unknown_network_is_refused() -> None:
    with pytest.raises(InputError, match="mirror, convolution, transformer"):
        recipe("full", network="recurrent")


def test_a_mirror_goes_where_its_network_goes() -> None:
    _, mlp = built("full", "mirror")
    mlp.to("meta")
    assert all(t.device.type == "meta" for t in (*mlp.parameters(), *mlp.buffers()))
    assert len(list(mlp.buffers())) == 2


def attentive(task: str, history: int) -> tuple[Interface, Any, Policy]:
    """A transformer whose tokens know their places, and the policy that it is exported as."""
    found = built(task, "transformer", history)
    way, mlp = found[0], cast("Any", found[1])
    nn.init.normal_(mlp[0].place, std=0.3)
    with torch.no_grad():
        mlp[-1].weight.mul_(0.3)  # commands within their limits
    told = contract(task, history, prior=recipe(task).prior, network="transformer")
    return way, mlp, Policy(told, weights_of(mlp))


@pytest.mark.parametrize(("task", "history"), [("slew", 1), ("full", 5), ("full", 10)])
def test_a_transformer_answers_alike_in_torch_onnx_and_numbers(
    task: str, history: int, tmp_path: Path
) -> None:
    """And is read back as it was written."""
    way, mlp, policy = attentive(task, history)
    seen = observations(history, 20)
    with torch.no_grad():
        inputs = way.features(seen)
        ours = way.limited(way.asked(mlp(inputs), seen)).numpy().T
        path = export.write(policy, tmp_path / "policy.onnx")
        assert torch.allclose(opened(export.read(path))(inputs), mlp(inputs), atol=1e-5)
    rows = seen.numpy().T
    assert np.abs(ours - answers(path, rows)).max() < 1e-5
    assert np.abs(ours - [policy(row.astype(float)) for row in rows]).max() < 1e-5
    assert np.ptp(ours[:, 0]) > 0.01


def test_the_fmu_of_a_transformer_answers_like_its_file(tmp_path: Path) -> None:
    _, _, policy = attentive("full", 5)
    fmu = controller.build(policy, "policy_attentive", tmp_path)
    check_fmu(fmu, export.write(policy, tmp_path / "policy.onnx"), 5)


def test_a_transformer_tells_instants_apart_and_all_of_it_learns() -> None:
    """The order of the history counts by what the places have learnt; a gradient reaches every weight."""
    way, mlp, _ = attentive("full", 5)
    x = way.features(observations(5))
    turned = x.clone()
    rows = mlp[0].rows * 5
    turned[:, :rows] = x[:, :rows].reshape(-1, mlp[0].rows, 5).flip(2).flatten(1)
    assert float((mlp(x) - mlp(turned)).detach().abs().max()) > 1e-3
    nn.init.zeros_(mlp[0].place)
    assert torch.allclose(mlp(x), mlp(turned), atol=1e-5)
    mlp(x).square().sum().backward()
    assert all(p.grad is not None and bool(p.grad.any()) for p in mlp.parameters())


def test_layers_that_are_no_transformer_s_are_refused() -> None:
    _, _, policy = attentive("full", 5)
    told, weights = policy.contract, policy.weights
    with pytest.raises(InputError, match="10 layers of width 31 are no transformer of 4 heads"):
        Policy(told, [*weights[:-1], (weights[-1][0][:, 1:], weights[-1][1])])
    with pytest.raises(InputError, match="9 layers of width 32 are no transformer of 4 heads"):
        Policy(told, [*weights[:4], *weights[5:]])
    with pytest.raises(InputError, match=r"layer 2 is \[32, 31\], a transformer's \[32, 32\]"):
        Policy(told, [*weights[:2], (weights[2][0][:, 1:], weights[2][1]), *weights[3:]])
    with pytest.raises(InputError, match="takes 32 numbers and is given 192"):
        Policy(replace(told, network=""), weights)


@pytest.mark.parametrize("network", ["convolution", "transformer"])
def test_training_goes_on_from_dense_layers_alone(network: str, tmp_path: Path) -> None:
    """What was folded, or has tokens, cannot be put back."""
    way, mlp = built("full", network)
    joined = network if network == "transformer" else ""
    told = contract("full", prior=recipe("full").prior, network=joined)
    path = export.write(Policy(told, weights_of(mlp)), tmp_path / "policy.onnx")
    chosen = recipe("full", layers=LAYERS, network=network, start=str(path))
    with pytest.raises(InputError, match="not a full policy"):
        begin(mlp, chosen, way)
