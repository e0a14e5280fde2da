"""docs/how-to/canopen.md as it stands there: machine, controller and another program, each by its command."""

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from specs.canopen import definition
from tests.conftest import ROOT
from tests.runtime.bundles import built

pytest.importorskip("canopen")
pytestmark = pytest.mark.slow
PAGE = (ROOT / "docs/how-to/canopen.md").read_text()
BLOCKS = dict(re.findall(r"```(toml|python)\n(.*?)```", PAGE, re.DOTALL))
PATIENCE_S = 120.0


class Started:
    """Commands in one folder, ended with the test."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._running: list[subprocess.Popen[bytes]] = []

    def command(self, *words: str) -> Path:
        """Start `slewright …`; the file with what it says."""
        said = self.folder / f"{words[0]}.log"
        with said.open("w") as file:
            command = [sys.executable, "-m", "slewright", *words]
            self._running.append(
                subprocess.Popen(command, cwd=self.folder, stdout=file, stderr=file, stdin=subprocess.DEVNULL)
            )
        return said

    def until(self, said: Path, text: str) -> None:
        """Wait until it says something."""
        end = time.monotonic() + PATIENCE_S
        while text not in said.read_text():
            assert time.monotonic() < end, said.read_text()
            time.sleep(0.1)

    def end(self) -> None:
        """End all, the last first."""
        for process in reversed(self._running):
            process.terminate()
            process.wait(60)


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Started]:
    found = Started(tmp_path)
    yield found
    found.end()


@pytest.mark.long
def test_the_page_works_as_it_stands(started: Started, tmp_path: Path):
    (tmp_path / "pd.bundle").symlink_to(built("pd").folder)
    (tmp_path / "machine.toml").write_text(BLOCKS["toml"] + "\n[realtime]\nfifo = false\nlock = false\n")
    machine = started.command("machine", "--channel", "bus", "--canopen", "devices")
    started.until(machine, "its CANopen devices on slewright devices")
    controller = started.command("run", "--config", "machine.toml")
    for node in definition().nodes:
        started.until(controller, f"{node.name} is set up and operational")
    started.until(machine, "controller in armed")
    files = started.command("canopen", "dcf", "--bundle", "pd.bundle", "--out", "files")
    started.until(files, "valve_stick.dcf")
    done = subprocess.run(
        [sys.executable, "-c", BLOCKS["python"]],
        cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    counts = [int(line) for line in done.stdout.split()]
    assert len(counts) == 50
    assert max(abs(c - 2147483648) for c in counts) < 262144  # within a turn of where it began
