"""What all tests share: where the project is, how the command is run, what is skipped where it is missing."""

import ctypes
import gc
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Generator
from pathlib import Path

# Before anything imports numpy: the test processes share the cores already.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

# What is compiled once is kept: else each process that a test starts compiles anew all that it imports.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# In the background a shell has us ignore Ctrl-C, and so would all that the tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parent.parent
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
MASTERS = ("ecospy", "libcosimpy", "fmu_manipulation_toolbox")

# The same examples everywhere, and no test that fails because a machine is slow.
settings.register_profile("slewright", deadline=None, derandomize=True, database=None)
settings.load_profile("slewright")


def browser_path() -> str | None:
    """The headless browser of this machine, if it has one."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def _loads(library: str) -> bool:
    """Whether a shared library is there."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Thousands of tests are collected, and all of them kept: to look for garbage in that takes seconds."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip, and say why, what needs something that this machine does not have."""
    if item.get_closest_marker("browser") and browser_path() is None:
        pytest.skip("no headless browser: install chromium")
    if item.get_closest_marker("qemu") and shutil.which("qemu-aarch64") is None:
        pytest.skip("no qemu-aarch64: install qemu-user")
    if item.get_closest_marker("interop"):
        missing = [name for name in MASTERS if importlib.util.find_spec(name) is None]
        if missing:
            pytest.skip(f"not installed: {', '.join(missing)}")
        if "ecos" in item.name and not _loads("libtbb.so.12"):
            pytest.skip("no libtbb.so.12, which ecospy needs: install libtbb12")


@pytest.fixture(scope="session")
def root() -> Path:
    """The project's root folder."""
    return ROOT


@pytest.fixture(scope="session")
def browser() -> str:
    """Path of the headless browser (tests with the marker `browser`)."""
    path = browser_path()
    if path is None:
        pytest.skip("no headless browser: install chromium")
    return path


Command = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def slewright() -> Command:
    """Run the command in a process of its own: slewright("verify", "--seed", "2") -> CompletedProcess."""

    def run(
        *arguments: str | Path, cwd: Path = ROOT, env: dict[str, str] | None = None, timeout: float = 240.0
    ) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "slewright", *map(str, arguments)]
        plain = {"PYTHONPATH": str(ROOT), "NO_COLOR": "1", "COLUMNS": "200"}
        environment = {**os.environ, **plain, **(env or {})}
        return subprocess.run(
            command, cwd=cwd, env=environment, capture_output=True, text=True, check=False, timeout=timeout
        )

    return run


@pytest.fixture
def slewright_here(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Command:
    """As `slewright`, within this process: quick, for what is refused before anything runs."""
    from slewright.__main__ import run as command

    def run(*arguments: str | Path, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
        monkeypatch.chdir(cwd)
        monkeypatch.setenv("COLUMNS", "200")
        monkeypatch.delenv("SLEWRIGHT_TRACEBACK", raising=False)
        capsys.readouterr()
        told = [*map(str, arguments)]
        code = command(told)
        said = capsys.readouterr()
        return subprocess.CompletedProcess(told, code, said.out, said.err)

    return run
