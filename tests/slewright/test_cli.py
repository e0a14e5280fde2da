"""Exit codes and messages of the command line."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import pytest

from orchestrator.system.pack import pack_system
from slewright import __main__ as entry
from slewright.app import COMMANDS, MOVED, PANELS, ROOMS
from specs.errors import InputError, RunError
from tests.conftest import ROOT, Command


@pytest.fixture
def generator(monkeypatch: pytest.MonkeyPatch):
    """Put a stand-in behind `slewright generate`."""

    def arrange(main: Callable[[bool], list[Path]]) -> None:
        monkeypatch.setattr("specs.generate.main", main)

    return arrange


@pytest.fixture
def failing(generator):
    """Make `slewright generate` end in a given exception."""

    def arrange(error: BaseException) -> None:
        def main(check: bool) -> list[Path]:
            raise error

        generator(main)

    return arrange


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (InputError("signal 'u_slow': did you mean u_slew?"), 2, "signal 'u_slow': did you mean u_slew?"),
        (RunError("FMU 'machine' failed at 3.2 s"), 3, "FMU 'machine' failed at 3.2 s"),
        (OSError(28, "No space left on device"), 3, "No space left on device"),
        (ZeroDivisionError("division by zero"), 3, "internal error: ZeroDivisionError"),
        (ModuleNotFoundError("no", name="casadi"), 2, "pip install 'slewright[verify]'"),
        (ModuleNotFoundError("no", name="baselines.gone"), 2, "needs baselines.gone"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_a_failure_becomes_its_exit_code_and_at_most_two_lines(failing, capsys, error, code, said):
    failing(error)
    assert entry.run(["generate", "--check"]) == code
    printed = capsys.readouterr()
    assert said in printed.err
    assert "Traceback" not in printed.err
    assert len(printed.err.strip().splitlines()) <= 2


def test_traceback_lets_the_error_through(failing, monkeypatch):
    monkeypatch.setenv("SLEWRIGHT_TRACEBACK", "")  # set by the command, taken back after the test
    failing(InputError("wrong"))
    with pytest.raises(InputError, match="wrong"):
        entry.run(["--traceback", "generate"])


def test_stale_files_are_not_accepted(generator, capsys):
    generator(lambda check: [Path("specs/generated/machine.dbc")] if check else [])
    assert entry.run(["generate", "--check"]) == 1
    assert "out of date: specs/generated/machine.dbc" in capsys.readouterr().out
    assert entry.run(["generate"]) == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["verfy"], "verify"),
        (["verify", "--sytem", "nominal"], "--system"),
        (["verify", "--system", "real"], "'nominal', 'reference', 'both'"),
        (["verify", "--seed", "x"], "--seed"),
        (["simulate", "plant.ssp"], "--out"),
        (["generate", "extra"], "extra"),
    ],
)
def test_wrong_usage_names_the_offender_in_one_line(capsys, arguments, said):
    assert entry.run(arguments) == 2
    printed = capsys.readouterr().err
    assert said in printed
    assert len(printed.strip().splitlines()) == 1


@pytest.mark.parametrize("target", ["missing/figures.json", "."])
def test_figures_that_could_not_be_written_are_refused_first(capsys, monkeypatch, tmp_path, target):
    monkeypatch.chdir(tmp_path)
    assert entry.run(["build", "--json", target]) == 2
    assert target.split("/")[0] in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_help_lists_every_command_in_its_panel(slewright: Command):
    shown = slewright("--help")
    assert shown.returncode == 0
    panels = shown.stdout.split("╭─ ")[1:]
    listed = {panel.split(" ─")[0]: panel for panel in panels}
    for panel, (_, names) in PANELS.items():
        assert [name for name in names if f"│ {name} " not in listed[panel]] == []


@pytest.mark.parametrize("command", MOVED)
def test_a_command_that_moved_answers_with_its_new_name(command, capsys):
    assert entry.run([command, "--help"]) == 2
    assert f"python -m benchmarks {command}" in capsys.readouterr().err


def test_a_benchmark_that_moved_answers_with_its_new_name(capsys):
    assert entry.run(["bench", "orchestrator", "--json", "x"]) == 2
    assert "python -m benchmarks orchestrator" in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command, capsys):
    assert entry.run([command, "--help"]) == 0
    assert "Usage: slewright " + command in capsys.readouterr().out


def test_the_command_and_the_package_have_one_version(capsys):
    assert entry.run(["--version"]) == 0
    assert capsys.readouterr().out.split() == ["slewright", metadata.version("slewright")]


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from slewright.__main__ import run; run(['verify', '--help']); "
        "print(sorted({'casadi', 'numpy', 'fmpy', 'pyarrow', 'plotly', 'scipy'} & set(sys.modules)))"
    )
    ended = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert ended.stdout.strip().splitlines()[-1] == "[]"


def test_every_room_is_installed():
    missing = [room for room in ROOMS if not (ROOT / room / "__init__.py").is_file()]
    assert missing == []


def test_an_interrupt_from_the_keyboard_ends_with_130(tmp_path):
    started = tmp_path / "started"
    code = (
        "import pathlib, sys, time, types\n"
        f"def main(check):\n    pathlib.Path({str(started)!r}).touch(); time.sleep(60)\n"
        "sys.modules['specs.generate'] = types.SimpleNamespace(main=main)\n"
        "from slewright.__main__ import main as run\n"
        "run(['generate'])\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stderr=subprocess.PIPE, text=True)
    while not started.exists() and process.poll() is None:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, printed = process.communicate(timeout=60)
    assert process.returncode == 130
    assert printed.strip() == "slewright: interrupted"


def test_a_target_that_does_not_exist_is_refused_with_the_valid_ones(capsys):
    assert entry.run(["build", "--target", "vax"]) == 2
    printed = capsys.readouterr().err
    assert "'vax'" in printed
    assert "aarch64-linux" in printed


def test_simulate_needs_a_finite_stop(slewright_here: Command, tmp_path: Path) -> None:
    done = slewright_here(
        "simulate", pack_system("nominal", 2, tmp_path), "--out", tmp_path / "r.parquet", "--stop", "inf"
    )
    assert done.returncode == 2
    assert "--stop must be a finite time" in done.stderr
    assert not (tmp_path / "r.parquet").exists()


@pytest.mark.parametrize(
    "words",
    [("evaluate", "x.onnx", "--sealed"), ("compare", "--sealed"), ("campaign", "x", "--open-test-set")],
)
def test_sealed_draws_are_opened_for_a_purpose(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert entry.run([*words, ""]) == 2
    assert "say what they are opened for" in capsys.readouterr().err
