"""The worked example of docs/tutorials/first-machine.md as it stands there, and its simulated operator."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from deployment.hil.rig import free_port
from deployment.hil.standalone_machine import (
    ACKNOWLEDGE_S,
    DRIVING,
    MODES,
    PRESS_S,
    ByHand,
    Lines,
    MachineOnBus,
    Operator,
)
from specs.errors import InputError
from specs.scenario import TICK_S
from tests.conftest import ROOT

SECTION = (
    (ROOT / "docs/tutorials/first-machine.md")
    .read_text()
    .partition("## A first drive\n")[2]
    .partition("\n## ")[0]
)
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", SECTION, re.DOTALL)
PORT_SAID = "1502"
STEP_S, PATIENCE_S = 0.05, 120.0


class Shell:
    """Runs what the page says, in one folder; ends what it started."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, str(free_port())
        self.started: list[subprocess.Popen[bytes]] = []

    def text(self, number: int) -> str:
        """A block of the page, on a port that is free."""
        return BLOCKS[number][1].replace(PORT_SAID, self.port)

    def run(self, number: int) -> str:
        """A block that ends by itself: what it said."""
        done = subprocess.run(
            self._command(number),
            cwd=self.folder,
            env=self._env(),
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def start(self, number: int, said: str) -> Path:
        """A block that goes on, in a terminal of its own: what it writes, once it has said that."""
        log = self.folder / f"log-{number}"
        with log.open("wb") as out:
            self.started.append(
                subprocess.Popen(
                    self._command(number),
                    cwd=self.folder,
                    env=self._env(),
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
            )
        self.until(log, said)
        return log

    def until(self, log: Path, said: str, after: int = 0) -> None:
        """Wait until it has written that."""
        end = time.monotonic() + PATIENCE_S
        while said not in log.read_text()[after:]:
            assert time.monotonic() < end, log.read_text()
            assert all(p.poll() is None for p in self.started), log.read_text()
            time.sleep(STEP_S)

    def close(self) -> None:
        """End every terminal, the last first."""
        for process in reversed(self.started):
            os.killpg(process.pid, signal.SIGTERM)  # as Ctrl-C, which jobs of a script ignore
            process.wait(PATIENCE_S)

    def _command(self, number: int) -> list[str]:
        return ["bash", "-eu", "-c", self.text(number)]

    def _env(self) -> dict[str, str]:
        tools = self.folder / "tools"  # the commands of the page, run by this Python from this folder
        if not tools.exists():
            tools.mkdir()
            for name, what in (("slewright", "-m slewright"), ("python", "")):
                (tools / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {what} "$@"\n')
                (tools / name).chmod(0o755)
        return {
            **os.environ,
            "PATH": f"{tools}:{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "COLUMNS": "200",
        }


@pytest.fixture
def shell(tmp_path: Path) -> Iterator[Shell]:
    found = Shell(tmp_path)
    yield found
    found.close()


def test_the_page_has_the_blocks_in_their_order() -> None:
    assert [kind for kind, _ in BLOCKS] == ["sh", "sh", "sh", "python", "sh", "sh"]
    assert [text.split()[0] for _, text in BLOCKS] == [
        "slewright",
        "slewright",
        "slewright",
        "import",
        "python",
        "write()",
    ]


ATTEMPTS = 4  # on a busy computer a heartbeat may come too late, which is a fault, as it should be


def driven(shell: Shell, machine: Path, number: int, done: str) -> str:
    """What a block said, once it drove to its end."""
    said = ""
    for _ in range(ATTEMPTS):
        seen = len(machine.read_text())
        said = shell.run(number)
        if re.search(done, said, re.MULTILINE):
            return said
        shell.until(machine, "armed", seen)
    raise AssertionError(said + machine.read_text())


@pytest.mark.long
def test_a_first_drive_as_the_page_says(shell: Shell) -> None:
    shell.run(0)
    machine = shell.start(1, "no controller")
    shell.start(2, "run: armed")
    (shell.folder / "drive.py").write_text(shell.text(3))
    seen = len(machine.read_text())
    lines = driven(shell, machine, 4, r"^mode 3, fault 0.*\n\Z").splitlines()
    assert lines[0].startswith(("mode 6, fault 0", "mode 3, fault 0"))
    assert float(lines[-1].split()[-2]) > 0.2, "it did not turn towards the target"
    shell.until(machine, "fault, target_timeout", seen)
    if shutil.which("mbpoll") is None:
        pytest.skip("no mbpoll: install mbpoll")
    shell.until(machine, "armed", machine.read_text().rindex("fault"))
    driven(shell, machine, 5, r"^\[85\]:\s+3\b")


def modes(operator: Operator, *steps: tuple[str, float]) -> list[tuple[float, float]]:
    """Its two switches in every tick while the controller says those modes for so many seconds."""
    found = []
    for mode, seconds in steps:
        for _ in range(round(seconds / TICK_S)):
            at = operator.switches(MODES[mode])
            found.append((at["operator_enable"], at["automatic_request"]))
    return found


def test_the_operator_presses_anew_what_the_controller_waits_for() -> None:
    assert set(modes(Operator(), ("off", 5.0))) == {(0.0, 0.0)}
    standby = modes(Operator(), ("off", 0.1), ("standby", 2 * PRESS_S + 0.1))[5:]
    half = round(PRESS_S / TICK_S)
    assert standby[0] == standby[half - 1] == standby[-1] == (0.0, 0.0)
    assert standby[half] == standby[2 * half - 1] == (1.0, 0.0)
    armed = modes(Operator(), ("armed", 4 * PRESS_S))
    assert {enable for enable, _ in armed} == {1.0}
    assert [request for _, request in armed] == ([0.0] * half + [1.0] * half) * 2
    for mode in DRIVING:
        name = next(n for n, number in MODES.items() if number == mode)
        assert set(modes(Operator(), (name, 1.0))) == {(1.0, 1.0)}
    assert set(modes(Operator(), ("manual", 1.0))) == {(1.0, 0.0)}
    fault = modes(Operator(), ("automatic", 0.1), ("fault", ACKNOWLEDGE_S + PRESS_S))[5:]
    assert [enable for enable, _ in fault].index(1.0) == round(ACKNOWLEDGE_S / TICK_S)


def test_lines_set_signals_until_they_are_taken_back() -> None:
    by_hand = ByHand()
    assert by_hand.take(" joystick_slew 0.4 ").startswith("joystick_slew 0.4 until")
    assert by_hand.values == {"joystick_slew": 0.4}
    for line, said in (
        ("joystik_slew 1", "did you mean joystick_slew"),
        ("u_slew 1", "no signal 'u_slew' that the machine or its operator sends"),
        ("emergency_stop on", "'on' is no number"),
        ("emergency_stop nan", "nan is no number that a frame could carry"),
    ):
        assert said in by_hand.take(line)
    assert by_hand.values == {"joystick_slew": 0.4}
    assert by_hand.take("joystick_slew") == "joystick_slew by itself again"
    assert by_hand.values == {}


def test_lines_come_whole_and_their_end_is_no_line() -> None:
    read, write = os.pipe()
    lines = Lines(read)
    assert lines.come() == []
    os.write(write, b"emergency_stop 1\n\njoystick")
    assert lines.come() == ["emergency_stop 1"]
    os.write(write, b"_slew 0.5\n")
    assert lines.come() == ["joystick_slew 0.5"]
    os.close(write)
    assert (lines.come(), lines.come()) == ([], [])
    os.close(read)


def test_a_bus_is_made_joined_or_refused(tmp_path: Path) -> None:
    path = tmp_path / "bus"
    with MachineOnBus("slewright", str(path)):
        with MachineOnBus("slewright", str(path)) as second:
            assert second.bus is not None
        assert path.is_socket(), "who joined it does not end it"
    assert not path.exists()
    path.write_text("precious")
    with pytest.raises(InputError, match="is there already, and no local bus"):
        MachineOnBus("slewright", str(path))
    assert path.read_text() == "precious"
    with pytest.raises(InputError, match="unknown CAN interface 'sockets'"):
        MachineOnBus("sockets", "can0")
