"""`slewright train slew` from end to end, with budgets too small to learn much."""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

from fmus.models.slew_nn.network import SlewNetwork
from fmus.models.slew_nn.untrained import untrained
from learning.slew import session
from specs.errors import InputError

Command = Callable[..., CompletedProcess[str]]


@pytest.fixture(scope="module")
def trained(slewright: Command, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tiny training on its own recordings, with weights, page and figures."""
    folder = tmp_path_factory.mktemp("train")
    options = ("--budget", "tiny", "--seeds", "2", "--out", folder / "out", "--json", folder / "a.json")
    done = slewright("train", "slew", *options, cwd=folder)
    assert done.returncode == 1, done.stderr  # two epochs do not beat the plain reference
    return folder


@pytest.mark.long
def test_weights_figures_and_page_are_written(trained: Path) -> None:
    figures = json.loads((trained / "a.json").read_text())
    for name in ("proposed", "unrolled", "ensemble", "first_order", "grey_box"):
        low, high = figures[name]["ci95"]["velocity_mae"]
        assert 0 < low <= figures[name]["velocity_mae"] <= high
    assert figures["seed"] == 1
    assert figures["first_order"]["velocity_mae"] < figures["proposed"]["velocity_mae"]
    page = (trained / "out" / "report.html").read_text()
    assert "Held-out recordings" in page
    assert "simulated reference machine" in page


@pytest.mark.long
def test_the_weights_say_how_they_were_made(trained: Path) -> None:
    network = SlewNetwork.load(trained / "out" / "ensemble.npz")
    assert len(network.velocity) == 2
    assert (
        network.meta["command"] == "slewright train slew --recipe ensemble --budget tiny --seeds 2 --seed 1"
    )
    assert len(network.meta["data_sha256"]) == 64
    assert network.meta["disagreement_limit"] > 0
    assert network.outside(np.array([3e6]), np.array([0.0]), np.array([0.0]))[0]


@pytest.mark.long
def test_a_model_is_reproduced_and_one_that_is_not_is_told(trained: Path, slewright: Command) -> None:
    weights = trained / "out" / "ensemble.npz"
    done = slewright("train", "slew", "--reproduce", weights, "--out", trained / "again", cwd=trained)
    assert done.returncode == 0, done.stderr
    assert "the same" in done.stdout
    assert (trained / "again" / "ensemble.npz").read_bytes() == weights.read_bytes()


def test_recordings_of_ones_own_are_asked_for(tmp_path: Path) -> None:
    network = untrained(0)
    made = {k: {} for k in ("recipe", "seeds", "data_sha256", "figures", "noise", "machine", "budget")}
    replace(network, meta={**made, "source": "a.csv, b.csv, c.csv"}).save(tmp_path / "own.npz")
    with pytest.raises(InputError, match=r"own\.npz was trained on a\.csv, b\.csv, c\.csv: name these"):
        session.reproduce(tmp_path / "own.npz", session.Options(), lambda *_: None)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--recipe", "unroled"), "no recipe 'unroled'; did you mean unrolled or proposed?"),
        (("--budget", "large"), "no budget 'large'; valid: full, tiny"),
        (("--traces", "a.parquet"), "--traces and DATA exclude each other"),
        (("--machine", "test:0", "--budget", "tiny"), "test"),
        (("nowhere",), "no recording at nowhere"),
        (("--reproduce", "nothing.npz"), "there is no slew network at nothing.npz"),
        (("--traces", "--out", "/dev/null"), "/dev/null is no folder"),
    ],
)
def test_bad_input_is_named(
    tmp_path: Path, slewright_here: Command, arguments: tuple[str, ...], message: str
) -> None:
    done = slewright_here("train", "slew", *arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert message in done.stderr
    assert os.listdir(tmp_path) in ([], ["out"])  # noqa: PTH208


def test_the_command_says_all_that_makes_the_model_again() -> None:
    options = session.Options(recipe="unrolled", machine="validation:3", seeds=(4, 5), budget="tiny")
    wanted = "slewright train slew --recipe unrolled --machine validation:3 --budget tiny --seeds 2 --seed 4"
    assert options.command == wanted


def test_markers_are_needed(tmp_path: Path) -> None:
    from records.report.markers import fill

    (tmp_path / "a.md").write_text("nothing here\n")
    with pytest.raises(InputError, match="no '<!-- slew-traces:begin -->'"):
        fill(tmp_path / "a.md", "slew-traces", "x\n")
    (tmp_path / "a.md").write_text("a\n<!-- t:begin -->\nold\n<!-- t:end -->\nb\n")
    fill(tmp_path / "a.md", "t", "new\n")
    assert (tmp_path / "a.md").read_text() == "a\n<!-- t:begin -->\nnew\n<!-- t:end -->\nb\n"
