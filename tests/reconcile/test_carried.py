"""Experiments of the tool: the machine's commands, and the motion that is expected of them."""

import numpy as np
import pytest

from fmus.equations import kinematics
from reconcile.experiment import plan
from reconcile.experiment.carried import Carrier, carrier
from reconcile.recordings.data import Run, Signal
from reconcile.system.parts import part_named

POSE = {"q_boom": 1.1, "q_stick": -1.2}
TICK_S = 0.1


def tool():
    part = part_named("tool")
    assert part is not None
    assert part.derive is not None
    return part.derive


def commands(**driven: float) -> dict[str, np.ndarray]:
    """Rest for 1 s, then what is driven for 4 s."""
    return {n: np.r_[np.zeros(10), np.full(40, driven.get(n, 0.0))] for n in plan.PLAN_COMMANDS}


def test_the_pose_is_that_which_holds_the_suspension_where_it_was_recorded():
    radius, height = kinematics.arm_tip(POSE["q_boom"], POSE["q_stick"], kinematics.geometry())
    time = 0.02 * np.arange(50)
    recorded = {"radius": float(radius), "height": float(height), "q_slew": 0.7}
    inputs = {n: Signal(time, np.full(50, v)) for n, v in recorded.items()}
    found = carrier(tool(), Run("still", 0.0, 1.0, inputs, {}))
    assert dict(found.pose) == pytest.approx(POSE)
    assert found.q_slew == 0.7


def test_without_commands_nothing_moves():
    moved = Carrier(tool(), POSE, 0.7).moved(commands(), TICK_S)
    for name, value in (*POSE.items(), ("q_slew", 0.7)):
        assert moved[name] == pytest.approx(value, abs=1e-9)


def test_commands_move_what_carries_the_tool_and_so_its_inputs():
    moves = Carrier(tool(), POSE, 0.0)
    moved = moves.moved(commands(u_slew=0.6, qd_boom_ref=-0.1), TICK_S)
    inputs = moves.inputs(moved)
    assert set(inputs) == {"q_slew", "qd_slew", "radius", "radius_rate", "height"}
    still = inputs["q_slew"].time < 0.9
    assert np.ptp(inputs["q_slew"].values[still]) == pytest.approx(0.0, abs=1e-9)
    assert inputs["q_slew"].values[-1] > 0.3
    assert moved["q_boom"][-1] == pytest.approx(POSE["q_boom"] - 0.4, abs=0.08)  # late, and slowly at first
    assert np.gradient(inputs["radius"].values, 0.02)[150] == pytest.approx(
        inputs["radius_rate"].values[150], rel=0.02
    )


def test_ranges_are_those_of_the_commands_and_limits_those_of_the_supervisor():
    assert Carrier(tool(), POSE, 0.0).ranges["u_slew"] == (-1.0, 1.0)
    assert set(Carrier(tool(), POSE, 0.0).ranges) == set(plan.PLAN_COMMANDS)
    assert plan.kept()["q_tool_x"] == (-0.6, 0.6)
    assert plan.kept()["q_tool_y"] == (-0.6, 0.6)
