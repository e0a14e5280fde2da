"""`slewright check` says what a file comes to, or why it could not be simulated."""

import json
from pathlib import Path

import pytest

from orchestrator.fmi.component import runs_here
from orchestrator.system.check import load_system
from tests.conftest import Command
from tests.orchestrator.systems import OSCILLATOR, connection, fmu, write_ssp

NAMES = ["position", "speed"]


def test_a_system(tmp_path: Path, slewright: Command) -> None:
    path = write_ssp(tmp_path, OSCILLATOR, NAMES)
    done = slewright("check", path, "--json", tmp_path / "c.json")
    assert done.returncode == 0, done.stderr
    for words in ("System test", "position", "2.0", "5 Real", "jacobi", "0.01"):
        assert words in done.stdout
    found = json.loads((tmp_path / "c.json").read_text())
    assert (found["system"], found["step_s"], found["algorithm"]) == ("test", 0.01, "jacobi")
    for c in found["components"]:
        own = not runs_here(load_system(path).components[c["name"]], False)
        assert c["isolation"] == ("process of its own: foreign" if own else "in process: built here")
    assert (found["connections"], found["inputs"], found["outputs"]) == (2, 0, 2)
    assert [c["name"] for c in found["components"]] == NAMES
    assert found["components"][0]["types"] == {"Real": 5}
    assert (found["components"][0]["inputs"], found["components"][0]["step_s"]) == (1, 0.01)
    assert f"can be simulated; {len(found['warnings'])} warning" in done.stdout
    assert not list(tmp_path.glob("*.parquet"))  # nothing was run


@pytest.mark.parametrize("version", [2, 3])
def test_an_fmu(version: int, slewright: Command) -> None:
    done = slewright("check", fmu("position", version))
    assert done.returncode == 0, done.stderr
    assert f"{version}.0" in done.stdout
    assert "can be simulated; 0 warnings" in done.stdout


def test_warnings_are_shown_and_counted(tmp_path: Path, slewright: Command) -> None:
    text = OSCILLATOR.replace(connection("speed.speed", "pace"), "")
    assert text != OSCILLATOR
    done = slewright("check", write_ssp(tmp_path, text, NAMES), "--json", tmp_path / "c.json")
    assert done.returncode == 0, done.stderr
    assert "slewright: warning: system output pace is not connected" in done.stderr
    found = json.loads((tmp_path / "c.json").read_text())["warnings"]
    assert "system output pace is not connected" in found
    assert f"can be simulated; {len(found)} warning" in done.stdout


def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, slewright_here: Command) -> None:
    text = OSCILLATOR.replace('startElement="speed"', 'startElement="sped"', 1)
    done = slewright_here("check", write_ssp(tmp_path, text, NAMES), "--json", tmp_path / "c.json")
    assert done.returncode == 2
    assert "line " in done.stderr
    assert "unknown element 'sped'; did you mean speed?" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "c.json").exists()


def test_files_that_are_no_system_or_no_drawing_are_refused(tmp_path: Path, slewright_here: Command) -> None:
    for words, message in (
        ((tmp_path,), "is a folder, not a file"),
        ((tmp_path / "none.fmu",), "does not exist"),
        (
            (tmp_path / "none.fmu", "--graph", tmp_path / "x.png"),
            "valid: .svg",
        ),
    ):
        done = slewright_here("check", *words)
        assert done.returncode == 2
        assert message in done.stderr
    assert not list(tmp_path.iterdir())
