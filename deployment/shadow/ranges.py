"""Whether the machine was inside what the controller was made for: trained ranges, else stated ones."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from deployment.shadow.agreement import AUTOMATIC, in_mode
from deployment.shadow.recorded import Shadowed
from deployment.shadow.sway import length
from fmus.equations import kinematics
from learning.policy.export import read
from runtime.bundle import Bundle
from runtime.policy import POLICY
from specs import parameters, scenario as scenarios
from specs.policy import slew_error

TRAINED = "policy's metadata"


@dataclass(frozen=True)
class Range:
    """A range that is stated somewhere, SI."""

    name: str
    unit: str
    low: float
    high: float
    source: str


def compare(found: Shadowed, bundle: Bundle) -> list[dict[str, Any]]:
    """A row a range: what was seen, and the share of it inside; None where the recording does not tell."""
    return [_row(r, _values(r.name, found)) for r in (trained(bundle) or stated())]


def trained(bundle: Bundle) -> list[Range]:
    """Ranges that a bundle's policy says it was trained in; none for another controller."""
    path = bundle.folder / POLICY
    if not path.is_file():
        return []
    ranges = read(path).contract.ranges
    return [Range(n, UNITS.get(n, ""), low, high, TRAINED) for n, (low, high) in ranges.items()]


def stated() -> list[Range]:
    """Joint limits, the gate's speed limits and the loads of the scenarios."""
    g, gate = parameters.load("geometry"), parameters.load("gate")
    found = [
        Range(f"q_{j}", "rad", g[f"{j}_min"].value, g[f"{j}_max"].value, "joint limits, geometry.toml")
        for j in ("boom", "stick")
    ]
    for joint, limit in (
        ("slew", "gate_speed_slew"),
        ("boom", "gate_speed_arm"),
        ("stick", "gate_speed_arm"),
    ):
        top = gate[limit].value
        found.append(Range(f"qd_{joint}", "rad/s", -top, top, f"{limit}, gate.toml"))
    loads = [scenarios.load(name).load for name in scenarios.names()]
    top = max(load.high_kg for load in loads)
    found.append(
        Range("load_mass", "kg", min(load.low_kg for load in loads), top, "loads of specs/scenarios")
    )
    return found


def pendulum(found: Shadowed) -> dict[str, Any] | None:
    """Lengths of the tool's free swings, in m; None where it never swung freely."""
    lengths = length(found)
    if lengths is None:
        return None
    return {"swings": len(lengths), "low_m": float(lengths.min()), "high_m": float(lengths.max())}


def _values(name: str, found: Shadowed) -> np.ndarray | None:
    """What the recording tells of a quantity, in SI; of a target's in automatic operation.  None: nothing."""
    if name == "pendulum_length":
        return length(found)
    if name not in QUANTITIES:
        return None
    values = QUANTITIES[name](found)
    if name in OF_TARGET:  # elsewhere targets are left over, or none
        values = values[in_mode(found, AUTOMATIC)]
    return values[np.isfinite(values)]


def _row(r: Range, values: np.ndarray | None) -> dict[str, Any]:
    row: dict[str, Any] = {"name": r.name, "unit": r.unit, "low": r.low, "high": r.high, "source": r.source}
    if values is None or not values.size:
        return {**row, "seen_low": None, "seen_high": None, "inside_share": None, "inside": None}
    inside = float(np.mean((values >= r.low) & (values <= r.high)))
    ends = {"seen_low": float(values.min()), "seen_high": float(values.max())}
    return {**row, **ends, "inside_share": inside, "inside": bool(inside == 1.0)}


def _inertia(found: Shadowed) -> np.ndarray:
    load = np.nan_to_num(found.input("load_told"))
    return kinematics.inertia_z(found.input("q_boom"), found.input("q_stick"), load, kinematics.geometry())


def _slew_error(found: Shadowed) -> np.ndarray:
    columns = (found.input(n) for n in ("q_slew", "target_x", "target_y"))
    return np.array([slew_error(*row) for row in zip(*columns, strict=True)])


QUANTITIES: dict[str, Callable[[Shadowed], np.ndarray]] = {
    **{n: (lambda f, n=n: f.input(n)) for n in ("q_boom", "q_stick", "qd_slew", "qd_boom", "qd_stick")},
    **{n: (lambda f, n=n: f.input(n)) for n in ("pace", "target_z")},
    "load_mass": lambda f: f.output("load_estimate"),
    "target_radius": lambda f: np.hypot(f.input("target_x"), f.input("target_y")),
    "inertia": _inertia,
    "slew_error": _slew_error,
}
OF_TARGET = ("pace", "target_z", "target_radius", "slew_error")
UNITS = {
    "q_boom": "rad", "q_stick": "rad", "load_mass": "kg", "target_radius": "m", "target_z": "m", "pace": "1",
    "inertia": "kg.m2", "slew_error": "rad", "pendulum_length": "m", "slew_dead_band": "1",
}  # fmt: skip
