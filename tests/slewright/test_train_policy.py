"""`slewright train policy` as a command: exit codes, and what it says it has written."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fmus.models.slew_nn.untrained import untrained
from slewright.commands.learning.train import app
from specs.errors import InputError, RunError

SMALL = ("--set", "envs=8", "--set", "iterations=2", "--set", "layers=[8]", "--budget", "tiny")


def train(tmp_path: Path, *words: str) -> tuple[str, BaseException | None]:
    """What a small training says, and what it ends with."""
    network = tmp_path / "small.npz"
    untrained(1, residual=True).save(network)
    told = ["policy", *SMALL, "--networks", str(network), "--out", str(tmp_path / "out"), *words]
    done = CliRunner().invoke(app, told)
    return done.output, done.exception


@pytest.mark.parametrize(
    "word", ["envs=abc", "history=21", "method=sac", "random.load=abc", "asymmetric=true"]
)
def test_a_wrong_word_is_wrong_input_and_trains_nothing(word: str, tmp_path: Path) -> None:
    """Exit code 2, however small the budget."""
    error = train(tmp_path, "--set", word)[1]
    assert isinstance(error, InputError)
    assert word.split("=")[0] in str(error)
    assert not (tmp_path / "out").exists()


def test_what_is_set_is_trained_and_timed(tmp_path: Path) -> None:
    """Two iterations, not those of the budget; processor seconds beside them."""
    said, error = train(tmp_path, "--json", str(tmp_path / "told.json"))
    assert error is None
    told = json.loads((tmp_path / "told.json").read_text())
    assert told["iterations"] == told["of"] == 2
    assert told["processor_s"] > 0
    assert f"written: {told['policy']}" in said.replace("\n", "")


def test_a_teacher_is_written_as_a_checkpoint(tmp_path: Path) -> None:
    said, error = train(tmp_path, "--set", "privileged=true", "--set", "network=")
    assert error is None
    assert "no policy is written: a teacher" in said
    assert f"written: {tmp_path / 'out' / 'checkpoint.pt'}" in said.replace("\n", "")


def test_ppo_that_leaves_all_numbers_fails_in_the_run(tmp_path: Path) -> None:
    """Exit code 3, and again when it is called again."""
    for _ in range(2):
        wild = ("--recipe", "paper", "--set", "rate=1e30", "--set", "schedule=fixed", "--set", "iterations=5")
        error = train(tmp_path, *wild)[1]
        assert isinstance(error, RunError)
        assert "is not a number any more; there is no good checkpoint yet" in str(error)
