"""`slewright calibrate lut` from the command line: what it prints, writes, refuses and leaves alone."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from baselines.arm_velocity import session, sweep, table_file, tracking
from baselines.arm_velocity.model import POINTS
from baselines.parameter_file import update
from records.recording import RecordWriter
from slewright.__main__ import run
from specs import parameters
from specs.errors import InputError
from tests.baselines import lut_recordings as made

LEVELS = (0.1, 0.16, 0.2, 0.3, 0.5, 0.7, 0.9)
SPECS = parameters.FOLDER / "arm_velocity.toml"


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Little of everything: it is about the command."""
    monkeypatch.setattr(tracking, "SPEEDS", (0.06,))
    monkeypatch.setattr(tracking, "SITUATIONS", {j: s[:1] for j, s in tracking.SITUATIONS.items()})


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Another machine's sweeps of the boom, as files."""
    return [_write(tmp_path_factory.mktemp("made"), r, i) for i, r in enumerate(made.sweep(made.Joint(), 1))]


def _write(folder: Path, recording: made.Measurement, number: int) -> str:
    columns = [c.values for c in recording.channels.values()]
    path = folder / f"made_{number}.parquet"
    with RecordWriter(path, ["time", *recording.channels], {}) as writer:
        writer.append(np.column_stack([next(iter(recording.channels.values())).time, *columns]))
    return str(path)


def test_recordings_of_another_machine_give_tables_and_no_tracking(
    recordings: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figures, out = tmp_path / "lut.json", tmp_path / "lut.toml"
    before = SPECS.read_bytes()
    options = ["--joint", "boom", "--json", str(figures), "--out", str(out), "--folder", str(tmp_path)]
    assert run(["calibrate", "lut", *recordings, *options]) == 0
    said = capsys.readouterr().out
    assert "boom positive: dead band 0.1" in said
    found = json.loads(figures.read_text())
    assert found["seed"] == 1
    assert len(found["joints"]["boom"]["command"]) == POINTS
    assert "rms_ff" not in found["joints"]["boom"]
    np.testing.assert_allclose(table_file.read(out)["boom"], found["joints"]["boom"]["command"], atol=6e-5)
    page = (tmp_path / "lut.html").read_text(encoding="utf-8")
    assert "boom-segments" in page
    assert "boom-tracking" not in page
    assert SPECS.read_bytes() == before


def test_without_recordings_the_reference_machine_is_swept_and_tracked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The figures that the comparison asks for, before and after."""
    monkeypatch.setattr(
        session, "sweep", partial(sweep.sweep, levels=LEVELS, conditions=sweep.CONDITIONS[:1])
    )
    figures = tmp_path / "lut.json"
    options = ["--joint", "stick", "--json", str(figures), "--folder", str(tmp_path)]
    run(["calibrate", "lut", *options])
    assert (tmp_path / "nominal" / "lut_stick_0.parquet").is_file()
    stick = json.loads(figures.read_text())["joints"]["stick"]
    assert stick["rms_ff_pi"] == stick["after"]["rms_ff_pi"] < 0.01
    assert set(stick["before"]) == {"rms_ff", "rms_ff_pi", "by_speed"}
    assert "stick-tracking" in (tmp_path / "lut.html").read_text(encoding="utf-8")


def test_write_puts_the_table_into_specs_and_nothing_else_does(
    recordings: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = tmp_path / "arm_velocity.toml"
    copy.write_bytes(SPECS.read_bytes())
    monkeypatch.setattr(session, "update", lambda n, v, s: update(n, v, s, folder=tmp_path))
    options = ["--joint", "boom", "--folder", str(tmp_path), "--out", str(tmp_path / "lut.toml")]
    assert run(["calibrate", "lut", *recordings, *options, "--write"]) == 0
    text = copy.read_text(encoding="utf-8")
    assert 'source = "slewright calibrate lut: 2 recordings of a machine"' in text
    wanted = table_file.read(tmp_path / "lut.toml")["boom"][3]
    section = text.split("[lut_boom_03]")[1].split("[")[0]
    assert f"value = {float(f'{wanted:.4f}')!r}" in section
    assert text.split("[lut_stick_00]")[1] == SPECS.read_text(encoding="utf-8").split("[lut_stick_00]")[1]


def test_write_refuses_tables_with_points_that_lack_data(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    half = made.sweep(made.Joint(), 2, levels=[level for level in made.LEVELS if level <= 0.5])
    files = [_write(tmp_path, r, i) for i, r in enumerate(half)]
    before = SPECS.read_bytes()
    options = ["--joint", "boom", "--folder", str(tmp_path)]
    assert run(["calibrate", "lut", *files, *options, "--write", "--out", str(tmp_path / "lut.toml")]) == 2
    assert "nothing written, points lack data: boom" in capsys.readouterr().err
    assert SPECS.read_bytes() == before
    assert not (tmp_path / "lut.toml").exists()
    assert run(["calibrate", "lut", *files, *options]) == 1
    assert "lacks data" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--joint", "slew"], "unknown joint 'slew'"),
        (["nowhere.parquet"], "no recording at nowhere.parquet"),
        (["--machine", "test:0"], "unknown machine 'test:0'"),
        (["--machine", "validation:0", "--write"], "--write"),
        (["--out", "/"], "is a folder"),
    ],
)
def test_wrong_arguments(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["calibrate", "lut", *arguments, "--folder", str(tmp_path / "new")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[slew]\ncommand = [0.0]\n", "has no table of boom or stick"),
        ("[boom]\ncommand = [0.0]\n", "must be 25 numbers"),
        (f"[boom]\ncommand = {[0.0] * 24 + [2.0]}\n", "ascend within -1"),
        (f"[boom]\ncommand = [{'nan, ' * 24}1.0]\n", "points lack data"),
        (f"[boom]\ncommand = {['x'] * 25}\n", "must be 25 numbers"),
    ],
)
def test_damaged_table_files(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "lut.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        table_file.read(path)
