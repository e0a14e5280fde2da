"""Networks with a structure: what they promise, and that they are dense layers once they are trained."""

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from learning.policy.features import mirrored
from learning.policy.network import Interface, perceptron, set_weights, shaped, weights_of
from learning.policy.recipe import recipe
from specs.errors import InputError
from specs.policy import CHANNELS, ONCE

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
    with pytest.raises(InputError, match="mirror, convolution"):
        recipe("full", network="transformer")


def test_a_mirror_goes_where_its_network_goes() -> None:
    _, mlp = built("full", "mirror")
    mlp.to("meta")
    assert all(t.device.type == "meta" for t in (*mlp.parameters(), *mlp.buffers()))
    assert len(list(mlp.buffers())) == 2
