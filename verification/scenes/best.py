"""The best cycle time that optimal control finds for a scene: what cycle times are held against."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from baselines.optima.around import STAYS_S, Leg
from baselines.planning.moving import Moving
from specs.scene import Scene
from verification.scenes.course import planned


def best(scene: Scene, seed: int) -> dict[str, Any]:
    """`seconds` of the nominal machine with a load in the middle of the scene's, each target in least time.

    None where something moves, a target is passed or has no plan to begin from, or a search did not converge.
    """
    if Moving(scene) or any(target.path or target.through for target in scene.targets):
        return {"scene": scene.name, "seconds": None}
    machine = {"load_mass": sum(scene.load_kg) / 2}
    seconds, legs = STAYS_S * (len(scene.targets) - 1), planned(scene, "", seed)
    for leg in legs:
        if leg.path is None:
            return {"scene": scene.name, "seconds": None}
        if not np.ptp(leg.path.angles, axis=0).any():
            continue  # it is there
        least, converged = Leg(scene, leg.path, machine).quickest()
        if not converged:
            return {"scene": scene.name, "seconds": None}
        seconds += least
    return {"scene": scene.name, "seconds": seconds}


def ratios(rows: Sequence[Mapping[str, Any]], bests: Mapping[str, float | None]) -> dict[str, Any]:
    """Mean cycle time over the best of its scene, of runs that missed nothing, and of how many runs."""
    found = [
        row["cycle"] / bests[row["scene"]]
        for row in rows
        if row["driven"] and not row["missed"] and bests.get(row["scene"])
    ]
    return {"cycle_ratio": float(np.mean(found)) if found else None, "cycle_ratio_runs": len(found)}
