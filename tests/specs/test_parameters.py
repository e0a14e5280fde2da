"""Parameter files: what the repository holds is sound, and every mistake is named with file and key."""

from pathlib import Path

import pytest

from specs import parameters
from specs.errors import InputError

GOOD = """
[{name}]
value = 2.0
unit = "m"
min = 1.0
max = 3.0
description = "Length"
source = "measured with a tape"
status = "measured"
vr = {vr}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(parameters, "FOLDER", tmp_path)
    monkeypatch.setattr(parameters, "CONTROLLERS", tmp_path / "controllers")
    return tmp_path


def write(folder: Path, file: str, text: str) -> None:
    (folder / f"{file}.toml").write_text(text, encoding="utf-8")


def test_all_files_of_the_repository_go_together() -> None:
    found = parameters.check()
    assert len(found) > 100
    assert len({p.vr for p in found.values()}) == len(found)


def test_loads_in_file_order(folder: Path) -> None:
    write(folder, "one", GOOD.format(name="b_length", vr=1001) + GOOD.format(name="a_length", vr=1002))
    write(folder, "two", GOOD.format(name="c_length", vr=1003))
    assert list(parameters.load("two", "one")) == ["c_length", "b_length", "a_length"]
    length = parameters.load("one")["b_length"]
    assert (length.value, length.unit, length.status, length.vr) == (2.0, "m", "measured", 1001)


def test_unknown_file_lists_the_files(folder: Path) -> None:
    write(folder, "one", GOOD.format(name="a", vr=1001))
    with pytest.raises(InputError, match="no parameter file 'tow'; valid: one"):
        parameters.load("tow")


def test_a_controllers_own_parameters_are_in_its_folder(folder: Path) -> None:
    (folder / "controllers" / "mine").mkdir(parents=True)
    write(folder / "controllers" / "mine", "parameters", GOOD.format(name="a_gain", vr=1001))
    assert list(parameters.load("mine")) == ["a_gain"]
    assert parameters.path_of("mine") == folder / "controllers" / "mine" / "parameters.toml"


MISTAKES = {
    "missing unit": ('unit = "m"\n', "", r"one\.toml: a: missing unit"),
    "missing source": ('source = "measured with a tape"\n', "", r"one\.toml: a: missing source"),
    "missing status": ('status = "measured"\n', "", r"one\.toml: a: missing status"),
    "empty source": ('"measured with a tape"', '" "', r"one\.toml: a: empty source"),
    "unknown status": ('"measured"', '"guessed"', r"one\.toml: a: status: .*'guessed'"),
    "unknown unit": ('"m"', '"metre"', r"one\.toml: a: unknown unit 'metre'"),
    "unknown key": ("vr = 1001", "vr = 1001\nuntil = 3", r"one\.toml: a: unknown key until"),
    "not a number": ("value = 2.0", 'value = "long"', r"one\.toml: a: value: .*'long'"),
    "not finite": ("value = 2.0", "value = nan", r"one\.toml: a: value: "),
    "out of its bounds": ("value = 2.0", "value = 4.0", r"one\.toml: a: parameter a = 4 m outside 1 … 3"),
    "signal's reference": ("vr = 1001", "vr = 3", r"one\.toml: a: vr 3 outside 1000–2999"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named_with_file_and_key(mistake: str, folder: Path) -> None:
    old, new, message = MISTAKES[mistake]
    text = GOOD.format(name="a", vr=1001)
    assert old in text
    write(folder, "one", text.replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        parameters.load("one")


def test_names_and_references_are_unique_over_files(folder: Path) -> None:
    write(folder, "one", GOOD.format(name="a", vr=1001))
    write(folder, "two", GOOD.format(name="a", vr=1002))
    write(folder, "three", GOOD.format(name="b", vr=1001))
    with pytest.raises(InputError, match=r"two\.toml: a: name used twice"):
        parameters.load("one", "two")
    with pytest.raises(InputError, match=r"three\.toml: b: vr 1001 already belongs to a"):
        parameters.load("one", "three")
    with pytest.raises(InputError):
        parameters.check()


def test_a_table_is_expected(folder: Path) -> None:
    write(folder, "one", "a = 3.0\n")
    with pytest.raises(InputError, match=r"one\.toml: a: expected a table"):
        parameters.load("one")


def test_override_out_of_bounds_is_refused() -> None:
    gravity = parameters.load("geometry")["gravity"]
    assert gravity.check(9.8) == 9.8
    with pytest.raises(InputError, match="parameter gravity = 98 m/s2 outside"):
        gravity.check(98.0)
