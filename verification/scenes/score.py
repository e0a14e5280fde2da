"""What a run of a scene is worth: contacts, clearance, cross-track error, times, speeds."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from baselines.following.arrival import SENSED
from baselines.planning.planner import hanging, pose_of
from records.metrics import BAND_DEG
from records.record import Record
from specs import pose
from specs.scenario import TICK_S, Target
from specs.scene import Box, Goal, Scene
from verification.scenes.contacts import contacts
from verification.scenes.run import TRUE, Guard, Ran

STAYS_S = 0.5  # that the grab is to be within the tolerance; drivers wait longer, by their sensors
EVERY = 10  # ticks between the samples of the cross-track error that are kept
SAMPLES = "cross_track"  # a row's samples, which summaries pool
PICTURE = "picture"  # what a page draws of a run
PICTURE_TICKS = 10  # between the poses of it
STOP = ("scene", "machine", "seed", "stopped_s", "reason")  # what a summary says of a run that stopped
GUARD_SUMS = ("interventions", "start_too_near", "targets_too_near")


def score(ran: Ran) -> dict[str, Any]:
    """The row of one run; of a scene without a plan it has the reason and no figures.

    `stopped_s` is when a run stopped whose next leg no longer had a path; `reason` has what stood in its way.
    """
    case = ran.case
    reasons = [f"{_towards(ran, k)}: {leg.reason}" for k, leg in enumerate(ran.legs) if leg.reason]
    row: dict[str, Any] = {
        "scene": case.scene.name, "family": case.scene.family, "controller": case.controller,
        "machine": case.machine, "seed": case.seed, "load_kg": round(case.load_kg, 1),
        "plan_s": [round(leg.seconds, 3) for leg in ran.legs],
        "reason": reasons[0] if reasons else "",
    }  # fmt: skip
    if ran.record is None:
        return {**row, "driven": False}
    record, angles = ran.record, _angles(ran.record)
    met = contacts(case.scene, angles, case.sizes, record.time)
    grab = pose.grab(angles, case.sizes)
    beside = _cross_track(ran, grab)
    return {
        **row,
        "driven": True,
        "stopped_s": None if ran.stopped is None else ran.stopped * TICK_S,
        "contact": met.ticks > 0,
        "contact_s": met.ticks * TICK_S,
        "clearance": float(met.distance.min()),
        "nearest": f"{met.part} to {met.solid} at {met.at_tick * TICK_S:.2f} s",
        "keep_out": bool(np.any(met.zones <= 0.0)),
        "too_fast": _too_fast(case.scene, grab),
        "cross_track_p95": float(np.quantile(beside, 0.95)) if len(beside) else None,
        SAMPLES: [round(v, 3) for v in beside[::EVERY].tolist()],
        PICTURE: _picture(ran, angles, grab),
        **_times(ran, record, grab),
        "tool": float(np.mean(np.degrees(np.hypot(*(record.column(f"true_qd_tool_{a}") for a in "xy"))))),
        "swing_deg": float(np.degrees(np.abs(angles[:, 3:]).max())),
        **_stepped_in(ran),
    }


def _towards(ran: Ran, leg: int) -> str:
    """The target that a leg ends at, by its number."""
    return f"target {sum(len(targets) for targets in ran.case.scene.stops()[: leg + 1])}"


def _stepped_in(ran: Ran) -> dict[str, Any]:
    """How often the guard stepped in, for how long, for which parts; whether it must at start and targets."""
    scene = ran.case.scene
    if ran.case.guarding is None:
        return {}
    guard, on = ran.case.guarding(scene), np.array([part != "" for part in ran.parts])
    start, *targets = (guard.begin(_rest(target, guard)) < 0.0 for target in (scene.start, *scene.targets))
    return {
        "interventions": int(np.count_nonzero(on & ~np.append(False, on[:-1]))),
        "guarded_share": float(np.mean(on)),
        "guarded_parts": sorted(set(ran.parts) - {""}),
        "start_too_near": start,
        "targets_too_near": sum(targets),
    }


def _rest(target: Target, guard: Guard) -> dict[str, float]:
    """What the guard sees of a machine that stands still with its grab at a target."""
    return dict.fromkeys(guard.reads, 0.0) | dict(zip(SENSED, pose_of(target).tolist(), strict=False))


def _angles(record: Record) -> np.ndarray:
    return np.stack([record.column(name) for name in TRUE], axis=1)


def _picture(ran: Ran, angles: np.ndarray, grab: np.ndarray) -> dict[str, Any]:
    """Planned ways and driven track of the grab, and the machine's poses."""
    ways = [hanging(leg.path)[::PICTURE_TICKS].round(2).tolist() for leg in ran.legs if leg.path]
    return {
        "ways": ways,
        "grab": grab[::PICTURE_TICKS].round(2).tolist(),
        "angles": angles[::PICTURE_TICKS].round(4).tolist(),
        "step_s": TICK_S * PICTURE_TICKS,
    }


