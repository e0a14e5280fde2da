"""The worst over a family of drives, and the rule of choice, on a small budget."""

from dataclasses import replace

import numpy as np
import pytest

from fmus.models.slew_nn.network import SlewNetwork
from learning.policy import worst
from learning.policy.export import read
from learning.policy.judge import judge_file
from learning.policy.recipe import RECIPES
from learning.policy.session import FAMILY, NETWORKS
from learning.policy.simulation.environment import load_networks
from tests.conftest import ROOT

FULL = ROOT / "learning" / "policies" / "full.onnx"
FIGURES = {"missed": 0.0, "overshoot": 1.0, "error": 0.235, "tool": 5.0, "speed": 10.8}


def test_the_rule_adds_each_worst_figure_over_its_limit() -> None:
    """Half of each limit and the wanted speed: 2.5; the worst of each counts, wherever it is."""
    other = FIGURES | {"overshoot": 2.0, "speed": 5.4}
    assert worst.score({"a": FIGURES}) == pytest.approx(2.5)
    assert worst.score({"a": FIGURES, "b": other}) == pytest.approx(4.0)
    assert worst.worst({"a": FIGURES, "b": other})["speed"] == (5.4, "b")
    missing = FIGURES | {"missed": 0.05}
    assert worst.score({"a": missing}) > worst.score({"a": FIGURES | {"overshoot": 8.0}})


def test_a_disturbed_network_is_another_of_about_the_same_machine() -> None:
    """A few percent off in one step, the same each time."""
    network = SlewNetwork.load(NETWORKS[0])
    one, again = worst.disturbed(network), worst.disturbed(network)
    u, w = np.full((1, 10), 0.5), np.full((1, 10), 0.1)
    p, inertia = np.full((1, 10), 5e6), np.array([4e5])
    speeds = [float(n.predict(u, p, p, w, inertia)[2][0]) for n in (network, one, again)]
    assert speeds[1] == speeds[2] != speeds[0]
    assert abs(speeds[1] - speeds[0]) < 0.05


def test_the_family_s_worst_on_a_small_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both sides, every change and the sketched drives; finite figures, the same each time."""
    monkeypatch.setattr(worst, "CHANGES", {k: worst.CHANGES[k] for k in ("as it is", "sharper")})
    networks = {"own": SlewNetwork.load(NETWORKS[0])}
    found = worst.judged(read(FULL), networks, n=8)
    assert len(found) == 2 * 3 + 2
    assert {"own, mirrored, sharper", "own, retrained", "sketched drive"} < set(found)
    assert np.isfinite([list(row.values()) for row in found.values()]).all()
    assert worst.judged(read(FULL), networks, n=8) == found
    assert worst.worst(found)["tool"][0] == max(row["tool"] for row in found.values())


def test_the_slew_alone_comes_to_rest_on_drives_that_differ() -> None:
    """The published networks as they are and with more flow: nothing is missed, and the joystick is calm."""
    network = load_networks(FAMILY[1:])[0]
    shipped = read(FULL.with_name("slew_robust.onnx"))
    machines = worst.fixed(RECIPES["slew"].random)
    for gain in (1.0, 1.33):
        told = replace(machines, gain=(gain, gain))
        found = judge_file(shipped, [network], told, 1.0, 16, ("empty",), ahead_s=0.0)["empty"]
        assert found["missed"] == 0.0
        assert found["speed"] > 13.0
        assert found["overshoot"] < 2.0
        assert found["sign_changes"] < 1.2
