"""What the guard costs in speed where nothing is near: a controller's scenarios inside a ring of walls.

The ring is as far from the targets as stated, and higher than the machine.  The same scenarios, seeds and
controller run without a guard and with one, one after the other in one process.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from deployment.bundling.build import bundle
from deployment.hil.lockstep import lockstep
from records.metrics import compute
from runtime.control import ControlCore
from runtime.image import OUTPUT
from specs import scenario
from specs.progress import Report
from specs.scenario import Scenario
from specs.scene import Box, Goal, Scene

CONTROLLER = "pd"
SCENARIOS = ("four_targets_empty", "four_targets_2t", "five_targets_unknown")
WALLS, HEIGHT_M, THICK_M = 24, 20.0, 1.0


def ring(inner_m: float) -> Scene:
    """Walls all around, their insides at least `inner_m` from the slew axis."""
    walls, place = [], inner_m / math.cos(math.pi / WALLS) + THICK_M / 2
    for k in range(WALLS):
        turn = 2 * math.pi * k / WALLS
        size = (THICK_M, 2.2 * place * math.sin(math.pi / WALLS), HEIGHT_M)
        middle = (place * math.cos(turn), place * math.sin(turn), HEIGHT_M / 2)
        walls.append(Box(name=f"wall {k}", middle=middle, size=size, turn_deg=math.degrees(turn)))
    target = Goal(slew_deg=0.0, radius_m=9.0, height_m=4.0)
    name = f"ring of {inner_m:.1f} m"
    return Scene(name=name, description=name, start=target, targets=(target,), things=tuple(walls))


def loss(folder: Path, distances_m: Sequence[float], seed: int, report: Report) -> dict[str, Any]:
    """Speed with the guard over speed without, by distance of the ring to the farthest target."""
    known = [scenario.load(name) for name in SCENARIOS]
    farthest = max(target.radius_m for one in known for target in one.targets)
    plain = [_speed(ControlCore(bundle(CONTROLLER, folder / "speed-plain")), one, seed)[0] for one in known]
    rows = {}
    for number, distance in enumerate(distances_m):
        report("speed", number, len(distances_m))
        core = ControlCore(bundle(CONTROLLER, folder / f"ring-{number}", guard=ring(farthest + distance)))
        found = [_speed(core, one, seed) for one in known]
        ratios = [guarded / alone for (guarded, _), alone in zip(found, plain, strict=True)]
        rows[f"{distance:g}"] = {
            "ratio": float(np.mean(ratios)),
            "ratio_min": min(ratios),
            "stepped_in": float(np.mean([share for _, share in found])),
        }
    return {"controller": CONTROLLER, "scenarios": list(SCENARIOS), "by_distance_m": rows}


def _speed(core: ControlCore, one: Scenario, seed: int) -> tuple[float, float]:
    """Speed [°/s], and the share of ticks in which the guard stepped in."""
    place, counts = OUTPUT.index["guard_part"], [0, 0]

    def look(_: np.ndarray, outputs: np.ndarray, tick: int) -> None:
        counts[0] += 1
        counts[1] += bool(outputs["value"][place])

    metrics = compute(lockstep(core, one, seed, look=look))
    return metrics.speed, counts[1] / counts[0]