def _rows_of(ran: Ran, count: int) -> list[slice]:
    """The ticks of each leg."""
    ends = [*ran.begins[1:], count]
    return [slice(a, b) for a, b in zip(ran.begins, ends, strict=True)]


def _cross_track(ran: Ran, grab: np.ndarray) -> np.ndarray:
    """Distance of the true grab point to the planned way at each tick [m]; none without a plan."""
    found = []
    for leg, rows in zip(ran.legs, _rows_of(ran, len(grab)), strict=False):
        if leg.path is not None:
            found.append(KDTree(hanging(leg.path)).query(grab[rows])[0])
    return np.concatenate(found) if found else np.empty(0)


def _times(ran: Ran, record: Record, grab: np.ndarray) -> dict[str, Any]:
    """Cycle time [s], targets missed, speed [°/s]: slew of the legs over their times into the 3° band."""
    slew, scene = np.degrees(record.column("true_q_slew")), ran.case.scene
    legs = scene.stops() if ran.legs else tuple((target,) for target in scene.targets)
    missed, reached, turned, taken = 0, 0, 0.0, 0.0
    for targets, rows in zip(legs, _rows_of(ran, len(grab)), strict=False):
        away = [_away(target, grab[rows]) <= scene.tolerance_m for target in targets]
        stays = 1 if targets[-1].through else round(STAYS_S / TICK_S)
        at = _stays(away[-1], stays)
        missed += (at is None) + sum(not near.any() for near in away[:-1])
        reached = rows.start + (len(grab[rows]) if at is None else at)
        goal = targets[-1].at(np.arange(len(grab[rows])) * TICK_S)
        error = slew[rows] - np.degrees(np.arctan2(goal[:, 1], goal[:, 0]))
        inside = np.abs((error + 180.0) % 360.0 - 180.0) <= BAND_DEG
        settled = len(inside) - int(np.argmax(~inside[::-1])) if not inside.all() else 0
        turned += abs(slew[rows][-1] - slew[rows][0])
        taken += max(settled, 1) * TICK_S
    return {
        "cycle": (reached - ran.begins[0]) * TICK_S if ran.begins else None,
        "targets": len(scene.targets),
        "missed": missed + sum(len(targets) for targets in legs[len(ran.begins) :]),
        "speed": turned / taken if taken else 0.0,
    }


def _away(target: Goal, grab: np.ndarray) -> np.ndarray:
    """Distance of the grab at each tick of a leg to its target, m."""
    return np.linalg.norm(grab - target.at(np.arange(len(grab)) * TICK_S), axis=1)


def _stays(inside: np.ndarray, count: int) -> int | None:
    """The first tick from which on `inside` holds for `count` ticks."""
    if len(inside) < count:
        return None
    held = np.convolve(inside, np.ones(count), "valid") >= count
    return int(np.argmax(held)) if held.any() else None


