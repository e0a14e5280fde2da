"""`slewright convert`: from file to file, with what was mended and what is lost said."""

import json

import numpy as np
import pytest

from records.formats import read_measurement, write_measurement
from slewright import __main__ as entry
from tests.records.formats.samples import one_rate, recording


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "in.mf4"
    write_measurement(recording(), path)
    return path


def test_every_format_from_every_other(tmp_path, source, capsys):
    last = source
    for number, suffix in enumerate((".mcap", ".blf", ".asc", ".mf4")):
        target = tmp_path / f"{number}{suffix}"
        assert entry.run(["convert", str(last), str(target)]) == 0
        last = target
    printed = capsys.readouterr().out
    assert "not kept: values: rounded to the steps of the DBC" in printed
    found, sent = read_measurement(last), recording()
    assert set(found.channels) == set(sent.channels)
    np.testing.assert_allclose(found["q_slew"].time, sent["q_slew"].time, atol=1e-9)
    np.testing.assert_allclose(found["q_slew"].values, sent["q_slew"].values, atol=1e-6)


def test_a_table_of_several_rates_needs_a_step(tmp_path, source, capsys):
    target = tmp_path / "out.csv"
    assert entry.run(["convert", str(source), str(target)]) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("slewright:")]
    assert len(said) == 1
    assert "50 Hz (3 channels: q_slew …), 10 Hz (2 channels: target_x …)" in said[0]
    assert "--step S" in said[0]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in.mf4"]

    figures = tmp_path / "f.json"
    assert entry.run(["convert", str(source), str(target), "--step", "0.1", "--json", str(figures)]) == 0
    assert "mended: put on a grid of 0.1 s" in capsys.readouterr().out
    content = json.loads(figures.read_text())
    assert content["channels"]["target_x"] == {"samples": 100, "period_s": pytest.approx(0.1)}
    assert content["start"] == "2025-03-01T12:30:00.123456+02:00"
    assert any("kept as a gap" in line for line in content["repairs"])
    assert "types: whole numbers become floats" in content["not_kept"]


def test_nothing_is_overwritten_unless_forced(tmp_path, source, capsys):
    target = tmp_path / "out.mcap"
    target.write_text("mine")
    assert entry.run(["convert", str(source), str(target)]) == 2
    assert "is there already; --force overwrites it" in capsys.readouterr().err
    assert target.read_text() == "mine"
    assert entry.run(["convert", str(source), str(target), "--force"]) == 0
    assert set(read_measurement(target).channels) == set(recording().channels)


def test_names_from_a_file(tmp_path, capsys):
    (tmp_path / "in.csv").write_text("Zeit [ms];Winkel\n0;90\n20;180\n")
    (tmp_path / "map.toml").write_text('[names]\n"Winkel" = "-q_slew [deg]"\n')
    run = [
        "convert",
        str(tmp_path / "in.csv"),
        str(tmp_path / "out.parquet"),
        "--map",
        str(tmp_path / "map.toml"),
    ]
    assert entry.run(run) == 0
    found = read_measurement(tmp_path / "out.parquet")
    np.testing.assert_allclose(found["q_slew"].values, [-np.pi / 2, -np.pi])
    assert found.meta["repairs"] == ["q_slew: converted from deg to rad"]
    assert "mended: q_slew: converted from deg to rad" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("x = 1", "unknown key x"),
        ("[names]\na = 1", "no table"),
        ("", "no table"),
        ("[names", "not valid TOML"),
    ],
)
def test_a_map_that_cannot_be_read(tmp_path, source, capsys, content, said):
    (tmp_path / "map.toml").write_text(content)
    run = ["convert", str(source), str(tmp_path / "out.mcap"), "--map", str(tmp_path / "map.toml")]
    assert entry.run(run) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["{in}", "{dir}/out.xls"], "no format that is written; valid: .parquet, .csv"),
        (["{dir}/none.mf4", "{dir}/out.csv"], "no recording at"),
        (["{in}", "{in}"], "the results need a file of another name"),
        (["{in}", "{dir}/out.csv", "--json", "{dir}/out.csv"], "is the file that the recording goes to"),
        (["{in}", "{dir}/no/out.csv"], "there is no folder"),
        (["{in}", "{dir}/out.csv", "--step", "0"], "more than 0 s"),
        (["{dir}/odd.xls", "{dir}/out.csv", "--dbc", "x.dbc"], "--dbc is for CAN logs"),
        (["{in}", "{dir}/out.mcap", "--decimal", ","], "is no text file: --decimal is for .csv"),
        (["{in}", "{dir}/out.mcap", "--protocol", "j1939"], "--protocol j1939: j1939 or can, for CAN logs"),
        (["{in}", "{dir}/out.blf", "--dbc", "x.dbc"], "no DBC at x.dbc"),
        (["{dir}/odd.xls", "{dir}/out.blf"], "unknown format '.xls'"),
    ],
)
def test_wrong_input_is_refused_in_a_line_and_nothing_is_written(tmp_path, source, capsys, arguments, said):
    (tmp_path / "odd.xls").write_text("x")
    before = sorted(p.name for p in tmp_path.iterdir())
    filled = [a.replace("{in}", str(source)).replace("{dir}", str(tmp_path)) for a in arguments]
    assert entry.run(["convert", *filled]) == 2
    shown = [line for line in capsys.readouterr().err.splitlines() if line.startswith("slewright:")]
    assert len(shown) == 1
    assert said in shown[0]
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_a_damaged_recording_says_where(tmp_path, capsys):
    rows = [f"{0.02 * (i if i < 50 else i - 30):.2f},{i}" for i in range(100)]
    (tmp_path / "in.csv").write_text("\n".join(["time [s],x", *rows, ""]))
    assert entry.run(["convert", str(tmp_path / "in.csv"), str(tmp_path / "out.mf4")]) == 2
    said = capsys.readouterr().err
    assert "in.csv: the clock jumps back by 0.58 s at line 52 at 0.4 s; cut the recording there" in said


def test_what_a_format_has_no_place_for_is_said(tmp_path, capsys):
    write_measurement(one_rate(), tmp_path / "in.parquet")
    assert entry.run(["convert", str(tmp_path / "in.parquet"), str(tmp_path / "out.csv")]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert "mended: no samples from 2 s to 3.02 s: kept as a gap" in printed
    assert "not kept: types: flags become floats" in printed
    assert "not kept: descriptions of channels" in printed
    assert printed[-1].startswith(f"written: {tmp_path / 'out.csv'}, 3 channels, 1500 samples, ")
