"""The same artefact and seed give the same bytes, whoever computes them and with how many workers."""

import random
import zipfile
from pathlib import Path

from orchestrator.system.pack import pack_system
from tests.conftest import Command
from tests.verification.campaign.test_campaign import done, written
from tests.verification.test_verify import ONE
from verification.campaign.journal import content_hash


def test_the_same_results_whoever_does_them_in_whatever_order(tmp_path: Path) -> None:
    written(tmp_path)
    one, two = done(tmp_path, "one"), done(tmp_path, "two", jobs=2)
    assert one.content_hash == two.content_hash
    results = list(one.results.values())
    random.Random(5).shuffle(results)
    assert content_hash(results) == one.content_hash
    results[0]["figures"]["place end"] += 1e-16
    assert content_hash(results) != one.content_hash


PD = ("--controller", "pd")


def test_same_seed_same_bytes_whatever_the_number_of_jobs(slewright: Command, tmp_path: Path) -> None:
    for name, jobs in (("a", "1"), ("b", "2")):
        done = slewright("verify", *ONE[:2], *PD, "--out", tmp_path / name, "--jobs", jobs)
        assert done.returncode in (0, 1), done.stderr
    for system in ("nominal", "reference"):
        file = f"records/four_targets_unknown-{system}.parquet"
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    other = slewright("verify", *ONE, *PD, "--out", tmp_path / "c", "--seed", "2")
    assert other.returncode in (0, 1)
    file = "records/four_targets_unknown-nominal.parquet"
    assert (tmp_path / "a" / file).read_bytes() != (tmp_path / "c" / file).read_bytes()


def test_packages_are_the_same_bytes_and_have_no_time_of_day(tmp_path: Path) -> None:
    first = pack_system("nominal", 2, tmp_path / "a")
    second = pack_system("nominal", 2, tmp_path / "b")
    assert first.read_bytes() == second.read_bytes()
    with zipfile.ZipFile(first) as archive:
        assert archive.namelist()[0] == "SystemStructure.ssd"
        assert {e.date_time for e in archive.infolist()} == {(2020, 1, 1, 0, 0, 0)}
        assert {n for n in archive.namelist() if n.endswith(".fmu")} == {
            f"resources/{n}.fmu" for n in ("pi", "slew", "arm", "tool")
        }
