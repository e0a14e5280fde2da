"""Networks trained on another inertia number than the project's, and those of the paper's authors."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from fmus.equations.kinematics import geometry, inertia_z
from fmus.models.slew import traces
from fmus.models.slew_nn.network import HISTORY, SlewNetwork
from fmus.models.slew_nn.untrained import untrained
from fmus.paths import ROOT
from learning.policy.simulation.drive import Drive
from learning.slew.acceptance import accept, trajectories
from learning.slew.bodies import BODIES
from learning.slew.description import Inertia
from learning.slew.exchange import from_onnx, to_onnx
from learning.slew.importing import Imported
from specs.errors import InputError

PUBLISHED = ROOT / "fmus" / "models" / "slew_published" / "weights.npz"
SCALE, OFFSET = 0.82, -55.5e3


def states(n: int = 20) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    found = {key: rng.uniform(1e6, 3e7, (n, HISTORY)) for key in ("p_l", "p_r")}
    found |= {"u": rng.uniform(-1, 1, (n, HISTORY)), "omega": rng.normal(0, 0.3, (n, HISTORY))}
    return found | {"inertia": rng.uniform(3e5, 7e5, n)}


def test_an_inertia_map_is_part_of_the_network(tmp_path: Path) -> None:
    network, x = untrained(1), states()
    ours = network.told_in_our_inertia(SCALE, OFFSET)
    wanted = network.predict(**x | {"inertia": SCALE * x["inertia"] + OFFSET})
    np.testing.assert_allclose(ours.predict(**x), wanted, rtol=1e-9)
    ours.save(tmp_path / "weights.npz")
    assert SlewNetwork.load(tmp_path / "weights.npz").inertia_map == (SCALE, OFFSET)


# The authors' bodies (fmus/models/slew_published/README.md), without the terms that they add for widths.
THEIRS = {"carriage_x": 1.6, "cabin_x": 0.9, "boom_foot_x": 0.0}


def test_an_inertia_may_be_told_by_its_bodies() -> None:
    assert Inertia().line == (1.0, 0.0)
    assert Inertia(bodies={"tool_mass": geometry().tool_mass}).line == pytest.approx((1.0, 0.0), abs=1e-3)
    scale, offset = Inertia(bodies=THEIRS).line
    assert scale == pytest.approx(SCALE, abs=0.01)
    assert offset == pytest.approx(OFFSET, rel=0.1)
    own, other = geometry(), SimpleNamespace(**{**vars(geometry()), **THEIRS})
    for q_boom, q_stick in ((0.9, -1.2), (0.5, -0.9), (1.2, -1.8)):
        wanted = inertia_z(q_boom, q_stick, 0.0, other)
        assert scale * inertia_z(q_boom, q_stick, 0.0, own) + offset == pytest.approx(wanted, rel=0.1)
    double = {name: 2.0 * v for name, v in vars(own).items() if name.endswith("_mass") and name in BODIES}
    assert Inertia(bodies=double).line[0] > 1.5


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"bodies": {"boom_mas": 1.0}}, "did you mean boom_mass"),
        ({"bodies": {"boom_mass": -1.0}}, "boom_mass = -1: finite, above 0"),
        ({"bodies": {"boom_mass": 1.0}, "scale": 0.8}, "not both"),
        ({"bodies": {"boom_foot_x": float("nan")}}, "boom_foot_x = nan"),
    ],
)
def test_bodies_that_are_none_are_refused(told: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Inertia(**told)


def test_bodies_whose_number_is_no_line_of_ours_are_refused() -> None:
    """An arm that is nothing: their number does not depend on the pose."""
    light = {"boom_mass": 1e-3, "stick_mass": 1e-3, "tool_mass": 1e-3, "boom_foot_x": -30.0}
    with pytest.raises(InputError, match="no straight line"):
        _ = Inertia(bodies=light).line


def test_torch_runs_the_same_numbers() -> None:
    network, x = SlewNetwork.load(PUBLISHED), states()
    found = Drive([network], dtype=torch.float64)(*(torch.tensor(v.T.copy()) for v in _ordered(x)))
    np.testing.assert_allclose(found[2], network.predict(**x)[2], atol=1e-9)


def _ordered(x: dict[str, np.ndarray]) -> list[np.ndarray]:
    return [x[name] for name in ("u", "p_l", "p_r", "omega", "inertia")]


def test_an_export_keeps_its_inertia(tmp_path: Path) -> None:
    network = untrained(1).told_in_our_inertia(SCALE, OFFSET)
    files = to_onnx(network, tmp_path)
    back = from_onnx(files[0], files[1], files[3])
    assert back.inertia_map == (SCALE, OFFSET)
    np.testing.assert_allclose(back.predict(**states()), network.predict(**states()), rtol=1e-9)


@pytest.mark.parametrize("name", ["published", "symmetric"])
def test_the_mirror_image_answers_to_mirrored_inputs(name: str) -> None:
    network = SlewNetwork.load(PUBLISHED) if name == "published" else untrained(3, residual=True, members=2)
    x = states()
    p_l, p_r, omega = network.predict(**x)
    turned = {"u": -x["u"], "p_l": x["p_r"], "p_r": x["p_l"], "omega": -x["omega"], "inertia": x["inertia"]}
    found = network.mirrored().predict(**turned)
    np.testing.assert_allclose(found, (p_r, p_l, -omega), rtol=1e-6, atol=1e-9)


def test_the_published_networks_fit_their_traces_and_know_their_region() -> None:
    network = SlewNetwork.load(PUBLISHED)
    check = trajectories(traces.FOLDER / "bump_I250.csv", network.inertia_map)
    found = accept(network, check)
    assert found.network.velocity_mae < 1e-3
    assert found.outside == 0.0
    told = trajectories(traces.FOLDER / "bump_I250.csv")  # their number taken for the project's
    assert accept(network, told).network.velocity_mae > 0.5


def test_a_wrong_inertia_number_shows_on_a_recording_that_has_one() -> None:
    network = SlewNetwork.load(PUBLISHED)
    told = trajectories(traces.FOLDER / "bump_I250.csv", (SCALE, OFFSET))
    assert accept(network, told).inertia is None
    wrong = [replace(t, inertia=1.3 * t.inertia) for t in told]
    found = Imported(network, accept(network, wrong), [])
    assert found.figures()["inertia_factor"] == pytest.approx(1 / 1.3, rel=0.01)
    (said,) = found.warnings()
    assert "wrong [inertia]" in said


def test_the_mirror_image_of_a_region_that_names_one_chamber() -> None:
    network = replace(untrained(1), region={"p_l": (1e5, 2e7), "omega": (-0.3, 0.5)})
    assert network.mirrored().region == {"p_r": (1e5, 2e7), "omega": (-0.5, 0.3)}


def test_a_stated_region_tells_what_is_outside() -> None:
    network = SlewNetwork.load(PUBLISHED)
    at = {"u": np.zeros(3), "omega": np.array([0.0, 0.0, 0.8])}
    inertia = np.array([5e5, 12e5, 5e5])
    np.testing.assert_array_equal(network.outside(inertia, **at), [False, True, True])
    found = Drive([network], dtype=torch.float64).outside(*map(torch.tensor, (inertia, *at.values())))
    np.testing.assert_array_equal(found, [False, True, True])


@pytest.mark.parametrize(("scale", "offset"), [(0.0, 0.0), (-1.0, 0.0), (1.0, float("nan"))])
def test_an_inertia_map_that_cannot_be_is_refused(scale: float, offset: float) -> None:
    from learning.slew.description import Inertia

    with pytest.raises(InputError, match="scale above 0"):
        Inertia(scale=scale, offset=offset)
