"""`slewright verify` as a user runs it: what it writes, its exit codes, and what becomes of bad input."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from records.record import read

BEGIN, END = "<!-- results:begin -->", "<!-- results:end -->"

Command = Callable[..., subprocess.CompletedProcess[str]]
MODELS = Path(__file__).parent / "models"
ONE = ("--scenario", "four_targets_unknown", "--system", "nominal")


@pytest.fixture(scope="module")
def verified(
    tmp_path_factory: pytest.TempPathFactory, root: Path
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """One scenario on both systems."""
    out = tmp_path_factory.mktemp("verify")
    line = [
        sys.executable,
        "-m",
        "slewright",
        "verify",
        "--scenario",
        "four_targets_empty",
        "--out",
        str(out),
    ]
    line += ["--json", str(out / "figures.json"), "--seed", "3"]
    environment = {**os.environ, "PYTHONPATH": str(root), "COLUMNS": "200"}
    return out, subprocess.run(line, cwd=root, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.long
def test_writes_figures_records_and_report(verified: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    out, done = verified
    assert done.returncode in (0, 1), done.stderr
    figures = json.loads((out / "figures.json").read_text())
    assert list(figures["controllers"]) == ["policy", "pi"]
    for controller, folder in (("policy", out), ("pi", out / "pi")):
        found = figures["controllers"][controller]
        for system in ("nominal", "reference"):
            metrics = found["scenarios"]["four_targets_empty"][system]
            for name in ("speed", "overshoot", "error", "tool"):
                assert math.isfinite(metrics[name])
            assert metrics["missed"] in range(5)
            assert found["realtime_factor"][system] > 0
            record = read(folder / "records" / f"four_targets_empty-{system}.parquet")
            assert record.complete
            assert record.meta["controller"] == controller
            assert len(record.time) == 60 * 50 + 1
    assert figures["accepted"] is (done.returncode == 0)
    assert figures["seed"] == 3
    page = (out / "report.html").read_text()
    assert len(page) > 1e6
    assert "For comparison: pi (not accepted" in page
    stored = json.loads((out / "metrics.json").read_text())
    assert stored["controllers"] == figures["controllers"]


@pytest.mark.long
@pytest.mark.browser
def test_report_is_drawn_in_a_browser(
    verified: tuple[Path, subprocess.CompletedProcess[str]], browser: str, tmp_path: Path
) -> None:
    page = (verified[0] / "report.html").resolve().as_uri()
    flags = "--headless --no-sandbox --disable-gpu --disable-background-networking --no-first-run --dump-dom"
    line = [browser, *flags.split(), "--virtual-time-budget=20000", f"--user-data-dir={tmp_path}", page]
    shown = subprocess.run(line, capture_output=True, text=True, check=True, timeout=120).stdout
    assert shown.count('class="js-line"') > 20
    assert "simulated reference machine" in shown


@pytest.mark.parametrize("seed", [1, pytest.param(7, marks=pytest.mark.long)])
def test_what_ships_is_accepted_and_the_pi_beside_it_is_not(
    slewright: Command, tmp_path: Path, seed: int
) -> None:
    """The main job with its defaults: all six scenarios on both systems, every limit met by the policy."""
    done = slewright("verify", "--out", tmp_path, "--seed", str(seed), "--json", tmp_path / "f.json")
    assert done.returncode == 0, done.stdout + done.stderr
    figures = json.loads((tmp_path / "f.json").read_text())
    policy, pi = figures["controllers"]["policy"], figures["controllers"]["pi"]
    assert len(policy["scenarios"]) == len(pi["scenarios"]) == 6
    assert figures["accepted"] is policy["accepted"] is True
    assert pi["accepted"] is False
    assert {limit["metric"] for limit in policy["limits"]} >= {"missed", "error", "overshoot", "tool"}
    (sentence,) = figures["comparison"]
    assert sentence.startswith("policy misses 0 of 54 targets, pi ")
    assert sentence.endswith("policy is better in all.")
    assert sentence in done.stdout


def test_a_controller_by_name_is_held_to_the_limits_of_what_ships(slewright: Command, tmp_path: Path) -> None:
    done = slewright("verify", *ONE, "--controller", "pi", "--out", tmp_path, "--json", tmp_path / "f.json")
    assert done.returncode == 1, done.stderr
    figures = json.loads((tmp_path / "f.json").read_text())
    assert list(figures["controllers"]) == ["pi"]
    assert figures["comparison"] == []
    assert "missed 4, limit ≤ 0 (every target is reached within its 15 s)" in done.stdout


def test_unknown_scenario(slewright_here: Command, tmp_path: Path) -> None:
    done = slewright_here("verify", "--scenario", "four_target_empty", "--out", tmp_path / "o")
    assert done.returncode == 2
    assert "unknown scenario 'four_target_empty'" in done.stderr
    assert "four_targets_empty" in done.stderr
    assert not (tmp_path / "o").exists()
    far = slewright_here("verify", "--scenario", "x", "--out", tmp_path / "o").stderr
    assert far.count("five_targets_unknown") == 1


def test_model_without_the_connectors(slewright_here: Command, tmp_path: Path, root: Path) -> None:
    folder = root / "tests" / "fmus" / "samples" / "oscillator"
    done = slewright_here("verify", *ONE, "--model", folder, "--out", tmp_path / "o")
    assert done.returncode == 2
    assert "replaces nothing" in done.stderr
    assert "qd_boom_ref" in done.stderr
    assert not (tmp_path / "o").exists()


def test_failing_controller_is_named_and_the_record_kept(slewright: Command, tmp_path: Path) -> None:
    done = slewright("verify", *ONE, "--model", MODELS / "breaking_controller", "--out", tmp_path)
    assert done.returncode == 3
    assert "four_targets_unknown on nominal" in done.stderr
    assert "component pi" in done.stderr
    assert "1.0" in done.stderr
    record = read(tmp_path / "records" / "four_targets_unknown-nominal.parquet")
    assert not record.complete
    assert record.reason
    assert 45 <= len(record.time) <= 55


def test_interrupted_runs_stay_readable(tmp_path: Path, root: Path) -> None:
    """Ctrl-C reaches the whole process group, as from a terminal."""
    line = [
        sys.executable,
        "-m",
        "slewright",
        "verify",
        "--system",
        "reference",
        "--jobs",
        "1",
        "--out",
        str(tmp_path),
    ]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    process = subprocess.Popen(
        line, cwd=root, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + 120
    while not any(p.stat().st_size for p in tmp_path.glob("records/*.recording")):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(timeout=60) == 130
    kept = list((tmp_path / "records").iterdir())
    assert kept
    assert any(not read(p).complete for p in kept)


def test_readme_table_is_filled(slewright: Command, tmp_path: Path) -> None:
    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    done = slewright("verify", *ONE, "--out", tmp_path / "o", "--readme", readme)
    assert done.returncode in (0, 1), done.stderr
    text = readme.read_text()
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "| nominal model | policy |" in text
    assert "| nominal model | pi |" in text
    picture = (tmp_path / "docs" / "run.svg").read_text()
    assert picture.startswith("<svg")
    assert "repeatCount='indefinite'" in picture  # it moves


TARGET_FILE = """
description = "One short move"
interval_s = 15.0
targets = [{ slew_deg = 60.0, radius_m = RADIUS, height_m = 5.0 }]
[start]
slew_deg = 0.0
q_boom = 1.3
q_stick = -1.9
[loads.empty]
description = "Empty grab"
low_kg = 0.0
high_kg = 0.0
told_kg = 0.0
"""


@pytest.mark.long
def test_a_target_file_of_the_user_runs(slewright: Command, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(TARGET_FILE.replace("RADIUS", "10.0"))
    line = ("--scenario", tmp_path / "mine.toml", "--system", "nominal", "--out", tmp_path / "o")
    done = slewright("verify", *line, "--json", tmp_path / "f.json")
    assert done.returncode in (0, 1), done.stderr
    policy = json.loads((tmp_path / "f.json").read_text())["controllers"]["policy"]
    assert list(policy["scenarios"]) == ["mine_empty"]


PROVOKED = """
[[faults]]
target = "TARGET"
kind = "bias"
start_s = 1.0
value = 0.3
[[changes]]
parameter = "tool.load_mass"
at_s = 10.0
value = 0.0
"""


@pytest.mark.long
def test_faults_and_changed_parameters_of_a_target_file_are_in_the_run(
    slewright: Command, tmp_path: Path
) -> None:
    text = TARGET_FILE.replace("RADIUS", "10.0")
    (tmp_path / "plain.toml").write_text(text)
    (tmp_path / "bent.toml").write_text(text + PROVOKED.replace("TARGET", "pi.q_slew"))
    for name in ("plain", "bent"):
        line = ("--scenario", tmp_path / f"{name}.toml", "--system", "nominal", "--out", tmp_path / name)
        assert slewright("verify", *line).returncode in (0, 1)
    plain, bent = (read(tmp_path / n / "records" / f"{n}_empty-nominal.parquet") for n in ("plain", "bent"))
    assert bent.meta["faults"] == [{"target": "pi.q_slew", "kind": "bias", "start_s": 1.0, "value": 0.3}]
    assert bent.meta["changes"] == {"500": {"tool.load_mass": 0.0}}
    assert plain.column("u_slew")[:51].tolist() == bent.column("u_slew")[:51].tolist()
    # The controller turns the slew to where its sensor tells the target, about 0.3 rad too far to the right.
    assert -0.5 < bent.column("q_slew")[-1] - plain.column("q_slew")[-1] < -0.2
    assert (
        "Fault: bias on pi.q_slew, 1 s to the end: value 0.3" in (tmp_path / "bent/report.html").read_text()
    )


def test_a_fault_on_what_a_system_lacks_is_refused_before_anything_runs(
    slewright_here: Command, tmp_path: Path
) -> None:
    text = TARGET_FILE.replace("RADIUS", "10.0") + PROVOKED.replace("TARGET", "pi.q_slow")
    (tmp_path / "bent.toml").write_text(text)
    line = ("--scenario", tmp_path / "bent.toml", "--system", "nominal", "--out", tmp_path / "o")
    done = slewright_here("verify", *line)
    assert done.returncode == 2
    assert "scenario bent_empty, system nominal: fault 'bias' on pi.q_slow" in done.stderr
    assert "did you mean" in done.stderr
    assert not list((tmp_path / "o" / "records").iterdir())


def test_target_out_of_reach(slewright_here: Command, tmp_path: Path) -> None:
    (tmp_path / "far.toml").write_text(TARGET_FILE.replace("RADIUS", "25.0"))
    done = slewright_here("verify", "--scenario", tmp_path / "far.toml", "--out", tmp_path / "o")
    assert done.returncode == 2
    assert "scenario far_empty, target 1: target out of reach" in done.stderr
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("below", ["", "o"])
def test_an_unusable_folder_is_refused_before_anything_runs(
    slewright_here: Command, tmp_path: Path, below: str
) -> None:
    (tmp_path / "file").write_text("")
    done = slewright_here("verify", *ONE, "--out", tmp_path / "file" / below)
    assert done.returncode == 2
    assert "cannot be made" in done.stderr
    assert "building" not in done.stderr
    assert (tmp_path / "file").read_text() == ""


def test_a_broken_model_file_is_named(slewright_here: Command, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "model.py").write_text("x = (\n")
    done = slewright_here("verify", *ONE, "--model", tmp_path / "mine", "--out", tmp_path / "o")
    assert done.returncode == 2
    assert "model.py cannot be imported: SyntaxError" in done.stderr
    assert len(done.stderr.splitlines()) <= 2
