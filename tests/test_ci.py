"""The continuous integration script on other machines: stand-ins play the system's commands."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.conftest import ROOT

MAKE = ["make test", "make check", "make docs", "make long"]


@pytest.fixture
def run(tmp_path: Path):
    """Run a copy of .ci/run where only `commands` (name -> shell text) exist: (result, calls)."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("needs bash")
    (tmp_path / ".ci").mkdir()
    shutil.copy(ROOT / ".ci" / "run", tmp_path / ".ci" / "run")

    def start(**commands: str) -> tuple[subprocess.CompletedProcess[str], list[str]]:
        log = tmp_path / "log"
        for name, text in {"make": "exit 0", **commands}.items():
            path = tmp_path / name.replace("_", "-")
            path.write_text(f'#!{bash}\necho "{path.name} $*" >> {log}\n{text}\n')
            path.chmod(0o755)
        ended = subprocess.run(
            [bash, tmp_path / ".ci" / "run"],
            env={"PATH": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
        )
        return ended, log.read_text().splitlines()

    return start


def test_it_runs_tests_then_checks(run):
    ended, calls = run(dpkg="exit 0", id="echo 0", apt_get="exit 0")
    assert ended.returncode == 0
    assert [call for call in calls if not call.startswith("dpkg")] == MAKE


def test_it_installs_what_is_missing_as_root(run):
    ended, calls = run(dpkg="[ $2 != qemu-user ]", id="echo 0", apt_get="exit 0")
    assert ended.returncode == 0
    installed = [call.split()[-1] for call in calls if call.startswith("apt-get install")]
    assert installed == ["qemu-user"]


@pytest.mark.parametrize(
    "machine",
    [
        {"dpkg": "exit 1", "id": "echo 0", "apt_get": "exit 100"},
        {"dpkg": "exit 1", "id": "echo 1000", "apt_get": "exit 100"},
        {"id": "echo 0"},
    ],
    ids=["apt-get fails", "not root", "not Debian"],
)
def test_without_packages_it_runs_all_the_same(run, machine):
    ended, calls = run(**machine)
    assert ended.returncode == 0
    assert calls[-len(MAKE) :] == MAKE


def test_a_failed_test_run_fails_it(run):
    ended, calls = run(make="exit 2")
    assert ended.returncode != 0
    assert not {*MAKE[1:]} & {*calls}
