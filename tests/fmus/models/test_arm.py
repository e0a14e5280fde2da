"""The arm against its closed form: first order with delay, limits, reference roll-out."""

import numpy as np
import pytest

from fmus.equations import kinematics
from fmus.models.arm.model import MODEL, STEP
from fmus.toolchain.discrete import DiscreteStepper
from tests.fmus.models.roll_out import check_reference, feeds_through, unused_parameters

DT = STEP


def _stimuli(tick: int) -> dict[str, float]:
    t = tick * DT
    return {
        "qd_boom_ref": 0.15 if 0.5 <= t < 4.5 else -0.3 if t >= 6 else 0.0,
        "qd_stick_ref": -0.1 if 1.0 <= t < 3.0 else 0.05,
        "disturbance_torque_boom": 5e4 if 8.0 <= t < 8.2 else 0.0,
        "disturbance_torque_stick": -2e4 if 9.0 <= t < 9.2 else 0.0,
    }


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.26, 0.5])
@pytest.mark.parametrize("response", [0.05, 0.1, 1.0])
def test_step_response_is_the_closed_form(delay: float, response: float) -> None:
    arm = DiscreteStepper(MODEL, {"boom_delay": delay, "boom_response": response})
    arm.advance(3)
    arm.set(qd_boom_ref=0.1)
    wait = round(delay / DT)
    q = arm.state("boom")
    for k in range(1, 60):
        arm.advance()
        steps = max(0, k - wait)
        expected = 0.1 * (1 - (1 - response) ** steps)
        assert arm.outputs()["qd_boom"] == pytest.approx(expected, abs=1e-12)
        q += DT * expected
        assert arm.outputs()["q_boom"] == pytest.approx(q, abs=1e-12)


def test_default_delay_is_longer_than_the_encoders() -> None:
    p = {v.name: v.start for v in MODEL.parameters}
    assert p["boom_delay"] > 0.2
    assert p["stick_delay"] > 0.2


def test_references_are_clipped() -> None:
    arm = DiscreteStepper(MODEL, {"start_q_boom": 0.7})
    arm.set(qd_boom_ref=5.0, qd_stick_ref=-5.0)
    arm.advance(150)
    assert arm.outputs()["qd_boom"] == pytest.approx(0.2, abs=1e-6)
    assert arm.outputs()["qd_stick"] == pytest.approx(-0.2, abs=1e-6)


@pytest.mark.parametrize(("joint", "sign"), [("boom", 1), ("boom", -1), ("stick", 1), ("stick", -1)])
def test_joint_limits_stop_the_motion_and_let_go(joint: str, sign: int) -> None:
    arm = DiscreteStepper(MODEL)
    p = {v.name: v.start for v in MODEL.parameters}
    limit = p[f"{joint}_max" if sign > 0 else f"{joint}_min"]
    arm.set(**{f"qd_{joint}_ref": 0.2 * sign})
    arm.advance(1000)
    assert arm.state(joint) == limit
    assert arm.outputs()[f"qd_{joint}"] == 0.0
    assert arm.outputs()["radius_rate"] == 0.0
    arm.set(**{f"qd_{joint}_ref": -0.2 * sign})
    arm.advance(100)
    assert sign * (limit - arm.state(joint)) > 0.05


def test_torque_accelerates_the_joint_inertia() -> None:
    arm = DiscreteStepper(MODEL, {"boom_response": 0.01})
    arm.set(disturbance_torque_boom=46e3)
    arm.advance()
    assert arm.outputs()["qd_boom"] == pytest.approx(46e3 / 4.6e5 * DT)


def test_outputs_follow_the_kinematics() -> None:
    arm = DiscreteStepper(MODEL, {"load_mass": 1500.0})
    arm.set(qd_boom_ref=0.1, qd_stick_ref=-0.15)
    arm.advance(100)
    out, g = arm.outputs(), kinematics.geometry()
    before = kinematics.arm_tip(out["q_boom"] - DT * out["qd_boom"], out["q_stick"] - DT * out["qd_stick"], g)
    assert (out["radius"], out["height"]) == pytest.approx(
        kinematics.arm_tip(out["q_boom"], out["q_stick"], g)
    )
    assert out["radius_rate"] == pytest.approx((out["radius"] - before[0]) / DT, rel=0.05)
    assert out["height_rate"] == pytest.approx((out["height"] - before[1]) / DT, rel=0.05)
    assert out["inertia"] == pytest.approx(kinematics.inertia_z(out["q_boom"], out["q_stick"], 1500.0, g))
    assert np.sign(out["inertia_rate"]) == np.sign(out["radius_rate"])


def test_no_output_depends_on_an_input() -> None:
    assert feeds_through(MODEL) == []


def test_every_parameter_is_used() -> None:
    assert unused_parameters(MODEL) == []


def test_reference_roll_out() -> None:
    check_reference(MODEL, "fmus/models/arm", _stimuli, 500)
