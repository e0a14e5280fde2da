"""A controller that only pushes, on the reference machine: the grab point stays out of the keep-out."""

from functools import cache

import numpy as np
import pytest

from deployment.bundling.build import bundle_model
from deployment.hil.lockstep import lockstep
from fmus.equations import kinematics
from runtime.control import ControlCore
from specs import scenario
from tests.runtime import wild
from tests.runtime.bundles import folder

LEFT_M = 0.1  # at least, to the keep-out
AUTOMATIC = 3.0
PUSHES = {"boom": (0.0, -0.2, 0.0), "all": (1.0, -0.2, -0.2)}  # u_slew, qd_boom_ref, qd_stick_ref
MACHINES = ("nominal", "tuning:0", "tuning:1", "tuning:2", "tuning:3")
CASES = [(push, load, which) for push in PUSHES for load in ("empty", "2t") for which in MACHINES]
MARKS = {
    ("all", "2t", "tuning:2"): (),
    ("boom", "2t", "nominal"): pytest.mark.long,
    ("all", "empty", "nominal"): pytest.mark.long,
}


@cache
def pushing(push: str) -> ControlCore:
    return ControlCore(bundle_model(wild.pusher(PUSHES[push]), push, folder() / f"push-{push}"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("push", "load", "which"),
    [pytest.param(*case, marks=MARKS.get(case, pytest.mark.soak)) for case in CASES],
)
def test_pushed_with_all_it_has_the_arm_stops_before_the_keep_out(push: str, load: str, which: str) -> None:
    found = lockstep(pushing(push), scenario.load(f"four_targets_{load}"), 1, 600, which=which)
    assert set(found.column("control_mode")) == {AUTOMATIC}
    g = kinematics.geometry()
    radius, tip = kinematics.arm_tip(found.column("true_q_boom"), found.column("true_q_stick"), g)
    height = tip - g.tool_length
    assert np.ptp(height) > 2.0  # it was pushed down a good way ...
    assert height.min() > g.keepout_height + LEFT_M
    assert radius.min() > g.keepout_radius + LEFT_M
    assert abs(height[-1] - height[-100]) < 0.05  # ... and has come to rest there
