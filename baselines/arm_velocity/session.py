"""`slewright calibrate lut`, from recordings or a sweep made for it to tables and tracking errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from baselines.arm_velocity import calibrate as noise_free, lut, tracking
from baselines.arm_velocity.lut import GRID, Table
from baselines.arm_velocity.model import JOINTS
from baselines.arm_velocity.sweep import LABEL, sweep
from baselines.bench import arm_loop
from baselines.parameter_file import update
from records.formats import read_measurement
from records.measurement import Measurement
from specs import draws, parameters
from specs.errors import InputError, nearest
from specs.progress import Report

Tracked = dict[str, dict[str, dict[str, tracking.Errors]]]  # "before", "after" -> joint -> "ff", "ff_pi"


@dataclass(frozen=True)
class Outcome:
    """What a calibration came to; `tracked` is empty where no machine can be simulated for it."""

    tables: dict[str, Table]
    tracked: Tracked
    origin: str  # from what the tables are
    machine: str  # whose recordings they are: a machine's name, or "" for another one
    files: tuple[Path, ...]


def check_joints(joints: Sequence[str]) -> list[str]:
    """The joints asked for, both if none; InputError for another name."""
    for joint in joints:
        if joint not in JOINTS:
            raise InputError(f"unknown joint '{joint}'; {nearest(joint, JOINTS)}")
    return [joint for joint in JOINTS if joint in joints or not joints]


def check_request(recordings: Sequence[Path], machine: str, write: bool) -> None:
    """InputError, before minutes go by, for a machine that is none or whose tables are not for specs."""
    draws.named(machine)
    if write and not recordings:
        _check_nominal(machine)


def run(
    recordings: Sequence[Path],
    joints: Sequence[str],
    seed: int,
    machine: str,
    folder: Path,
    report: Report | None = None,
) -> Outcome:
    """Calibrate from `recordings`, or from sweeps of `machine` recorded to `folder`; judge what can be.

    Raises InputError as lut.py does.
    """
    joints = check_joints(joints)
    files = list(recordings) or sweep(folder, joints, seed, machine, report=report)
    read = [read_measurement(path) for path in files]
    if report:
        report("steady segments and curves", 0, 1)
    tables = lut.calibrate(read, joints, seed)
    known = _simulated(read)
    tracked: Tracked = {}
    whole = {j: t.command for j, t in tables.items() if np.all(np.isfinite(t.command))}
    if known and len(whole) == len(tables):
        loop = arm_loop()
        for name, used in (("before", None), ("after", whole)):
            tracked[name] = tracking.track(loop, used, known, seed, joints, report=report)
    origin = f"{len(files)} recordings of {f'the {LABEL} ({known})' if known else 'a machine'}"
    return Outcome(tables, tracked, origin, known, tuple(files))


def _simulated(recordings: Sequence[Measurement]) -> str:
    """The simulated machine all recordings are of; "" where any is of another one."""
    labels = {(r.meta.get("origin"), r.meta.get("machine")) for r in recordings}
    origin, machine = labels.pop()
    return str(machine) if not labels and origin == LABEL and machine else ""


def check_writable(outcome: Outcome) -> None:
    """InputError when the tables do not belong into specs."""
    if outcome.machine:
        _check_nominal(outcome.machine)
    lacking = {j: [p.velocity for p in t.lacking] for j, t in outcome.tables.items() if t.lacking}
    if lacking:
        said = "; ".join(f"{j} {', '.join(f'{v:+.4f}' for v in some)} rad/s" for j, some in lacking.items())
        raise InputError(f"--write: nothing written, points lack data: {said}")


def _check_nominal(machine: str) -> None:
    if machine != draws.NOMINAL:
        raise InputError(f"--write: specs hold the tables of the nominal machine, not of the draw {machine}")


def write_specs(outcome: Outcome) -> Path:
    """Put the tables into specs/parameters/arm_velocity.toml; InputError before anything is written."""
    check_writable(outcome)
    values = {joint: table.command for joint, table in outcome.tables.items()}
    return write_tables(values, dict.fromkeys(values, f"slewright calibrate lut: {outcome.origin}"))


def write_tables(tables: Mapping[str, Sequence[float] | np.ndarray], sources: Mapping[str, str]) -> Path:
    """Put tables [25] of joints into specs/parameters/arm_velocity.toml."""
    path = parameters.FOLDER / "arm_velocity.toml"
    for joint, table in tables.items():
        rounded = [round(float(v), 4) for v in table]
        path = update("arm_velocity", tracking.parameters_of({joint: rounded}), sources[joint])
    return path


def present_tables() -> dict[str, np.ndarray]:
    """The tables [25] in specs, by joint."""
    known = {name: p.value for name, p in parameters.load("arm_velocity").items()}
    return {joint: noise_free.table(known, joint)[1] for joint in JOINTS}


def shortfalls(outcome: Outcome) -> list[str]:
    """One sentence for each joint that misses tracking.TARGET with the new tables and the PI."""
    errors = {joint: modes["ff_pi"].rms for joint, modes in outcome.tracked.get("after", {}).items()}
    return [
        f"{joint}: {rms:.4f} rad/s RMS with PI, wanted at most {tracking.TARGET:g} "
        "(why: docs/how-to/calibration.md)"
        for joint, rms in errors.items()
        if rms > tracking.TARGET
    ]


def figures(outcome: Outcome) -> dict[str, Any]:
    """All of it as plain data, errors in rad/s."""
    return {
        "origin": outcome.origin,
        "machine": outcome.machine,
        "window_s": [tracking.TRANSIENT_S, tracking.LAST_S],
        "target_rad_s": tracking.TARGET,
        "joints": {joint: _joint(outcome, joint, table) for joint, table in outcome.tables.items()},
    }


def _joint(outcome: Outcome, joint: str, table: Table) -> dict[str, Any]:
    errors: dict[str, Any] = {}
    for name, group in outcome.tracked.items():
        here: dict[str, Any] = {f"rms_{mode}": e.rms for mode, e in group[joint].items()}
        here["by_speed"] = {mode: e.by_speed() for mode, e in group[joint].items()}
        errors = {**errors, name: here, **(here if name == "after" else {})}
    return {
        **errors,
        "velocity": GRID,
        "command": table.command,
        "low95": table.low,
        "high95": table.high,
        "error": table.error,
        "dead_band": {way: vars(band) for way, band in table.dead_band.items()},
        "reference": table.reference,
        "spread": table.spread,
        "lacking": [vars(point) for point in table.lacking],
        "out_of_reach": table.out_of_reach,
        "segments": len(table.segments),
        "unsteady": table.unsteady,
        "notes": table.notes,
    }
