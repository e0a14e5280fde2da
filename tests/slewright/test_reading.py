"""Every command that reads foreign recordings takes the same options about them."""

from pathlib import Path
from typing import Any

import pytest

from records.formats import read_measurement
from records.formats.stated import Statement, stated
from records.formats.text.options import TextOptions
from slewright.__main__ import run
from slewright.app import load_command
from slewright.reading import TEXT
from specs.errors import InputError

GERMAN = "Zeit [s];n\n0,0;1.200\n0,5;1.300\n1,0;1.400\n"
COMMANDS = {
    "convert": "convert {file} {out} --force",
    "fit fmu": "fit fmu {fmu} {file} --parameter oscillator.k",
    "reconcile": "reconcile {file} --init {out} --template free",
    "estimate load": "estimate load {file}",
    "estimate calibrate": "estimate calibrate {file} --out {out}",
    "calibrate lut": "calibrate lut {file} --folder {out}",
    "import slew": "import slew --pressure p.onnx --velocity v.onnx --description d.toml --check {file}",
}


def command(words: str) -> Any:
    name, *inner = words.split()
    found = load_command(name)
    return found.commands[inner[0]] if inner and hasattr(found, "commands") else found


@pytest.mark.parametrize("words", COMMANDS)
def test_a_command_that_reads_recordings_takes_the_group(words: str):
    options = {o for p in command(words).params for o in p.opts}
    assert {f"--{name}" for name in TEXT} | {"--map"} <= options


@pytest.mark.parametrize(
    "words", ["convert", "estimate load", "estimate calibrate", "calibrate lut", "reconcile"]
)
def test_what_is_stated_settles_what_is_refused_without(words: str, tmp_path: Path, capsys):
    file = tmp_path / "german.csv"
    file.write_text(GERMAN)
    arguments = COMMANDS[words].format(file=file, out=tmp_path / "out.csv", fmu="").split()
    assert run(arguments) == 2
    assert "--decimal . or --decimal , says which" in capsys.readouterr().err
    run([*arguments, "--decimal", ","])
    assert "--decimal" not in capsys.readouterr().err  # it was read; what is missing in it is another matter
    assert run([*arguments, "--encoding", "klingon"]) == 2
    assert "--encoding 'klingon' is not known" in capsys.readouterr().err


def test_it_holds_for_the_recordings_that_can_take_it_and_no_others(tmp_path: Path):
    for name in ("one.csv", "other.csv"):
        (tmp_path / name).write_text(GERMAN)
    statement = Statement({"n": "speed"}, TextOptions(decimal=","))
    with stated([tmp_path / "one.csv"], statement):
        assert read_measurement(tmp_path / "one.csv")["speed"].values.tolist() == [1200, 1300, 1400]
        assert read_measurement(tmp_path / "one.csv", names={})["n"].values.tolist() == [1200, 1300, 1400]
        with pytest.raises(InputError, match="--decimal"):
            read_measurement(tmp_path / "other.csv")
    with pytest.raises(InputError, match="--decimal"):
        read_measurement(tmp_path / "one.csv")


def test_where_no_recording_can_take_it_it_is_refused(tmp_path: Path, capsys):
    assert run(["estimate", "load", "--simulate", "--decimal", ","]) == 2
    assert "there is no recording that it is for" in capsys.readouterr().err
    (tmp_path / "x.mf4").write_bytes(b"x")
    assert run(["estimate", "load", str(tmp_path / "x.mf4"), "--missing", "9999"]) == 2
    assert "x.mf4 is no text file: --missing is for .csv" in capsys.readouterr().err
    (tmp_path / "x.csv").write_text(GERMAN)
    both = ["estimate", "load", str(tmp_path / "x.mf4"), str(tmp_path / "x.csv"), "--missing", "9999"]
    assert run(both) == 2
    assert "damaged, cut off or not MDF" in capsys.readouterr().err  # the other one can take it
