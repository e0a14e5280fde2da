"""Somebody at a terminal commissions a machine on a bus: real time, real frames, answers that are typed."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from deployment.commissioning.operator import BEGIN, Answering, Kind, Person, Question
from deployment.commissioning.procedure import NAMES, find, perform
from deployment.commissioning.rig import Rig
from deployment.commissioning.session import Session
from deployment.commissioning.simulated import SimulatedMachine, SimulatedOperator
from deployment.hil.rig import BUS_PRIORITY, MACHINE_PRIORITY, prefer
from runtime.can.busd import start_bus
from runtime.policy import open_core
from runtime.shared import private_folder
from specs.errors import RunError
from tests.conftest import ROOT
from tests.runtime.bundles import built
from tests.terminal import CTRL_C, Terminal

DONE = ("bus", "safety", "rest", "imus", "slew")  # a minute and a half; the next one is interrupted
ASKED = r"  > (.+) \[(?:Enter when done|yes or no|[^\]\n]*)\] $"


def test_lines_that_are_typed_at_once_are_two_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = os.pipe()
    with os.fdopen(ours) as typed:
        monkeypatch.setattr("sys.stdin", typed)
        person = Person("Ada")
        os.write(theirs, b"maybe\nyes\n12.")
        assert answered(person, Kind.WITNESS) == "yes"
        asking = person.answer(Question(Kind.NUMBER, "measure.boom", "Angle?", "°"))
        next(asking)  # the cycle goes on
        os.write(theirs, b"5\n")
        with pytest.raises(StopIteration, match=r"12\.5"):
            next(asking)
        os.close(theirs)
        with pytest.raises(RunError, match="the terminal is closed"):
            answered(person, Kind.DO)


def test_who_says_yes_beforehand_is_still_asked_what_was_done(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = os.pipe()
    os.close(theirs)
    with os.fdopen(ours) as closed:
        monkeypatch.setattr("sys.stdin", closed)
        person = Person("Ada", ready=True)
        assert answered(person, Kind.DO, BEGIN) == ""
        with pytest.raises(RunError, match="the terminal is closed"):
            answered(person, Kind.DO, "switch.stop.1")


def answered(person: Person, kind: Kind, key: str = "see.slew.+1") -> str:
    asking = person.answer(Question(kind, key, "The carriage moved left"))
    while True:
        try:
            next(asking)
        except StopIteration as end:
            return end.value


class Learns(SimulatedOperator):
    """Knows afterwards what the questions are about, by their text."""

    def __init__(self, machine: SimulatedMachine) -> None:
        super().__init__(machine)
        self.keys: dict[str, str] = {}

    def answer(self, question: Question) -> Answering:
        """As he does."""
        self.keys[question.text] = question.key
        return super().answer(question)


def rehearsed(folder: Path) -> dict[str, str]:
    """What each question is about, from a rehearsal in lock-step."""
    session = Session.open(folder, NAMES, {"machine": "", "bundle": "", "who": ""}, False)
    with SimulatedMachine() as machine:
        operator = Learns(machine)
        rig = Rig(open_core(built("pi")), machine, machine, simulated=True)
        for name in DONE:
            assert perform(find(name), rig, operator, session).verdict == "passed"
    return operator.keys


@contextmanager
def machine_on(channel: Path) -> Iterator["subprocess.Popen[str]"]:
    """The simulated machine and its operator, in real time in a process of their own."""
    line = [sys.executable, "-m", "tests.deployment.commissioning.machine_on_bus", str(channel)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    process = subprocess.Popen(line, cwd=ROOT, **pipes)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        prefer(process.pid, MACHINE_PRIORITY)
        yield process
    finally:
        process.kill()
        process.wait()


def done(machine: "subprocess.Popen[str]", key: str) -> str:
    """Have it done at the machine; the answer."""
    assert machine.stdin is not None
    assert machine.stdout is not None
    machine.stdin.write(f"{key}\n")
    machine.stdin.flush()
    return machine.stdout.readline().strip().removeprefix("did").strip()


@pytest.mark.slow
@pytest.mark.soak
def test_a_machine_on_a_bus_is_commissioned_at_a_terminal(tmp_path: Path) -> None:
    keys, sockets = rehearsed(tmp_path / "rehearsal"), private_folder("slewright-test-")
    bus = start_bus(sockets / "bus")
    prefer(bus.pid, BUS_PRIORITY)
    config, records = tmp_path / "machine.toml", tmp_path / "records"
    config.write_text(
        f'bundle = "{built("pi").folder}"\n[can]\ninterface = "slewright"\nchannel = "{sockets / "bus"}"\n'
    )
    told = ("commission", "--config", config, "--out", records, "--who", "Ada")
    try:
        with machine_on(sockets / "bus") as machine, Terminal(*told) as terminal:
            while find_next(terminal, keys, machine, records):
                pass
            terminal.type(CTRL_C)
            assert terminal.ends() == 130
    finally:
        bus.terminate()
        bus.wait()
    for number, name in enumerate(DONE, 1):
        record = json.loads((records / f"{number:02}-{name}.json").read_text())
        assert record["verdict"] == "passed", [c for c in record["checks"] if not c["passed"]]
    record = json.loads((records / f"{len(DONE) + 1:02}-boom.json").read_text())
    assert record["verdict"] == "interrupted"


def find_next(
    terminal: Terminal, keys: dict[str, str], machine: "subprocess.Popen[str]", records: Path
) -> bool:
    """Answer the next question; False if it is one of the step after the last."""
    text = terminal.until(ASKED)[1]
    if (records / f"{len(DONE):02}-{DONE[-1]}.json").is_file():
        return False
    terminal.type(done(machine, keys[text]) + "\n")
    return True