def _too_fast(scene: Scene, grab: np.ndarray) -> float:
    """By how much the grab was too fast in slow zones, at most [m/s]; 0 where it was not."""
    worst = 0.0
    speed = np.linalg.norm(np.gradient(grab, TICK_S, axis=0), axis=1)
    for zone in scene.zones:
        if zone.kind == "slow":
            inside = _inside(zone.shape, grab)
            worst = max(worst, float(np.max(speed[inside] - zone.speed_m_s, initial=0.0)))
    return worst


def _inside(shape: Any, points: np.ndarray) -> np.ndarray:
    if isinstance(shape, Box):
        away = points - np.array(shape.middle)
        turn = math.radians(shape.turn_deg)
        x = away[:, 0] * math.cos(turn) + away[:, 1] * math.sin(turn)
        y = away[:, 1] * math.cos(turn) - away[:, 0] * math.sin(turn)
        return np.all(np.abs(np.stack([x, y, away[:, 2]], axis=1)) <= np.array(shape.size) / 2, axis=1)
    away = points - np.array(shape.foot)
    return (
        (np.hypot(away[:, 0], away[:, 1]) <= shape.radius) & (away[:, 2] >= 0) & (away[:, 2] <= shape.height)
    )


def summary(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The figures of a controller over its runs."""
    driven = [row for row in rows if row["driven"]]
    plans = [seconds for row in rows for seconds in row["plan_s"]]
    samples = [value for row in driven for value in row[SAMPLES]]
    found: dict[str, Any] = {
        "scenes": len({row["scene"] for row in rows}),
        "machines": len({row["machine"] for row in rows}),
        "runs": len(driven),
        "without_plan": {row["scene"]: row["reason"] for row in rows if not row["driven"]},
        "stopped": [{name: row[name] for name in STOP} for row in driven if row["stopped_s"] is not None],
        "plan_p50_s": float(np.quantile(plans, 0.5)) if plans else None,
        "plan_p95_s": float(np.quantile(plans, 0.95)) if plans else None,
        "cross_track_p95": float(np.quantile(samples, 0.95)) if samples else None,
    }
    if not driven:
        return found
    count = sum(row["contact"] for row in driven)
    if "interventions" in driven[0]:
        found["runs_stepped_in"] = sum(row["interventions"] > 0 for row in driven)
        found["guarded_share"] = float(np.mean([row["guarded_share"] for row in driven]))
        found |= {name: sum(row[name] for row in driven) for name in GUARD_SUMS}
    return {
        **found,
        "contacts": count,
        "contact_share": count / len(driven),
        "contact_share_ci95": _wilson(count, len(driven)),
        "keep_outs": sum(row["keep_out"] for row in driven),
        "clearance_min": min(row["clearance"] for row in driven),
        "clearance_mean": float(np.mean([row["clearance"] for row in driven])),
        "too_fast_max": max(row["too_fast"] for row in driven),
        "targets": sum(row["targets"] for row in driven),
        "missed": sum(row["missed"] for row in driven),
        **{
            name: float(np.mean([row[name] for row in driven]))
            for name in ("cycle", "speed", "tool", "swing_deg")
        },
    }


def guarded(alone: Mapping[str, Any], behind: Mapping[str, Any]) -> dict[str, Any]:
    """What the guard did to a controller's figures: summaries of the same runs without and with it.

    No share (None) of a speed or a time that is 0 without it: of targets straight ahead, or at the start.
    """
    if not alone["runs"]:
        return {}
    return {
        "guarded": {name: value for name, value in behind.items() if name != "families"},
        "contacts_guarded": behind["contacts"],
        "interventions": behind["interventions"],
        **{
            f"{name}_guarded": behind[name] / alone[name] if alone[name] else None
            for name in ("speed", "cycle")
        },
    }


def _wilson(count: int, of: int) -> list[float]:
    """95 % interval of a share (Wilson)."""
    z, share = 1.96, count / of
    middle = (share + z * z / (2 * of)) / (1 + z * z / of)
    half = z / (1 + z * z / of) * math.sqrt(share * (1 - share) / of + z * z / (4 * of * of))
    return [max(0.0, middle - half), min(1.0, middle + half)]
