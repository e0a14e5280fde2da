"""`python -m benchmarks rigs`: rigs as they are declared, and what an answer counts as."""

import csv
import json
from pathlib import Path

import pytest

from benchmarks.rigs import balls, run as rigs
from reconcile.recordings.checks import open_folder, read_names
from reconcile.recordings.data import read_run
from tests.benchmarks.command import benchmarks
from tests.conftest import ROOT

TABLE = ROOT / "benchmarks" / "rigs" / "rigs.toml"


def test_every_rig_has_its_recordings_and_a_model_that_reads_them():
    found = rigs.read_rigs(TABLE)
    names = ("dfki_pendulum", "ball_drops", "swinging_fork")
    assert [r.name for r in found] == [n + end for n in names for end in ("", "/null")]
    for rig in found:
        folder = open_folder(str(rig.model))
        names = read_names(rig.names, [v.name for v in (*folder.model.inputs, *folder.model.outputs)])
        assert all(read_run(p, folder, names) for p in (*rig.fit, *rig.holdout))


@pytest.mark.parametrize(
    ("rig", "licence", "words"),
    [
        ("ball_drops", "MIT", "Permission is hereby granted"),
        ("swinging_fork", "BSD", "Redistribution and use in source and binary forms"),
    ],
)
def test_the_licence_of_a_recording_comes_along(rig: str, licence: str, words: str):
    data = ROOT / "tests" / "data" / rig
    assert licence in (data / "README.md").read_text()
    assert words in (data / "LICENSE").read_text()


def test_a_constant_force_fits_the_balls_better_than_the_drag_of_the_air():
    left = {name: balls.fit(law, guess)[1] for name, (law, guess, _) in balls.LAWS.items()}
    assert left["constant, c sgn v"] < left["viscous, c v"] < left["drag, c v |v|"] < left["nothing"]


@pytest.mark.parametrize(("name", "start_s", "end_s"), [("energy_shaping", 0.0, 4.5), ("ilqr", 10.5, 17.0)])
def test_stretches_of_the_pendulum_are_rows_of_the_published_files(name: str, start_s: float, end_s: float):
    data = ROOT / "tests" / "data" / "dfki_simple_pendulum"
    files = (data / f"control_method_{name}_data_measured.csv", data / "free" / f"{name}.csv")
    published, used = (list(csv.reader(f.read_text().splitlines())) for f in files)
    assert used == [published[0], *(r for r in published[1:] if start_s <= float(r[0]) < end_s)]
    assert "DFKI" in (data / "LICENSE").read_text()


def report(verdict: str, *named: str, alternatives: tuple = (), kinds: dict | None = None) -> dict:
    effects = [{"name": n, "verdict": "ambiguous" if verdict == "ambiguous" else "named"} for n in named]
    found = {"verdict": verdict, "effects": effects, "alternatives": [list(a) for a in alternatives]}
    return found | ({"kinds": kinds} if kinds else {})


DRY = rigs.Rig("a", (), Path("a"), ("coulomb_friction",), "friction")
NULL = rigs.Rig("a/null", (), Path("a"), ())


@pytest.mark.parametrize(
    ("rig", "code", "late", "answer", "expected"),
    [
        (DRY, 0, False, report("named", "coulomb_friction"), "right"),
        (DRY, 0, False, report("named", "coulomb_friction", "input_lag"), "wrong"),
        (DRY, 0, False, report("named", "input_lag"), "wrong"),
        (DRY, 0, False, report("unexplained", kinds={"friction": 0.97}), "kind_right"),
        (DRY, 0, False, report("unexplained", kinds={"friction": 0.6}), "abstained"),
        (DRY, 0, False, report("unexplained"), "abstained"),
        (
            DRY, 0, False,
            report("ambiguous", "a", alternatives=(("coulomb_friction",), ("input_lag",))), "kind_right",
        ),
        (DRY, 0, False, report("ambiguous", "a", alternatives=(("a",), ("b",))), "wrong"),
        (DRY, 2, False, None, "refused"),
        (DRY, 3, False, None, "crashed"),
        (DRY, -11, False, None, "crashed"),
        (DRY, -24, True, None, "no_answer"),
        (NULL, 0, False, report("agrees"), "right"),
        (NULL, 0, False, report("reestimated"), "right"),
        (NULL, 0, False, report("named", "input_lag"), "wrong"),
    ],
)  # fmt: skip
def test_what_an_answer_counts_as(rig: rigs.Rig, code: int, late: bool, answer: dict | None, expected: str):
    assert rigs.judged(rig, code, late, answer) == expected


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """A rig whose recording is in other units than its model takes it for."""
    (tmp_path / "base").mkdir()
    source = ROOT / "tests" / "data" / "dfki_simple_pendulum" / "model" / "model.py"
    (tmp_path / "base" / "model.py").write_text(source.read_text())
    rows = [f"{0.01 * k:g},{57.29578 * k * k * 5e-5:.9g},{k * 0.01:g},1" for k in range(200)]
    head = "time,position [rad],velocity [rad/s],torque [N.m]"
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]) + "\n")
    file = tmp_path / "rigs.toml"
    file.write_text(f'[odd]\ndata = "{tmp_path}"\nfit = ["a.csv"]\nmodel = "base"\ntruth = ["x"]\n')
    return file


def test_a_refusal_is_a_class_with_what_was_said(table: Path, tmp_path: Path):
    out = tmp_path / "rigs.json"
    assert benchmarks("rigs", "--rigs", table, "--json", out) == 1
    figures = json.loads(out.read_text())["rigs"]["odd"]
    assert figures["class"] == "refused"
    assert "degrees against radians" in figures["said"]
    assert figures["answer"] == [] and figures["truth"] == ["x"] and figures["gap"] == {}  # noqa: PT018
    assert 0.0 < figures["cpu_s"] < rigs.CPU_S


@pytest.mark.parametrize(
    ("was", "instead", "said"),
    [
        ("truth", "thruth", "unknown key 'thruth'"), ("a.csv", "b.csv", "there is no"),
        ("model", "null_model", "no 'model'"),
    ],
)  # fmt: skip
def test_a_table_that_is_not_complete(table: Path, capsys, was: str, instead: str, said: str):
    table.write_text(table.read_text().replace(was, instead))
    assert benchmarks("rigs", "--rigs", table) == 2
    assert said in capsys.readouterr().err


@pytest.mark.long
def test_the_rigs_are_answered_and_their_null_controls_named_nothing(tmp_path: Path):
    out = tmp_path / "rigs.json"
    benchmarks("rigs", "--json", out)
    figures = json.loads(out.read_text())["rigs"]
    found = {n: f["class"] for n, f in figures.items()}
    for gap in figures["dfki_pendulum"]["gap"].values():  # on recordings that other controllers drove
        assert gap["after"] < gap["reestimated"] < gap["nominal"]
    assert found["dfki_pendulum"] in rigs.GOOD
    assert found["ball_drops"] in (*rigs.GOOD, "abstained")  # see docs/results/rigs.md
    assert found["dfki_pendulum/null"] == found["ball_drops/null"] == "right"
    assert found["swinging_fork"] == found["swinging_fork/null"] == "right"
