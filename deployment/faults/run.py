"""Runs the faults: a drive, random moments of it, `count` injections of each."""

import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from deployment.faults import (
    devices,
    injected,
    interfaces,
    lost_devices,
    orphans,
    outside,
    people,
    process_faults,
    watching,
)
from deployment.faults.canopen_table import CANOPEN
from deployment.faults.drive import Drive
from deployment.faults.fmu_table import FMU
from deployment.faults.foreign_fmus import run_fmus
from deployment.faults.outside_table import OUTSIDE
from deployment.faults.people_table import FILES, KILLED_STARTING
from deployment.faults.processes import run_all
from deployment.faults.table import BUS, IMAGE, INSIDE, PROCESS, Fault, Outcome
from runtime.bundle import load
from runtime.control import ControlCore
from specs.errors import InputError, nearest
from specs.progress import Report
from specs.scenario import load as load_scenario

SCENARIO = "four_targets_empty"
DRIVE_TICKS = 3000  # 60 s: all four targets
LAST_TICKS = 60  # of the drive, in which no fault begins: it needs frames to go on with


def faults(names: Sequence[str] = ()) -> list[Fault]:
    """Those called `names`, all without; raises InputError for an unknown one."""
    known = {
        f.name: f
        for f in (*BUS, *IMAGE, *INSIDE, *FILES, *CANOPEN, *FMU, *PROCESS, *KILLED_STARTING, *OUTSIDE)
    }
    for name in names:
        if name not in known:
            raise InputError(f"no fault '{name}'; {nearest(name, known)}")
    return [known[name] for name in dict.fromkeys(names)] if names else list(known.values())


def run(
    folder: Path, wanted: Sequence[Fault], count: int, seed: int, report: Report, ticks: int = DRIVE_TICKS
) -> list[Outcome]:
    """Inject each of the `wanted` faults `count` times into the runtime with the bundle in `folder`."""
    bundle = load(folder)
    outcomes = []
    single = [f for f in wanted if f.level not in ("fmu", "process")]
    if single:
        report("a drive without faults")
        drive = Drive(ControlCore(bundle), load_scenario(SCENARIO), ticks, seed)
        outcomes += _lockstep(drive, single, count, seed, report)
    files = [f for f in wanted if f.level == "fmu"]
    outcomes += run_fmus(files, count, seed, report)
    several = [f for f in wanted if f.level == "process"]
    if several:
        more = {
            **dict.fromkeys(watching.NAMES, watching.run),
            **lost_devices.INJECTIONS,
            **outside.INJECTIONS,
            "supervisor_killed": orphans.run,
        }
        outcomes += run_all(bundle, several, count, seed, report, more)
    return outcomes


def _lockstep(drive: Drive, wanted: Sequence[Fault], count: int, seed: int, report: Report) -> list[Outcome]:
    randoms = {f.name: np.random.default_rng([seed, zlib.crc32(f.name.encode())]) for f in wanted}
    possible = np.arange(drive.ticks.start, drive.ticks.stop - LAST_TICKS)
    ticks = {name: random.choice(possible, count) for name, random in randoms.items()}
    moments = drive.moments({int(t) for chosen in ticks.values() for t in chosen})
    outcomes = []
    for number, fault in enumerate(wanted):
        report(fault.name, number, len(wanted))
        inject, outcome = _injection(fault), Outcome(fault)
        for tick in ticks[fault.name]:
            inject(fault, drive, moments[int(tick)], randoms[fault.name], outcome)
        outcomes.append(outcome)
    return outcomes


def _injection(fault: Fault) -> Callable[..., None]:
    if fault.level != "inside":
        return injected.inject
    rooms = {"interface": interfaces, "canopen": devices, "audit": people, "retained": people}
    return getattr(rooms.get(fault.name.partition("_")[0], process_faults), fault.name)
