"""A policy outside that is lost, late or wrong, or attacked, while it drives the machine in real time.

Its bundle is one of its own (`slewright bundle outside`): the plant's is that of the controller under test.
"""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from deployment.bundling.build import bundle
from deployment.faults.attacks import attacker
from deployment.faults.drive import AUTOMATIC
from deployment.faults.outside_table import NAMES
from deployment.faults.policies import ASKED, ROLE
from deployment.faults.processes import ATTACK_TICKS, PATIENCE_TICKS, SCENARIO, Plant
from deployment.faults.table import Outcome
from deployment.hil.loads import planning
from runtime.helpers import ROOT
from runtime.interfaces.told import Listener
from runtime.interfaces.view import View
from runtime.supervisor import Supervisor
from specs.errors import RunError
from specs.progress import Report
from specs.signals import definition

DOMAIN = 79  # of ROS 2, for these faults
STOP_TICKS = 100
KILLED = "policy_silent"
ILL = (KILLED, "policy_stale", "policy_hangs", "policy_wrong_message")


class Commander:
    """The node that commands, in a process of its own; a context."""

    def __init__(self, name: str) -> None:
        self._command = [sys.executable, "-m", "deployment.faults.policies", str(DOMAIN), name]
        self.process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Start it, unless it runs."""
        if self.process and self.process.poll() is None:
            return
        self.process = subprocess.Popen(
            self._command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        if not self.process.stdout or self.process.stdout.readline() != "ready\n":
            raise RunError("the policy's node did not start")

    def turn(self) -> None:
        """Make it ill, or well again."""
        if self.process and self.process.stdin:
            self.process.stdin.write("\n")
            self.process.stdin.flush()

    def kill(self) -> None:
        """At once."""
        if self.process:
            self.process.kill()
            self.process.wait()

    def __enter__(self) -> "Commander":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()


class Driven:
    """A run that a policy outside drives; what the interface says, and what counts."""

    def __init__(self, plant: Plant, supervisor: Supervisor) -> None:
        self.plant = plant
        self._view, self._listener = View.join(supervisor.folder), Listener(supervisor.folder, "ros2")
        self._known = False
        self.asked = False  # an attacker's command counted

    def known(self) -> bool:
        """Whether the policy's commands are there; sees the newest images."""
        if seen := self._view.new():
            value = seen.of("policy_u_slew")
            self._known = not np.isnan(value)
            self.asked = self.asked or value == ASKED
        return self._known

    def go(self) -> None:
        """In automatic operation, commanded from outside."""
        if not (self.plant.shown("control_mode") == AUTOMATIC and self.known()):
            self.plant.wait(self.known)
            self.plant.acknowledge()
            self.plant.go_automatic()

    def said(self, text: str) -> bool:
        """Whether the interface told it since the last call."""
        return any(text in event["what"] for event in self._listener.new())


def run(plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report) -> None:
    """One kind of these faults, `count` times."""
    name = outcome.fault.name
    plant.bundle = bundle("outside", Path(plant.folder) / "outside")
    with _driving(plant) as driven, Commander(name) as commander:
        if name in ILL:
            _lost(driven, commander, outcome, count, random, report)
        else:
            _attacked(driven, outcome, count, random, report)
    plant.replayed(outcome)


INJECTIONS: dict[str, Callable[..., None]] = dict.fromkeys(NAMES, run)


@contextmanager
def _driving(plant: Plant) -> Iterator[Driven]:
    path = plant.configuration("modbus")
    path.write_text(path.read_text() + f'[ros2]\ndomain = {DOMAIN}\npolicy = "{ROLE}"\n')
    with Supervisor(path) as supervisor:
        modbus = supervisor.wanted.modbus
        with planning(modbus.port if modbus else 0, SCENARIO):
            yield Driven(plant, supervisor)


def _lost(
    driven: Driven,
    commander: Commander,
    outcome: Outcome,
    count: int,
    random: np.random.Generator,
    report: Report,
) -> None:
    """The machine stops, the fault has its name, and the interface says who lost the right."""
    plant, killed = driven.plant, outcome.fault.name == KILLED
    for number in range(count):
        report(outcome.fault.name, number, count)
        commander.start()
        driven.go()
        plant.drive(int(random.integers(5, 60)), lambda: False)
        driven.said("")
        (commander.kill if killed else commander.turn)()
        begun = time.monotonic()
        stopped = plant.drive(STOP_TICKS, plant.stopped)
        ms = 1000.0 * (time.monotonic() - begun)
        code = definition().signals["fault_code"].values[int(plant.shown("fault_code"))]
        why = "" if code in outcome.fault.codes or not stopped else f"fault code {code}"
        first = number == 0  # the same is not said again within a minute
        told = not first or plant.drive(PATIENCE_TICKS, lambda: driven.said("lost the right to command arm"))
        outcome.add(plant.tick, ms if stopped else None, why or ("" if told else "nobody was told"))
        commander.kill()


def _attacked(
    driven: Driven, outcome: Outcome, count: int, random: np.random.Generator, report: Report
) -> None:
    """Automatic goes on, and nothing that the attacker asked for counts."""
    plant, name = driven.plant, outcome.fault.name

    def ended() -> bool:
        driven.known()
        return plant.shown("control_mode") != AUTOMATIC

    with attacker(DOMAIN, name, "--other", module="deployment.faults.policies") as attack:
        for number in range(count):
            report(name, number, count)
            driven.go()
            plant.drive(int(random.integers(5, 20)), lambda: False)
            judged = attack()
            left = plant.drive(ATTACK_TICKS, ended)
            code = definition().signals["fault_code"].values[int(plant.shown("fault_code"))]
            why = judged() or ("the attacker's command counted" if driven.asked else "")
            outcome.add(plant.tick, 0.0, f"automatic ended: {code}" if left else why)
