"""A policy outside that is lost, late or wrong, or attacked, while it drives the machine in real time.

Its bundle is one of its own (`slewright bundle outside`): the plant's is that of the controller under test.
"""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from deployment.bundling.build import bundle
from deployment.faults.attacks import attacker
from deployment.faults.drive import AUTOMATIC
from deployment.faults.episodes import Result, episodes
from deployment.faults.outside_table import NAMES
from deployment.faults.plant import PATIENCE_TICKS, Plant
from deployment.faults.policies import ASKED, ROLE
from deployment.faults.processes import attacked
from deployment.faults.table import Outcome
from deployment.hil.rig import free_domain
from runtime.helpers import ROOT
from runtime.interfaces.told import Listener
from runtime.interfaces.view import View
from runtime.supervisor import Supervisor
from specs.errors import RunError
from specs.progress import Report

KILLED = "policy_silent"
ILL = (KILLED, "policy_stale", "policy_hangs", "policy_wrong_message")


@contextmanager
def commanding(domain: int, name: str) -> Iterator["subprocess.Popen[str]"]:
    """The node that commands, in a process of its own; a line makes it ill."""
    command = [sys.executable, "-m", "deployment.faults.policies", str(domain), name]
    process = subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    )
    try:
        if not process.stdout or process.stdout.readline() != "ready\n":
            raise RunError("the policy's node did not start")
        yield process
    finally:
        process.kill()
        process.wait()


class Driven:
    """A run that a policy outside drives; what the interface says, and what counts."""

    def __init__(self, plant: Plant, supervisor: Supervisor, domain: int) -> None:
        self.plant, self.domain = plant, domain
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
    with _driving(plant) as driven:
        (_lost if name in ILL else _attacked)(driven, outcome, count, random, report)
    plant.replayed(outcome)


INJECTIONS: dict[str, Callable[..., None]] = dict.fromkeys(NAMES, run)


@contextmanager
def _driving(plant: Plant) -> Iterator[Driven]:
    path, domain = plant.configuration("modbus"), free_domain()
    path.write_text(path.read_text() + f'[ros2]\ndomain = {domain}\npolicy = "{ROLE}"\n')
    with Supervisor(path) as supervisor:
        modbus = supervisor.wanted.modbus
        with plant.planned(modbus.port if modbus else 0):
            yield Driven(plant, supervisor, domain)


def _lost(
    driven: Driven,
    outcome: Outcome,
    count: int,
    random: np.random.Generator,
    report: Report,
) -> None:
    """The machine stops, the fault has its name, and the interface says who lost the right."""
    plant, told = driven.plant, False

    def fall_ill() -> Result:
        nonlocal told
        with commanding(driven.domain, outcome.fault.name) as node, plant.beside(node):
            driven.go()
            plant.drive(int(random.integers(5, 60)), lambda: False)
            driven.said("")
            ill = partial(print, file=node.stdin, flush=True)
            ms, why = plant.stop(node.kill if outcome.fault.name == KILLED else ill, outcome.fault.codes)
            # the same is not said again within a minute
            told = told or plant.drive(PATIENCE_TICKS, lambda: driven.said("lost the right to command arm"))
            return ms, why or ("" if told else "nobody was told")

    episodes(plant, outcome, count, report, fall_ill)


def _attacked(
    driven: Driven,
    outcome: Outcome,
    count: int,
    random: np.random.Generator,
    report: Report,
) -> None:
    """Automatic goes on, and nothing that the attacker asked for counts."""
    name = outcome.fault.name

    def look() -> str:
        driven.known()
        return "the attacker's command counted" * driven.asked

    with (
        commanding(driven.domain, name) as node,
        driven.plant.beside(node),
        attacker(driven.domain, name, "--other", module="deployment.faults.policies") as attack,
    ):

        def one() -> Result:
            driven.go()
            return attacked(driven.plant, attack, random, look)

        episodes(driven.plant, outcome, count, report, one)
