"""The interfaces attacked, and their processes killed, while a planner drives the machine over Modbus."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from deployment.faults.drive import AUTOMATIC
from deployment.faults.episodes import Result, episodes
from deployment.faults.outsiders import ASKED, ATTACKS, outsider
from deployment.faults.plant import PATIENCE_TICKS, Plant
from deployment.faults.processes import attacked
from deployment.faults.table import Outcome
from deployment.hil.rig import Interfaces, free_domain, free_port
from runtime.interfaces.view import View
from runtime.supervisor import Supervisor
from specs.progress import Report

KILLED = {"foxglove_killed": "foxglove", "opcua_killed": "opcua", "ros2_killed": "ros2"}
NAMES = (*ATTACKS, *KILLED)


def run(plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report) -> None:
    """One kind of these faults, `count` times."""
    inject = _killed if outcome.fault.name in KILLED else _attacked
    with _driving(plant) as (supervisor, at):
        inject(plant, supervisor, at, outcome, count, random, report)
    plant.replayed(outcome)


@contextmanager
def _driving(plant: Plant) -> Iterator[tuple[Supervisor, Interfaces]]:
    at = Interfaces(free_port(), free_port(), free_domain())
    path = plant.configuration("modbus")
    more = f"[foxglove]\nport = {at.foxglove}\n[opcua]\nport = {at.opcua}\n"
    path.write_text(path.read_text() + more + f"[ros2]\ndomain = {at.domain}\ncommands = true\n")
    with Supervisor(path) as supervisor:
        modbus = supervisor.wanted.modbus
        with plant.planned(modbus.port if modbus else 0):
            yield supervisor, at


def _attacked(
    plant: Plant,
    supervisor: Supervisor,
    at: Interfaces,
    outcome: Outcome,
    count: int,
    random: np.random.Generator,
    report: Report,
) -> None:
    """Automatic goes on, nothing that the attacker asked for counts, another client is answered."""
    view = View.join(supervisor.folder)

    def look() -> str:
        seen = view.new()
        return "the attacker's target counted" * (seen is not None and seen.of("target_x") == ASKED)

    with outsider(at, outcome.fault.name) as attack:

        def one() -> Result:
            plant.ready()
            return attacked(plant, attack, random, look)

        episodes(plant, outcome, count, report, one)


def _killed(
    plant: Plant,
    supervisor: Supervisor,
    at: Interfaces,
    outcome: Outcome,
    count: int,
    random: np.random.Generator,
    report: Report,
) -> None:
    """It is started again; the cycle and the planner go on."""
    helper = next(h for h in supervisor.helpers if h.name == KILLED[outcome.fault.name])

    def kill() -> Result:
        plant.ready()
        plant.drive(int(random.integers(5, 60)), lambda: False)
        pid = helper.pid
        ms = plant.reaction(
            lambda: os.kill(pid, signal.SIGKILL),
            PATIENCE_TICKS,
            lambda: supervisor.watch() is None and helper.pid != pid,
        )
        on = plant.shown("control_mode") == AUTOMATIC
        return ms, "" if on else f"automatic ended: {plant.fault}"

    episodes(plant, outcome, count, report, kill)
