"""The four metrics of a run, computed from a record's true states, and their check against limits.

They are the paper's (Spinelli et al., section Evaluation), made exact. Targets change every 15 s; a target
*moves* when its slew angle is more than the 3° band away from the previous target's.

- speed [°/s]: slew angle between targets divided by the time from the target's start to the first row from
  which on the slew angle stays within 3° of the target to the end of its 15 s. A target never reached so
  counts with the whole 15 s and is missed. Mean over the targets that move.
- overshoot [°]: largest slew angle past the target in the direction of travel, 0 if it is never passed. Mean
  over the targets that move, the largest beside it.
- error [m]: distance of the tool's grab point to the target, mean over the target's last second, mean over
  targets. For slew-only control the slew error [°]: |slew angle − target's|, taken the same way.
- tool [°/s]: √(q̇x² + q̇y²) of the tool's two joints, mean over the whole 15 s, mean over targets.

Targets that the record does not cover to their end are left out, and the metrics say that they are
incomplete.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from records.figures_file import plain
from records.record import Record
from records.targets import Target, targets

BAND_DEG = 3.0  # a target is reached when the slew angle stays this close to it
LAST_S = 1.0  # the part of a target's time over which the error is averaged
TOLERANCES_M = (1.0, 2.0)
OF_MOVES = ("speed", "overshoot")  # have no value for a target that does not move


@dataclass(frozen=True)
class TargetMetrics:
    """What became of one target; angles in degrees, travel signed (counter-clockwise positive)."""

    number: int
    start_s: float
    slew_deg: float
    travel_deg: float
    moves: bool
    reached: bool
    time_s: float  # to enter and stay in the band; the whole duration when missed
    speed: float  # °/s
    overshoot: float  # °
    error: float  # m; NaN without the tool's position
    slew_error: float  # °
    tool: float  # °/s; NaN without the tool's rates


@dataclass(frozen=True)
class Metrics:
    """The four metrics of a run and what goes with them; NaN where a run has nothing to average."""

    speed: float  # °/s
    overshoot: float  # °, mean
    overshoot_max: float  # °
    error: float  # m
    slew_error: float  # °
    tool: float  # °/s
    missed: int
    within_1m: int  # targets with an error of at most 1 m
    within_2m: int
    targets: int
    complete: bool
    per_target: tuple[TargetMetrics, ...]

    def values(self, name: str) -> list[float]:
        """What the mean `name` (speed, overshoot, error, slew_error or tool) is the mean of, by target."""
        return _values(name, self.per_target)

    def as_dict(self) -> dict[str, Any]:
        """Return all figures for JSON; a figure that is not a number is None."""
        return plain(asdict(self))


def compute(record: Record) -> Metrics:
    """Return the metrics of a record; raises InputError when it lacks the slew angle or the targets."""
    asked = targets(record)
    rows = tuple(_target_metrics(record, t) for t in asked if t.whole)
    error, overshoots = np.array(_values("error", rows)), _values("overshoot", rows)
    return Metrics(
        speed=_mean(_values("speed", rows)),
        overshoot=_mean(overshoots),
        overshoot_max=max(overshoots, default=math.nan),
        error=_mean(error),
        slew_error=_mean(_values("slew_error", rows)),
        tool=_mean(_values("tool", rows)),
        missed=sum(r.moves and not r.reached for r in rows),
        within_1m=int(np.sum(error <= TOLERANCES_M[0])),
        within_2m=int(np.sum(error <= TOLERANCES_M[1])),
        targets=len(rows),
        complete=record.complete and len(rows) == len(asked) > 0,
        per_target=rows,
    )


def _values(name: str, rows: Sequence[TargetMetrics]) -> list[float]:
    return [getattr(r, name) for r in rows if r.moves or name not in OF_MOVES]


def _target_metrics(record: Record, target: Target) -> TargetMetrics:
    time = record.time[target.rows]
    past_deg = np.degrees(record.column("true_q_slew")[target.rows] - target.slew)
    travel_deg = math.degrees(target.travel)
    last = time > time[-1] - LAST_S + 1e-9
    settled_s = _settling_time(time, past_deg)
    time_s = target.duration_s if settled_s is None else settled_s
    return TargetMetrics(
        number=target.number,
        start_s=target.start_s,
        slew_deg=math.degrees(target.slew),
        travel_deg=travel_deg,
        moves=abs(travel_deg) > BAND_DEG,
        reached=settled_s is not None,
        time_s=time_s,
        speed=abs(travel_deg) / max(time_s, float(time[1] - time[0])),
        overshoot=max(0.0, float(np.max(math.copysign(1.0, travel_deg) * past_deg))),
        error=_mean(_distance(record, target)[last]),
        slew_error=_mean(np.abs(past_deg[last])),
        tool=_mean(_tool_rate_deg(record, target)),
    )


def _settling_time(time: np.ndarray, past_deg: np.ndarray) -> float | None:
    """Return the time [s] from the first row to the one from which on |past_deg| stays in the band.

    None when the last row is outside.
    """
    outside = np.flatnonzero(np.abs(past_deg) > BAND_DEG)
    if not len(outside):
        return 0.0
    return float(time[outside[-1] + 1] - time[0]) if outside[-1] + 1 < len(time) else None


def _distance(record: Record, target: Target) -> np.ndarray:
    """Distance of the grab point to the target in its rows [m]; NaN where the record has no tool."""
    names = ("true_tool_x", "true_tool_y", "true_tool_z")
    if not all(name in record for name in names):
        return np.full(target.rows.stop - target.rows.start, np.nan)
    point = np.column_stack([record.column(name)[target.rows] for name in names])
    return np.linalg.norm(point - (target.x, target.y, target.z), axis=1)


def _tool_rate_deg(record: Record, target: Target) -> np.ndarray:
    if "true_qd_tool_x" not in record or "true_qd_tool_y" not in record:
        return np.full(target.rows.stop - target.rows.start, np.nan)
    return tool_rate_deg(record)[target.rows]


def tool_rate_deg(record: Record) -> np.ndarray:
    """Return √(q̇x² + q̇y²) of the tool's joints over the whole record [°/s]."""
    return np.degrees(np.hypot(record.column("true_qd_tool_x"), record.column("true_qd_tool_y")))


