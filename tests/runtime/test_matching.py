"""A DBC or register map that is not of this version is refused, with the first difference."""

from pathlib import Path

import pytest

from runtime.matching import check_dbc, check_map
from specs.errors import InputError
from specs.generate import FOLDER

DBC = FOLDER / "slewright.dbc"
MAP = FOLDER / "modbus_map.csv"


def edited(given: Path, folder: Path, old: str, new: str) -> Path:
    """A copy of a file with every `old` made `new`."""
    text = given.read_text()
    assert old in text
    (folder / given.name).write_text(text.replace(old, new))
    return folder / given.name


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
        (' SG_ SlewCommand_counter : 8|4@1+ (1,0) [0|14] "" Machine\n', "", "no signal SlewCommand_counter"),
        ("SlewCommand_counter : 8|4", "SlewCommand_counter : 8|3", r"SlewCommand_counter is at \(8, 3"),
        ("u_slew : 16|16@1+", "u_slew : 16|16@1-", "u_slew has signed True, not False"),
        ('[-1000|1000] "rad"', '[-1000|1000] "deg"', "q_slew has unit deg, not rad"),
        ("[-1000|1000]", "[-10|1000]", "q_slew has min -10, not -1000"),
        ('control_enable 0 "off" 1 "on"', 'control_enable 1 "off" 0 "on"', "control_enable has values"),
        ("SlewCommand: 8 Controller", "SlewCommand: 8 Machine", "SlewCommand has sender Machine"),
        (
            " SG_ q_slew : 16|32@1+",
            ' SG_ more : 12|4@1+ (1,0) [0|1] "" Controller\n SG_ q_slew : 16|32@1+',
            "signal more of message SlewPosition is unknown",
        ),
        ('VERSION "1"', "VERSION {", r"cannot be read as a DBC"),
    ],
)
def test_a_dbc_that_does_not_match_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    given = DBC
    if "u_slew : 48" in new:
        given = edited(DBC, tmp_path, "u_stick : 48|16", "u_stick : 16|16")
    with pytest.raises(InputError, match=said):
        check_dbc(edited(given, tmp_path, old, new))


def test_no_dbc_at_all_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read as a DBC"):
        check_dbc(tmp_path / "none.dbc")


def test_other_nodes_and_comments_do_not_matter(tmp_path: Path) -> None:
    theirs = (
        "BO_ 2365526199 Theirs: 8 Operator\n"
        ' SG_ theirs : 0|8@1+ (1,0) [0|255] "" Machine\n\n'
        "BO_ 2365526144 SlewCommand: 8 Controller\n"
    )
    text = DBC.read_text().replace("BO_ 2365526144 SlewCommand: 8 Controller\n", theirs, 1)
    text = text.replace("Generated from specs/signals.toml", "Kept by somebody")
    assert theirs in text
    (tmp_path / "other.dbc").write_text(text)
    check_dbc(tmp_path / "other.dbc")


def test_our_map_matches_whatever_it_was_saved_with(tmp_path: Path) -> None:
    check_map(MAP)
    text = MAP.read_text().replace("Slew angle, counter", "The slew's angle, counter")
    (tmp_path / "other.csv").write_text("\ufeff" + text.replace("\n", "\r\n"), encoding="utf-8", newline="")
    check_map(tmp_path / "other.csv")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("q_slew,rad,", "q_slew,deg,", "q_slew has unit deg, not rad"),
        ("target_y,m,-25,25", "target_y,m,-50,25", "target_y has min -50, not -25"),
        (
            "input,3,1,uint16,,1,version,1,1,1,1",
            "input,3,1,uint16,,1,version,1,2,2,2",
            "version has min 2, not 1",
        ),
        ("4=stopping", "4=parked", "control_mode has values .*parked"),
        ("input,17,2,float32", "input,17,4,float32", "q_slew has registers 4, not 2"),
        (
            "input,17,2,",
            "input,300,1,uint16,,1,more,1\ninput,17,2,",
            "register more in table input is unknown",
        ),
        ("input,17,2,float32,high_first", "input,17,2,float32,low_first", "q_slew has word_order low_first"),
        ("input,17,", "input,19,", "q_slew has address 19, not 17"),
        ("q_slew,", "q_slow,", "no register q_slew in table input"),
    ],
)
def test_a_map_that_does_not_match_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        check_map(edited(MAP, tmp_path, old, new))
