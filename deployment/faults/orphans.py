"""A run whose supervisor is killed at any moment of its start or later: none of its processes goes on."""

import subprocess
import sys
from pathlib import Path

import numpy as np

from deployment.faults.episodes import Result, episodes
from deployment.faults.plant import Plant
from deployment.faults.table import TICK_MS, Outcome
from specs.progress import Report

LATEST_TICKS = 200  # of the kill: by then all processes run
RUN = (
    "import sys, time; from pathlib import Path; from runtime.supervisor import Supervisor\n"
    "with Supervisor(Path(sys.argv[1])):\n    time.sleep(600)"
)


def run(plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report) -> None:
    """Kill the supervisor of `count` runs."""
    path = plant.configuration("modbus")

    def kill() -> Result:
        process = subprocess.Popen(
            [sys.executable, "-c", RUN, str(path)], start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            plant.drive(int(random.integers(1, LATEST_TICKS)), lambda: False)
            ticks = round(outcome.fault.limit_ms / TICK_MS)
            return plant.reaction(process.kill, ticks, lambda: not of_session(process.pid)), ""
        finally:
            process.kill()
            process.wait()

    episodes(plant, outcome, count, report, kill)


def of_session(number: int) -> list[int]:
    """Processes of a session that run; those that ended and wait for their parent do not."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, *fields = stat.read_text().rpartition(")")[2].split()
        except (OSError, ValueError):  # it ended meanwhile
            continue
        if state != "Z" and int(fields[2]) == number:
            found.append(int(stat.parent.name))
    return found
