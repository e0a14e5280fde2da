"""Scores the load estimate on simulated machines: shares of errors, coverage of the intervals.

Each machine is calibrated by its own trials, then driven through other ones with loads of 0 to 2.5 t.  The
load that was in the grab is used for calibration (known loads) and for the score, by nothing else.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from baselines.load.calibration import Calibration, calibrate, uncalibrated
from baselines.load.estimate import Estimate, estimate
from baselines.load.trials import Trial, run
from specs import draws
from specs.progress import Report

LOADS = (0.0, 500.0, 1000.0, 1500.0, 2000.0, 2500.0)  # kg
KNOWN = 1500.0  # kg, of the calibration with a known load
LIMITS = {"still": 100.0, "moving": 200.0}  # kg, that 95 % are to stay within
SHARE = 0.95
CALIBRATIONS = ("none", "empty", "empty_and_known")
COLUMNS = (
    *("calibration", "motion", "estimates", "within limit", "covered"),
    *("95 % kg", "largest kg", "+- kg"),
)
SHIPPED = "empty"  # what the limits apply to


@dataclass(frozen=True)
class Scored:
    """An estimate beside the load that was there."""

    machine: str
    load_kg: float
    estimate: Estimate

    @property
    def error(self) -> float:
        """Estimate less load, kg."""
        return self.estimate.load_kg - self.load_kg

    @property
    def covered(self) -> bool:
        """Does the 95 % interval hold the load?"""
        low, high = self.estimate.interval
        return low <= self.load_kg <= high


def machines(draws: int, kind: str = "validation") -> list[str]:
    """The nominal machine and so many draws of a set."""
    return ["nominal", *(f"{kind}:{k}" for k in range(draws))]


def validate(
    chosen: Sequence[str],
    loads: Sequence[float] = LOADS,
    poses: int = 4,
    retained: tuple[float, float] = (0.0, 0.0),
    report: Report | None = None,
) -> dict[str, Any]:
    """Figures of all `chosen` machines: by calibration, by motion, by load, by machine.

    `poses` of each scored trial; `retained`: share of the friction that cylinders keep at rest, from and to.
    """
    for machine in chosen:  # an unknown draw is refused before minutes are spent on others
        draws.named(machine)
    found: dict[str, list[Scored]] = {name: [] for name in CALIBRATIONS}
    left_out: dict[str, int] = {}
    for number, machine in enumerate(chosen):
        if report:
            report(machine, number, len(chosen))
        calibrations = calibrated(machine, retained)
        for load in loads:
            recording = run(Trial("score", round(load), load, poses, retained), machine)
            for name, calibration in calibrations.items():
                result = estimate(recording, calibration)
                found[name] += [Scored(machine, load, e) for e in result.estimates]
            for reason, count in result.left_out.items():
                left_out[reason] = left_out.get(reason, 0) + count
    return _figures(found, left_out, chosen, loads) | {"retained": list(retained)}


def calibrated(machine: str, retained: tuple[float, float] = (0.0, 0.0)) -> dict[str, Calibration]:
    """The three calibrations of a machine, by name."""
    empty = run(Trial("calibration", 0, 0.0, 6, retained), machine)
    known = run(Trial("calibration", 1, KNOWN, 4, retained), machine)
    both = calibrate([empty, known], [0.0, KNOWN])
    return dict(zip(CALIBRATIONS, (uncalibrated(), calibrate([empty], [0.0]), both), strict=True))


def _figures(
    found: dict[str, list[Scored]], left_out: dict[str, int], chosen: Sequence[str], loads: Sequence[float]
) -> dict[str, Any]:
    shipped = found[SHIPPED]
    windows = len(shipped) + sum(left_out.values())
    by_load = {f"{load:g}": motions([s for s in shipped if s.load_kg == load]) for load in loads}
    by_machine = {m: motions([s for s in shipped if s.machine == m]) for m in chosen}
    calibrations = {name: motions(scored) for name, scored in found.items()}
    return {
        "origin": "simulated reference machine",
        "machines": list(chosen),
        "loads_kg": list(loads),
        "limits_kg": LIMITS,
        "calibrations": calibrations,
        "by_load_kg": by_load,
        "by_machine": by_machine,
        "windows": windows,
        "left_out": left_out,
        "accepted": accepted(calibrations[SHIPPED]),
    }


def motions(scored: Sequence[Scored]) -> dict[str, Any]:
    """Figures at rest, in motion, and of those in motion while the arm itself moves."""
    picked = {
        "still": [s for s in scored if not s.estimate.moving],
        "moving": [s for s in scored if s.estimate.moving],
        "arm_moving": [s for s in scored if s.estimate.sliding],
    }
    return {
        name: _score(found, LIMITS.get(name, LIMITS["moving"])) for name, found in picked.items() if found
    }


def _score(scored: Sequence[Scored], limit: float) -> dict[str, float]:
    errors = np.array([s.error for s in scored])
    return {
        "estimates": len(scored),
        "within_limit": float(np.mean(np.abs(errors) <= limit)),
        "covered": float(np.mean([s.covered for s in scored])),
        "p95_kg": float(np.quantile(np.abs(errors), SHARE)),
        "largest_kg": float(np.max(np.abs(errors))),
        "mean_kg": float(np.mean(errors)),
        "half_width_kg": float(np.median([s.estimate.half_kg for s in scored])),
    }


def accepted(figures: dict[str, Any]) -> bool:
    """95 % within the limits and 95 % covered, at rest and in motion."""
    parts = [figures.get(name, {"within_limit": 0.0, "covered": 0.0}) for name in LIMITS]
    return all(p["within_limit"] >= SHARE and p["covered"] >= SHARE for p in parts)


def rows(figures: Mapping[str, Any]) -> list[tuple[object, ...]]:
    """The table of a score: a row for each calibration and motion, under COLUMNS."""
    keys = ("estimates", "within_limit", "covered", "p95_kg", "largest_kg", "half_width_kg")
    return [
        (name, motion, *(score[k] for k in keys))
        for name, parts in figures["calibrations"].items()
        for motion, score in parts.items()
    ]
