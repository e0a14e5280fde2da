"""Channels whose unit or sign is not what the model and the map take them for."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reconcile.equations.model import read_folder
from reconcile.recordings.data import read_run
from reconcile.start.units import beyond, doubts, notes, pairs
from slewright.__main__ import run
from tests.conftest import ROOT
from tests.reconcile.start.test_init import rig, table

DATA = ROOT / "tests" / "data" / "dfki_simple_pendulum"


def recorded(path: Path, velocity: float = 1.0, position: float = 1.0, noise: float = 0.0) -> Path:
    r = rig()
    noisy = np.random.default_rng(5).normal(0, 1, (2, len(r["t"]))) * noise
    columns = {"time": r["t"], "position [rad]": position * (r["q"] + noisy[0])}
    return table(
        path, columns | {"velocity [rad/s]": velocity * (r["v"] + noisy[1]), "torque [Nm]": r["torque"]}
    )


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize(
    "ratio", [57.29578, 1 / 57.29578, 9.549297, 1 / 9.549297, 1000.0, 0.001, -1.0, -57.29578]
)
def test_a_ratio_that_is_a_known_mistake_is_said(tmp_path: Path, ratio: float, noise: float):
    folder = read_folder(DATA / "model")
    runs = read_run(recorded(tmp_path / "a.csv", velocity=ratio, noise=noise), folder)
    (doubt,) = doubts(folder.model, runs, {"velocity": "velocity"})
    assert doubt.ratio == pytest.approx(ratio, rel=0.02)
    assert "column velocity" in doubt.sentence
    assert "--map" in doubt.sentence


@pytest.mark.parametrize("ratio", [1.0, 1.1, 0.8, 2.0])
def test_other_ratios_are_left_to_the_search(tmp_path: Path, ratio: float):
    folder = read_folder(DATA / "model")
    assert not doubts(folder.model, read_run(recorded(tmp_path / "a.csv", velocity=ratio), folder))


def test_recordings_of_a_real_rig_raise_no_doubt():
    folder = read_folder(DATA / "model")
    runs = [r for f in sorted(DATA.glob("*.csv")) for r in read_run(f, folder)]
    assert pairs(folder.model) == [("position", "velocity")]
    assert doubts(folder.model, runs) == []


def test_reconcile_asks_before_it_computes(tmp_path: Path, capsys):
    file = recorded(tmp_path / "a.csv", position=57.29578)
    out = tmp_path / "out"
    assert run(["reconcile", str(file), "--model", str(DATA / "model"), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "degrees against radians" in said
    assert "[names] of --map" in said
    assert not out.exists()


def test_constant_and_saturated_channels_are_said(tmp_path: Path):
    r = rig(400)
    columns = {
        "time": r["t"],
        "position [rad]": r["q"],
        "velocity [rad/s]": np.minimum(r["v"], np.quantile(r["v"], 0.3)),
    }
    file = table(tmp_path / "a.csv", columns | {"torque [Nm]": 0 * r["t"]})
    said = notes(read_run(file, read_folder(DATA / "model")))
    assert any(s.startswith("torque keeps one value") for s in said)
    assert any(s.startswith("velocity is at its largest value") for s in said)


@pytest.mark.parametrize(("most", "asked"), [(20.0, False), (6.0, False), (2.0, True), (None, False)])
def test_an_input_far_beyond_its_limits_is_asked_for(most: float | None, asked: bool):
    torque = SimpleNamespace(name="torque", unit="N.m", min=None if most is None else -most, max=most)
    run: Any = SimpleNamespace(inputs={"torque": SimpleNamespace(values=np.array([0.0, -10.0, 3.0]))})
    said = beyond(SimpleNamespace(inputs=(torque,), outputs=()), [run], {"M": "torque"})
    assert bool(said) == asked
    if asked:
        assert said.startswith("column M reaches 10, and torque [N.m] at most 2 by model.py: ")
        assert "'M' = 'torque [unit]'" in said


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (3.6, "state its unit in [names]"),
        (-1.0, "is its sign turned? Then write 'v' = '-speed [m/s]'"),
        (1.0, ""),
    ],
)
def test_an_output_often_outside_of_its_limits_is_asked_for(factor: float, said: str):
    speed = SimpleNamespace(name="speed", unit="m/s", min=0.0, max=12.0)
    values = factor * np.append(np.linspace(11.0, 0.0, 40), np.tile([-0.05, 0.05], 10))
    run: Any = SimpleNamespace(inputs={}, outputs={"speed": SimpleNamespace(values=values)})
    found = beyond(SimpleNamespace(inputs=(), outputs=(speed,)), [run], {"v": "speed [m/s]"})
    assert said in found
    assert bool(found) == bool(said)
