"""The interfaces attacked, and their processes killed, while a planner drives the machine over Modbus."""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from deployment.faults.drive import AUTOMATIC
from deployment.faults.outsiders import ASKED, ATTACKS, outsider
from deployment.faults.processes import ATTACK_TICKS, PATIENCE_TICKS, SCENARIO, Plant
from deployment.faults.table import Outcome
from deployment.hil.loads import planning
from deployment.hil.rig import Interfaces, free_port
from runtime.interfaces.view import View
from runtime.supervisor import Supervisor
from specs.progress import Report
from specs.signals import definition

DOMAIN = 78  # of ROS 2, for the faults
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
    at = Interfaces(free_port(), free_port(), DOMAIN)
    path = plant.configuration("modbus")
    more = f"[foxglove]\nport = {at.foxglove}\n[opcua]\nport = {at.opcua}\n"
    path.write_text(path.read_text() + more + f"[ros2]\ndomain = {at.domain}\ncommands = true\n")
    with Supervisor(path) as supervisor:
        modbus = supervisor.wanted.modbus
        with planning(modbus.port if modbus else 0, SCENARIO):
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
    asked = [False]

    def ended() -> bool:
        seen = view.new()
        asked[0] = asked[0] or (seen is not None and seen.of("target_x") == ASKED)
        return plant.shown("control_mode") != AUTOMATIC

    with outsider(at, outcome.fault.name) as attack:
        for number in range(count):
            report(outcome.fault.name, number, count)
            _ready(plant)
            plant.drive(int(random.integers(5, 20)), lambda: False)
            judged = attack()
            left = plant.drive(ATTACK_TICKS, ended)
            code = definition().signals["fault_code"].values[int(plant.shown("fault_code"))]
            why = judged() or ("the attacker's target counted" if asked[0] else "")
            outcome.add(plant.tick, 0.0, f"automatic ended: {code}" if left else why)


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
    for number in range(count):
        report(outcome.fault.name, number, count)
        _ready(plant)
        plant.drive(int(random.integers(5, 60)), lambda: False)
        before, killed = helper.pid, time.monotonic()
        os.kill(before, signal.SIGKILL)
        again = plant.drive(PATIENCE_TICKS, lambda b=before: supervisor.watch() is None and helper.pid != b)
        ms = 1000.0 * (time.monotonic() - killed)
        on = plant.shown("control_mode") == AUTOMATIC
        outcome.add(plant.tick, ms if again else None, "" if on else "automatic ended")


def _ready(plant: Plant) -> None:
    if plant.shown("control_mode") != AUTOMATIC:
        plant.acknowledge()
        plant.go_automatic()
