"""The test pack: this project's own master does every case; the pack and its judge are what they say."""

import csv
import os
import signal
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.testpack import compare, kit, masters, models, ours, pack, page
from benchmarks.testpack.case import Case, evaluated
from benchmarks.testpack.cases import CASES, SUBJECTS
from benchmarks.testpack.cases.common import pair
from benchmarks.testpack.description import description, token
from fmus.toolchain import compiler

BY_NAME = {case.name: case for case in CASES}
ROOT = Path(__file__).parents[2]
FMUS = [(fmu.name, version) for version in (2, 3) for fmu in models.fmus(version)]
SHOWN = [c for c in CASES if c.expect and c.damage == ""]


@pytest.mark.parametrize("name", BY_NAME)
def test_our_master_does_what_the_pack_says(name: str) -> None:
    assert ours.judge(BY_NAME[name]) == ""


# ---- the judge can fail ----


def test_wrong_values_are_noticed() -> None:
    wrong = replace(BY_NAME["linear-fmi2"], expect={"b.y": "2*(5 + 0.1*t) + 90"})
    assert ours.judge(wrong) == "b.y = 110 at t = 0, expected 100"


def test_a_value_that_is_no_number_is_wrong() -> None:
    case = BY_NAME["plain-fmi2"]
    found = np.full(len(case.checked_times), np.nan)
    assert "nan" in ours.compared(case, {"b.y": found})


def test_an_error_that_does_not_name_element_or_line_is_noticed() -> None:
    case = BY_NAME["factor-zero-fmi2"]
    assert "does not name somebody" in ours.judge(replace(case, names=("somebody",)))
    assert "does not name SystemStructure.ssd line 1:" in ours.judge(replace(case, at="<?xml"))


@pytest.mark.parametrize(
    ("name", "kind", "said"),
    [
        ("plain-fmi2", "refused", "it is accepted"),
        ("plain-fmi2", "fails", "it ran to its end"),
        ("plain-fmi2", "ends", "it ended with ''"),
        ("error-fmi3", "right", "RunError: component culprit"),
        ("error-fmi3", "refused", "it is accepted"),
        ("two-sources-fmi2", "right", "InputError: "),
    ],
)
def test_the_wrong_kind_of_end_is_noticed(name: str, kind: str, said: str) -> None:
    assert ours.judge(replace(BY_NAME[name], kind=kind)).startswith(said)


# ---- the cases ----


def test_names_are_unique_and_file_names() -> None:
    assert len(BY_NAME) == len(CASES) == sum(map(len, SUBJECTS.values()))
    assert all(case.name.isascii() and not set(case.name) & set("/\\ .") for case in CASES)


def test_every_case_expects_something() -> None:
    for case in CASES:
        if case.kind == "right":
            assert case.expect, case.name
            assert all(np.isfinite(case.values(n, case.checked_times)).all() for n in case.expect)
        else:
            assert not case.expect, case.name
            assert case.names or case.line or case.damage in ("truncated", "not a zip"), case.name
        assert not case.at or case.line, f"{case.name}: its description has no line with {case.at}"


@pytest.mark.parametrize("case", SHOWN, ids=str)
def test_an_expectation_tells_the_feature_from_its_absence(case: Case) -> None:
    """A case whose values a system of zeros would have too shows nothing."""
    times = case.checked_times
    assert any(np.abs(case.values(name, times)).max() > 2 * case.tolerance for name in case.expect)


def test_formulas_of_time() -> None:
    assert evaluated("pick(whole(t/0.4), 0, 2, 4)", [0.0, 0.3999, 0.4, 0.8, 2.0]).tolist() == [0, 0, 2, 4, 4]
    assert evaluated("7", [0.0, 1.0]).tolist() == [7, 7]


# ---- the FMUs ----


@pytest.mark.parametrize(("name", "fmi_version"), FMUS)
def test_fmus_are_valid(name: str, fmi_version: int) -> None:
    fmpy = pytest.importorskip("fmpy.validation")
    assert fmpy.validate_fmu(str(kit.build(name, fmi_version))) == []


def test_no_two_fmus_share_a_token() -> None:
    """Importers may keep FMUs by their token."""
    tokens = [token(fmu, version) for version in (2, 3) for fmu in models.fmus(version)]
    assert len(tokens) == len(set(tokens))


def test_fmus_that_differ_in_their_descriptions_only_share_a_library() -> None:
    host = compiler.host()
    one, other = (kit.library(models.fmu(n, 3), 3, host) for n in ("gain_deg", "gain_rad"))
    assert one == other
    assert description(models.fmu("gain_deg", 3), 3) != description(models.fmu("gain_rad", 3), 3)


def test_sources_are_short() -> None:
    assert all(len(p.read_text().splitlines()) < 300 for p in kit.SOURCES.iterdir())


# ---- the pack on disk ----


def test_the_pack_is_written_whole_and_the_same_twice(tmp_path: Path) -> None:
    chosen = [BY_NAME[n] for n in ("linear-fmi2", "nested-ssp-fmi3", "factor-zero-fmi3", "links-fmi2")]
    paths = pack.write(tmp_path / "a", chosen)
    again = pack.write(tmp_path / "b", chosen)
    assert [p.name for p in paths] == [f"{c.name}.ssp" for c in chosen]
    assert [p.read_bytes() for p in paths] == [p.read_bytes() for p in again]
    rows = list(csv.DictReader((tmp_path / "a" / "linear-fmi2" / "expected.csv").open()))
    assert [float(row["b.y"]) for row in rows] == pytest.approx([110 + 0.02 * i for i in range(9)])
    assert (tmp_path / "a" / "sources" / "models.c").is_file()
    said = (tmp_path / "a" / "factor-zero-fmi3" / "expected.txt").read_text()
    assert "must be refused before the first step" in said
    assert f"SystemStructure.ssd line {BY_NAME['factor-zero-fmi3'].line}" in said


