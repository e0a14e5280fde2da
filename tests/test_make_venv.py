"""The set-up of the environment, on machines that this one is not: stand-ins play Python, apt-get and id."""

import os
import subprocess
from pathlib import Path

import pytest

from tests.conftest import ROOT

# Answers as a Python of the given version would; without ensurepip until apt-get has been called.
PYTHON = """#!/bin/sh
case "$*" in
    --version) echo "Python {version}" ;;
    *version_info\\ *) exit {too_old} ;;
    *ensurepip*) test {has_ensurepip} = yes || test -e "$LOG" ;;
    *version_info*) echo {version} ;;
    *) echo "python $*" >> "$LOG.venv" ;;
esac
"""


class Machine:
    """A folder of stand-ins that is the whole PATH."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.log = folder / "log"
        self.variables: dict[str, str] = {}

    def put(self, name: str, text: str) -> None:
        path = self.folder / name
        path.write_text(text)
        path.chmod(0o755)

    def python(self, name: str, version: str, has_ensurepip: str = "yes") -> None:
        too_old = int(tuple(map(int, version.split("."))) < (3, 11))
        self.put(name, PYTHON.format(version=version, too_old=too_old, has_ensurepip=has_ensurepip))

    def user(self, number: int) -> None:
        self.put("id", f"#!/bin/sh\necho {number}\n")

    def run(self) -> subprocess.CompletedProcess[str]:
        env = {"PATH": str(self.folder), "LOG": str(self.log), **self.variables}
        command = ["/bin/sh", str(ROOT / "requirements" / "make-venv"), ".venv"]
        return subprocess.run(command, cwd=self.folder, env=env, capture_output=True, text=True, check=False)

    @property
    def made(self) -> str:
        path = Path(f"{self.log}.venv")
        return path.read_text().strip() if path.exists() else ""


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    if os.name != "posix":
        pytest.skip("needs a POSIX shell")
    return Machine(tmp_path)


def test_the_plain_python_is_taken_when_it_is_new_enough(machine):
    machine.python("python3", "3.12")
    assert machine.run().returncode == 0
    assert machine.made == "python -m venv --clear .venv"


def test_a_newer_python_is_found_beside_an_old_one(machine):
    machine.python("python3", "3.9")
    machine.python("python3.12", "3.12")
    assert machine.run().returncode == 0
    assert machine.made


def test_without_a_new_enough_python_it_says_which_is_needed(machine):
    machine.python("python3", "3.9")
    ended = machine.run()
    assert ended.returncode == 2
    assert "Python 3.11 or newer; found Python 3.9" in ended.stderr
    assert "PYTHON=" in ended.stderr
    assert not machine.made


def test_a_named_python_that_is_too_old_is_refused(machine):
    machine.python("python3", "3.12")
    machine.python("old", "3.8")
    machine.variables["PYTHON"] = "old"
    ended = machine.run()
    assert ended.returncode == 2
    assert "PYTHON=old" in ended.stderr


def test_root_gets_the_missing_package_installed(machine):
    machine.python("python3", "3.11", has_ensurepip="no")
    machine.user(0)
    machine.put("apt-get", '#!/bin/sh\necho "$@" >> "$LOG"\n')
    assert machine.run().returncode == 0
    assert "install -y -qq python3.11-venv" in machine.log.read_text()
    assert machine.made


def test_others_are_told_in_one_line(machine):
    machine.python("python3", "3.11", has_ensurepip="no")
    machine.user(1000)
    ended = machine.run()
    assert ended.returncode == 2
    assert len(ended.stderr.strip().splitlines()) == 1
    assert "sudo apt-get install python3.11-venv" in ended.stderr
    assert not machine.made
