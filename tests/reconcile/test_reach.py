"""Which outputs an effect can move, on a model whose two joints know nothing of each other."""

from itertools import product

import pytest

from reconcile.equations.model import ALL_OUTPUTS, Attached, candidates, read_folder
from reconcile.equations.reach import Reach

BOOM, STICK = ["q_boom", "qd_boom"], ["q_stick", "qd_stick"]
RECORDED = ["qd_boom_ref", "qd_stick_ref", *BOOM, *STICK]


@pytest.fixture(scope="module")
def arm() -> tuple[Reach, dict[tuple[str, str], Attached]]:
    folder = read_folder("arm")
    found = {(a.effect.name, a.port): a for a in candidates(folder, RECORDED)}
    return Reach(folder, [*BOOM, *STICK]), found


@pytest.mark.parametrize(("joint", "outputs"), [("boom", BOOM), ("stick", STICK)])
def test_inputs_and_forces_move_their_own_joint(arm, joint, outputs):
    reach, found = arm
    assert reach.of(found["input_lag", f"qd_{joint}_ref"]) == {*outputs}
    assert reach.of(found["viscous_friction", joint]) == {*outputs}


def test_a_sensor_moves_itself_alone(arm):
    reach, found = arm
    assert reach.of(found["sensor_delay", "q_boom"]) == {"q_boom"}
    assert reach.of(found["sensor_delay", ALL_OUTPUTS]) == {*BOOM, *STICK}


def test_only_effects_with_an_output_in_common_explain_the_same(arm):
    reach, found = arm
    late = [found["input_lag", "qd_boom_ref"], found["sensor_delay", "q_boom"]]
    other = [found["input_lag", "qd_stick_ref"], found["sensor_delay", "q_stick"]]
    assert reach.common(*late)
    assert not any(reach.common(a, b) for a, b in product(late, other))
    assert all(reach.common(a, found["sensor_delay", ALL_OUTPUTS]) for a in (*late, *other))
