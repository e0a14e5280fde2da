"""A controller that only pushes, on the reference machine: the grab point stays out of the keep-out."""

import numpy as np
import pytest

from fmus.equations import kinematics
from slewright.hil.lockstep import lockstep
from specs import scenario
from tests.runtime import wild

MARGIN_M = 0.1  # that is left to the keep-out; runtime/core/README.md has what other pushes leave
AUTOMATIC = 3.0


@pytest.mark.slow
@pytest.mark.parametrize("which", ["nominal", "tuning:2"])
def test_pushed_with_all_it_has_the_arm_stops_before_the_keep_out(which: str) -> None:
    control = wild.core()
    found = lockstep(control, scenario.load("four_targets_unknown"), 3, 600, which=which)
    assert set(found.column("control_mode")) == {AUTOMATIC}
    g = kinematics.geometry()
    radius, tip = kinematics.arm_tip(found.column("true_q_boom"), found.column("true_q_stick"), g)
    height = tip - g.tool_length
    assert np.ptp(height) > 2.0  # it was pushed down a good way ...
    assert height.min() > g.keepout_height + MARGIN_M
    assert radius.min() > g.keepout_radius + MARGIN_M
    assert abs(found.column("u_boom")[-1]) < 0.2  # ... and has come to rest there
