"""A DBC that is not of this version is refused, with the first difference."""

from pathlib import Path

import pytest

from runtime.matching import check_dbc
from specs.errors import InputError
from specs.generate import FOLDER

DBC = FOLDER / "slewright.dbc"


def test_our_dbc_matches() -> None:
    check_dbc(DBC)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("u_slew : 16|16", "u_slew : 48|16", r"u_slew is at \(48"),
        ("(3.125e-05,-1)", "(1e-4,-1)", r"u_slew is at .* not \(16"),
        (" 2365526144 ", " 2365526145 ", r"no message SlewCommand"),
        ('BA_ "E2EDataID" BO_ 2365526144 20752;', "", r"SlewCommand has data_id None, not 20752"),
        (
            'BA_ "GenMsgCycleTime" BO_ 2365526144 20;',
            'BA_ "GenMsgCycleTime" BO_ 2365526144 50;',
            r"SlewCommand has cycle_ms 50, not 20",
        ),
        ('VERSION "1"', "VERSION {", r"cannot be read as a DBC"),
    ],
)
def test_a_dbc_that_does_not_match_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = DBC.read_text()
    if "u_slew : 48" in new:
        text = text.replace("u_stick : 48|16", "u_stick : 16|16")
    assert old in text
    (tmp_path / "other.dbc").write_text(text.replace(old, new))
    with pytest.raises(InputError, match=said):
        check_dbc(tmp_path / "other.dbc")


def test_no_dbc_at_all_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read as a DBC"):
        check_dbc(tmp_path / "none.dbc")
