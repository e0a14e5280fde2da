"""The machine's slew, read through its sensors from the FMU, against the slew traces at 400 t m2."""

from functools import cache

import numpy as np
import pytest

from fmus.equations import kinematics
from fmus.models.slew import features, traces
from fmus.toolchain.build import build_fmu
from tests.fmus.importer import Imported
from tests.fmus.models.machine_runs import start


@cache
def _traces() -> dict[str, traces.Trace]:
    return traces.load()


def pose_of(inertia: float, q_boom: float = 1.1) -> tuple[float, float]:
    """(q_boom, q_stick) at which the empty machine has the slew inertia, kg m2, by bisection."""
    low, high = -2.4, -1.2
    for _ in range(60):
        middle = (low + high) / 2
        below = kinematics.inertia_z(q_boom, middle, 0.0, kinematics.geometry()) < inertia
        low, high = (middle, high) if below else (low, middle)
    return q_boom, middle


@pytest.mark.parametrize("percent", [35, 50, 70, 100])
def test_slew_features_match_the_traces_at_400_t_m2(percent: int) -> None:
    wanted, found = [], []
    for sign, suffix in ((1, ""), (-1, "_neg")):
        wanted.append(features.of_trace(_traces()[f"step_{percent:03d}_I400{suffix}"]))
        found.append(_step_features(sign * percent / 100))
    misses = features.misses(features.mean(found), features.mean(wanted))
    assert misses == []


def _step_features(u: float) -> features.Features:
    path = build_fmu("machine", 2)
    q_boom, q_stick = pose_of(4e5)
    rows = []
    with Imported(path, seed=0, **start(q_boom, q_stick)) as machine:
        for k in range(900):
            machine.set(u_slew=u if features.STEP_AT <= k * 0.02 + 1e-9 < features.RELEASE_AT else 0.0)
            rows.append([k * 0.02, *machine.get("qd_slew", "q_slew")])
            machine.step()
    return features.features(*np.array(rows).T)
