"""FMUs and SSPs with one fault each (tests/orchestrator/foreign): the right value, or the right words."""

import sys
from pathlib import Path
from typing import Any

import pytest

from orchestrator.files import scratch
from orchestrator.files.scratch import Scratch
from orchestrator.run.simulate import simulate
from orchestrator.system import overview
from orchestrator.system.check import load_system
from records.record import Record, read
from specs.errors import InputError, RunError

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="their libraries are for Linux")

FOREIGN = Path(__file__).parents[1] / "foreign"
TICKS = 10


def run(name: str, **more: Any) -> Record:
    return simulate(load_system(FOREIGN / name), TICKS, **more)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("c_getdiscard", "asked to get an output, returned discard"),
        ("c3_setdiscard", "asked to set an input, returned discard"),
        ("c_discard_beyond", "it says that it reached t = 0.08 s in a step from 0.04 s to 0.06 s"),
        ("c_discard_nan", "it says that it reached t = nan s"),
        ("c_discard_past", "it says that it reached t = -0.96 s"),
        ("c3_early_noflag", "it says that it reached t = 0.05 s"),
        ("c_term_error", "component M: terminate returned error"),
        ("c_needstop", "stop time must be defined"),
        ("c_log", "the FMU returned error (100% done 3"),
    ],
)
def test_runs_that_fail(tmp_path: Path, name: str, words: str) -> None:
    path = tmp_path / "r.parquet"
    with pytest.raises(RunError) as caught:
        run(f"{name}.fmu", record_path=path)
    assert words in str(caught.value)
    assert not path.exists() or not read(path).complete


def test_a_terminate_that_hangs_is_limited() -> None:
    with pytest.raises(RunError, match=r"no answer from terminate within 0\.5 s"):
        run("c_term_hang.fmu", limit_s=0.5)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("c_zero", "its library M.so is empty"),
        ("c_text", "is a text"),
        ("c_trunc", "is truncated: 8280 bytes of at least 9080"),
        ("c_pe", "is a program of Windows"),
        ("c_lfs_pointer", "is a pointer of Git LFS"),
        ("c_needlib_missing", "needs libhelper.so, which the loader finds in none of its folders"),
        ("c_unres", "uses nowhere_defined, which no library that it needs has"),
        ("c_version", "says it is of FMI 1.0, its description 2.0"),
    ],
)
def test_libraries_that_check_refuses(name: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        overview.figures(load_system(FOREIGN / f"{name}.fmu"))


def test_what_check_says_and_lets_pass() -> None:
    found = overview.figures(load_system(FOREIGN / "c_state_missing.fmu"))
    assert any("promises canGetAndSetFMUstate, but its library lacks" in w for w in found["warnings"])
    assert overview.figures(load_system(FOREIGN / "c_warn.fmu"))["warnings"] == []


def test_the_words_of_an_fmu_are_kept() -> None:
    assert run("c_warn.fmu").meta["messages"] == {"M": ["limit reached (10 times)"]}


def test_what_fmus_are_told() -> None:
    assert run("c_needstop.fmu", tell_stop=True, tell_tolerance=1e-4).complete
    assert run("c_start_time.fmu").time[0] == 5.0
    assert run("c_start_time.fmu", start_s=0.0).time[0] == 0.0
    assert "M.s" in run("c_warn.fmu", texts=["M.s"]).meta["texts"]


def test_columns_that_are_called_time() -> None:
    assert "M.time" in run("c_name_time.fmu").names
    assert "t.time" in run("col_time.ssp").names


def test_units_without_a_definition() -> None:
    assert run("ssd_unit_nobase.ssp").column("y")[-1] == pytest.approx(278.15)
    warnings = load_system(FOREIGN / "unit_nobase_to_Pa.ssp").warnings
    assert any("the unit 'bar' is not defined by its FMU" in w for w in warnings)
    with pytest.raises(InputError, match=r"\[m, defined as kg·m\] does not fit .*\[m, defined as m\]"):
        load_system(FOREIGN / "osp43.ssp")


def test_what_others_write_is_read() -> None:
    for name in ("z_case_twice.fmu", "z_colon_name.fmu", "z_cp437_name.fmu", "oms1628.ssp"):
        assert run(name).complete
    assert load_system(FOREIGN / "t3_Int8_-128.ssp").step_s == 0.1
    warnings = load_system(FOREIGN / "p_ssm_unmapped_dropped.ssp").warnings
    assert any("no mapping entry names the parameter 'Float64_tunable_parameter'" in w for w in warnings)


def test_folders_of_processes_that_are_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scratch.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(scratch.tempfile, "tempdir", str(tmp_path))
    alive, other = Scratch(), tmp_path / "slewright-other"
    left = tmp_path / "slewright-left"
    for folder in (left, other):
        folder.mkdir()
    (left / scratch.LOCK).touch()
    assert scratch.clean() == 1
    assert alive.path.is_dir()
    assert other.is_dir()  # without a lock it may be anybody's
    assert not left.exists()
