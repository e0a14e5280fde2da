"""Tables of the arm as a file: TOML, a section for each joint, commands beside velocities and intervals."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from baselines.arm_velocity.lut import GRID, Table
from baselines.arm_velocity.model import JOINTS, POINTS
from specs.errors import InputError
from specs.schema import read_toml

HEAD = "# Velocity tables of the arm, made by slewright calibrate lut (docs/how-to/calibration.md).\n"
UNITS = "# velocity rad/s; commands, dead bands and standard errors in shares of full joystick.\n"


def render(tables: Mapping[str, Table], origin: str) -> str:
    """The file's text; what was not measured is nan. `origin` says from which recordings the tables are."""
    return "".join([HEAD, UNITS, f"origin = {_quoted(origin)}\n", *(_joint(t) for t in tables.values())])


def _joint(table: Table) -> str:
    lines = [f"\n[{table.joint}]"]
    columns = {
        "velocity": GRID,
        "command": table.command,
        "low95": table.low,
        "high95": table.high,
        "error": table.error,
    }
    lines += [f"{name} = {_numbers(values)}" for name, values in columns.items()]
    lines.append(f"lacking = {_numbers(np.array([point.velocity for point in table.lacking]))}")
    for way, band in table.dead_band.items():
        lines.append(f"dead_band.{way} = {_numbers(np.array([band.value, band.low, band.high]))}")
    for way, condition in table.reference.items():
        lines += [f"reference.{way}.{name} = {value:.6g}" for name, value in condition.items()]
    return "\n".join(lines) + "\n"


def read(path: Path) -> dict[str, np.ndarray]:
    """Commands [25] by joint; InputError naming the file and what is wrong with it."""
    data = read_toml(path)
    found = {joint: data[joint] for joint in JOINTS if isinstance(data.get(joint), dict)}
    if not found:
        raise InputError(f"{path} has no table of {' or '.join(JOINTS)}")
    return {joint: _checked(f"{path}: {joint}", section.get("command")) for joint, section in found.items()}


def _checked(where: str, values: object) -> np.ndarray:
    if not isinstance(values, list) or len(values) != POINTS:
        raise InputError(f"{where}: command must be {POINTS} numbers")
    if not all(isinstance(v, int | float) for v in values):
        raise InputError(f"{where}: command must be {POINTS} numbers")
    table = np.array(values, dtype=float)
    if not np.all(np.isfinite(table)):
        raise InputError(f"{where}: points lack data; calibrate with recordings that cover them")
    if np.any(np.abs(table) > 1) or np.any(np.diff(table) < 0):
        raise InputError(f"{where}: commands must ascend within -1 … 1")
    return table


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return "[" + ", ".join("nan" if math.isnan(v) else f"{v + 0.0:.4f}" for v in values) + "]"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ") + '"'