def test_the_readme_lists_all_cases() -> None:
    text = pack.readme(CASES)
    assert all(f"| {case.name} " in text for case in CASES)


@pytest.mark.long
def test_fmus_for_other_platforms(tmp_path: Path) -> None:
    path = kit.build("gain", 2, ("x86_64-linux", "x86_64-windows"))
    names = zipfile.ZipFile(path).namelist()
    assert {"binaries/linux64/gain.so", "binaries/win64/gain.dll"} <= set(names)


@pytest.mark.parametrize("case", [c for c in CASES if c.kind == "right" and c.fmi_version == 2], ids=str)
def test_descriptions_follow_the_schema_of_ssp_1(case: Case, tmp_path: Path) -> None:
    """FMPy brings the schemas of SSP 1.0 and validates while it reads."""
    ssd = pytest.importorskip("fmpy.ssp.ssd")
    assert ssd.read_ssd(str(pack.write_case(tmp_path, case))).name == "case"


# ---- other masters ----


def judged(name: str, **answer: object) -> str:
    return compare.judged(BY_NAME[name], answer)["verdict"]


def test_verdicts() -> None:
    assert judged("plain-fmi2", outcome="ran", values={"b.y": 5.07}) == "right"
    assert judged("linear-fmi2", outcome="ran", values={"b.y": 5.07}) == "wrong"
    assert judged("linear-fmi2", outcome="ran", values={"b.y": float("nan")}) == "wrong"
    assert judged("linear-fmi2", outcome="ran", values={}) == "unseen"
    assert judged("linear-fmi2", outcome="refused", message="no transformations") == "refused"
    assert judged("linear-fmi2", outcome="crashed", message="SIGSEGV") == "crashed"
    assert judged("two-sources-fmi2", outcome="ran", values={}) == "wrong"
    assert judged("two-sources-fmi2", outcome="refused", message="something is wrong") == "unnamed"
    assert judged("two-sources-fmi2", outcome="refused", message="two links to gain.fmu/u") == "right"
    assert judged("two-sources-fmi2", outcome="refused", message="b::u is already connected") == "right"


def test_connectors_that_only_show_a_variable_are_taken_out() -> None:
    content = pack.content(BY_NAME["plain-fmi2"])
    text = masters.unzipped(masters.without_connectors(content))["SystemStructure.ssd"].decode()
    assert 'endConnector="b_y"' in pair()
    assert "b_y" not in text
    assert 'endConnector="u"' in text
    assert masters.without_connectors(b"no zip") == b"no zip"


@pytest.mark.parametrize(
    ("does", "outcome"),
    [
        (lambda case, path: {"b.y": 1.0}, "ran"),
        (lambda case, path: os.kill(os.getpid(), signal.SIGKILL), "crashed"),
        (lambda case, path: os._exit(3), "crashed"),
        (lambda case, path: 1 // 0, "failed"),
        (lambda case, path: signal.pause(), "hung"),
    ],
)
def test_a_master_may_do_anything(
    does: masters.Callable, outcome: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(masters.MASTERS, "other", does)
    monkeypatch.setattr(masters, "PATIENCE_S", 0.5)
    path = pack.write_case(tmp_path, BY_NAME["plain-fmi2"])
    assert masters.run("other", BY_NAME["plain-fmi2"], path)["outcome"] == outcome


@pytest.mark.interop
@pytest.mark.parametrize("key", masters.MASTERS)
def test_other_masters_do_a_plain_connection(key: str) -> None:
    """So that what they get wrong elsewhere is theirs."""
    if not compare.versions()[key]:
        pytest.skip(f"{key} is not installed")
    chosen = [BY_NAME["plain-fmi2"], BY_NAME["type-integer-fmi2"], BY_NAME["counter-fmi2"]]
    found = compare.of_master(key, chosen, _written(chosen))
    assert {row["verdict"] for row in found.values()} == {"right"}, found


def _written(cases: list[Case]) -> Path:
    folder = kit.OUT / "tests"
    pack.write(folder, cases)
    return folder


def test_the_page_lists_every_case() -> None:
    outcomes = {
        key: {case.name: {"verdict": "right", "message": ""} for case in CASES}
        for key in ("slewright", *masters.MASTERS)
    }
    outcomes["ecos"]["linear-fmi2"] = {"verdict": "wrong", "message": "b.y = 5, expected 110"}
    text = page.render(CASES, outcomes)
    assert all(f"| {case.name.rpartition('-')[0]} |" in text for case in CASES)
    assert "| right | right | right | **wrong** / right | right |" in text
    assert "linear-fmi2: b.y = 5, expected 110" in text


def test_the_committed_page_is_of_these_cases() -> None:
    text = (ROOT / "docs" / "results" / "testpack.md").read_text(encoding="utf-8")
    assert all(f"| {case.name.rpartition('-')[0]} |" in text for case in CASES)


def test_the_command(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "benchmarks", "testpack"]
    done = subprocess.run(
        [*command, str(tmp_path / "pack")], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert f"({len(CASES)} cases)" in done.stdout
    assert len(list((tmp_path / "pack").glob("*/*.ssp"))) == len(CASES)
    nothing = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert nothing.returncode == 2
    assert "name a folder" in nothing.stderr