def _mean(values: Any) -> float:
    return float(np.mean(values)) if len(values) else math.nan


@dataclass(frozen=True)
class Verdict:
    """One figure of a run held against its limit."""

    scenario: str
    system: str
    metric: str
    value: float
    minimum: float | None
    maximum: float | None
    passed: bool
    reason: str  # why the limit is what it is

    @property
    def limit(self) -> str:
        """The limit in words, as in '≥ 10' or '2 … 4'."""
        low, high = self.minimum, self.maximum
        if low is not None and high is not None:
            return f"{low:g} … {high:g}"
        return f"≥ {low:g}" if low is not None else f"≤ {high:g}" if high is not None else "whole run"


def check_limits(
    metrics: Metrics, limits: Mapping[str, Mapping[str, Any]], scenario: str = "", system: str = ""
) -> list[Verdict]:
    """Hold metrics against limits {metric: {"min": …, "max": …, "reason": …}}, either bound optional.

    An incomplete run adds a failed verdict; a figure that is not a number passes nothing.
    Raises ValueError on a limit for a metric that does not exist.
    """
    known = {k for k, v in asdict(metrics).items() if isinstance(v, int | float) and not isinstance(v, bool)}
    unknown = sorted(set(limits) - known)
    if unknown:
        raise ValueError(f"no such metric: {', '.join(unknown)}; there are {', '.join(sorted(known))}")
    verdicts = [
        _verdict(scenario, system, name, getattr(metrics, name), limit) for name, limit in limits.items()
    ]
    if not metrics.complete:
        why = "the run did not go to its end"
        verdicts.append(Verdict(scenario, system, "complete", 0.0, None, None, False, why))
    return verdicts


def _verdict(scenario: str, system: str, metric: str, value: float, limit: Mapping[str, Any]) -> Verdict:
    low, high = limit.get("min"), limit.get("max")
    passed = math.isfinite(value) and (low is None or value >= low) and (high is None or value <= high)
    return Verdict(scenario, system, metric, float(value), low, high, passed, str(limit.get("reason", "")))
