"""`slewright campaign` as a user calls it."""

import json
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from tests.orchestrator.systems import OSCILLATOR, write_ssp

Slewright = Callable[..., CompletedProcess[str]]
PLAN = """
description = "Short runs"
[[files]]
path = "test.ssp"
stop_s = 0.2
seeds = [1, 2]
faults = ["no-fault", "broken"]
[[faults.broken]]
target = "speed"
kind = "fail"
start_s = 0.05
"""


@pytest.mark.long
def test_a_campaign_from_plan_to_page(tmp_path: Path, slewright: Slewright) -> None:
    write_ssp(tmp_path, OSCILLATOR, ["position", "speed"])
    plan, out, figures = tmp_path / "p.toml", tmp_path / "out", tmp_path / "f.json"
    plan.write_text(PLAN)
    first = slewright("campaign", plan, "--out", out, "--jobs", "1", "--json", figures)
    assert first.returncode == 3
    assert "4 of 4 runs finished (4 now), 2 failed, 0 miss a limit" in first.stdout
    assert "failed: test/broken/1: component speed failed in the step from t = 0.05 s" in first.stdout
    assert "Traceback" not in first.stderr
    found = json.loads(figures.read_text())
    assert sorted(found["failed"]) == ["test/broken/1", "test/broken/2"]
    assert found["content_hash"][:16] in first.stdout
    again = slewright("campaign", plan, "--out", out, "--only", "test/no-fault/2", "--record")
    assert "(1 now)" in again.stdout
    assert (out / "records" / "test--no-fault--2.parquet").is_file()
    assert json.loads((out / "campaign.json").read_text())["content_hash"] == found["content_hash"]


def test_wrong_input_ends_with_2(tmp_path: Path, slewright_here: Slewright) -> None:
    plan = tmp_path / "p.toml"
    plan.write_text(PLAN)
    done = slewright_here("campaign", plan, "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert "files.1: there is no file test.ssp" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.long
@pytest.mark.browser
def test_the_page_loads_nothing_and_shows_every_run(
    tmp_path: Path, slewright: Slewright, browser: str
) -> None:
    import subprocess

    write_ssp(tmp_path, OSCILLATOR, ["position", "speed"])
    plan, out = tmp_path / "p.toml", tmp_path / "out"
    plan.write_text(PLAN)
    slewright("campaign", plan, "--out", out, "--jobs", "1")
    flags = (
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--no-first-run",
    )
    line = [browser, *flags, "--virtual-time-budget=5000", "--dump-dom", (out / "summary.html").as_uri()]
    dom = subprocess.run(line, capture_output=True, text=True, check=True, timeout=120).stdout
    assert 'src="http' not in dom
    assert dom.count("boxlayer") > 0  # drawn
    assert "test/broken/1" in dom
