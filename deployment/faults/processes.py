"""Processes that are killed, at random moments, while the controller drives the machine in real time."""

import os
import signal
import zlib
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from deployment.faults.attacks import Attack, attacker
from deployment.faults.drive import AUTOMATIC
from deployment.faults.episodes import Result, episodes
from deployment.faults.plant import ARMED, PATIENCE_TICKS, Plant
from deployment.faults.table import Fault, Outcome
from runtime.bundle import Bundle
from runtime.image import Flag
from runtime.supervisor import Supervisor
from specs.errors import RunError
from specs.progress import Report

ATTACK_TICKS = 40  # longer than a heartbeat may stand still
SEEN_TICKS = 100
HELPERS = {"recorder_killed": ("recorder", Flag.RECORDER_LOST), "modbus_killed": ("modbus", Flag.MODBUS_LOST)}


def run_all(
    bundle: Bundle,
    wanted: Sequence[Fault],
    count: int,
    seed: int,
    report: Report,
    more: Mapping[str, Callable[..., None]],
) -> list[Outcome]:
    """Each of the `wanted` faults `count` times; `more` injects those that are not here.

    One that ends early, since the machine did not go on, is not passed.
    """
    makers: dict[str, Callable[..., None]] = {
        **more,
        "control_killed": _control_killed,
        "modbus_flooding": _flooded,
        "modbus_client_gone": _client_gone,
        "modbus_reading_flood": _attacked,
        "modbus_second_writer": _attacked,
        "modbus_idle_connections": _attacked,
    }
    outcomes = []
    for fault in wanted:
        random = np.random.default_rng([seed, zlib.crc32(fault.name.encode())])
        outcome = Outcome(fault)
        with Plant(bundle, seed, canopen=fault.name.startswith("canopen_")) as plant:
            try:
                makers.get(fault.name, _helper_killed)(plant, outcome, count, random, report)
            except RunError as error:
                # what came before it counts, and the other faults are injected all the same
                outcome.missed.append(f"ended after {outcome.injected} of {count} injections: {error}")
        outcomes.append(outcome)
    return outcomes


def attacked(
    plant: Plant, attack: Attack, random: np.random.Generator, look: Callable[[], str] = lambda: ""
) -> Result:
    """An attack at a random moment: the mode stays, and what `look` sees in every period is well ("")."""
    mode, wrong = plant.shown("control_mode"), list[str]()
    plant.drive(int(random.integers(5, 20)), lambda: False)

    def seen() -> bool:
        left = "" if plant.shown("control_mode") == mode else f"the mode changed: {plant.fault}"
        wrong.extend(filter(None, (left, look())))
        return False

    attack.begin()
    plant.drive(ATTACK_TICKS, seen)
    over = plant.drive(PATIENCE_TICKS, lambda: seen() or attack.over)
    return 0.0, next(iter(wrong), attack.said if over else "the attack did not end")


def _control_killed(
    plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report
) -> None:
    path = plant.configuration()

    def kill() -> Result:
        with Supervisor(path) as supervisor:
            plant.go()
            plant.drive(int(random.integers(5, 60)), lambda: False)
            pid = supervisor.control.pid
            return plant.reaction(
                lambda: os.kill(pid, signal.SIGKILL), 50, lambda: not plant.node.valves.follows
            ), ""

    episodes(plant, outcome, count, report, kill)


def _client_gone(
    plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report
) -> None:
    """A client in a process of its own drives the machine, and is killed."""
    with Supervisor(plant.configuration("modbus")) as supervisor:

        def kill() -> Result:
            with plant.planned(_port(supervisor)) as client:
                plant.acknowledge()
                plant.go_automatic()
                plant.drive(int(random.integers(5, 60)), lambda: False)
                return plant.stop(client.kill, outcome.fault.codes)

        episodes(plant, outcome, count, report, kill)
    plant.replayed(outcome)


def _attacked(
    plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report
) -> None:
    """A planner drives the machine by Modbus while other clients attack (attacks.py): it goes on."""
    with Supervisor(plant.configuration("modbus")) as supervisor:
        port = _port(supervisor)
        with plant.planned(port), attacker(port, outcome.fault.name) as attack:

            def one() -> Result:
                plant.ready()
                return attacked(plant, attack, random)

            episodes(plant, outcome, count, report, one)
    plant.replayed(outcome)


def _flooded(plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report) -> None:
    """A burst of many clients at once, while the machine is armed."""
    with (
        Supervisor(plant.configuration("modbus")) as supervisor,
        attacker(_port(supervisor), outcome.fault.name) as attack,
    ):

        def one() -> Result:
            if plant.shown("control_mode") != ARMED:
                plant.acknowledge()
                plant.go(ARMED)
            before = supervisor.now().overruns
            return attacked(plant, attack, random, lambda: "overruns" * (supervisor.now().overruns > before))

        episodes(plant, outcome, count, report, one)
    plant.replayed(outcome)


def _helper_killed(
    plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report
) -> None:
    name, flag = HELPERS[outcome.fault.name]
    with Supervisor(plant.configuration(name)) as supervisor:
        helper = next(h for h in supervisor.helpers if h.name == name)
        plant.go(ARMED if name == "modbus" else AUTOMATIC)

        def flagged() -> bool:
            return bool(int(plant.shown("runtime_flags")) & flag)

        def well() -> bool:
            """It is watched as `slewright run` does, who waits before the next start."""
            supervisor.watch()
            return not flagged()

        def kill() -> Result:
            plant.drive(int(random.integers(5, 60)), lambda: False)
            before, pid = supervisor.now().overruns, helper.pid
            ms = plant.reaction(lambda: os.kill(pid, signal.SIGKILL), SEEN_TICKS, flagged)
            back = plant.drive(PATIENCE_TICKS, well)
            if supervisor.watch() is not None or supervisor.now().overruns > before:
                return ms, "the control process was touched"
            return ms, "" if back else "it did not come back"

        episodes(plant, outcome, count, report, kill)


def _port(supervisor: Supervisor) -> int:
    return supervisor.wanted.modbus.port if supervisor.wanted.modbus else 0
