"""Laws of the kinematics: round trips, rates against finite differences, the known slew inertias."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, strategies as st

from fmus.equations import kinematics as k

G = k.geometry()
BOOM = st.floats(G.boom_min, G.boom_max)
STICK = st.floats(G.stick_min, G.stick_max)
SLEW = st.floats(-3.1, 3.1)
RATE = st.floats(-0.2, 0.2)


@given(SLEW, BOOM, STICK)
def test_inverse_undoes_forward(q_slew: float, q_boom: float, q_stick: float) -> None:
    radius, height = k.arm_tip(q_boom, q_stick, G)
    joints = k.inverse(*k.grab_point(q_slew, radius, height, G), G)
    np.testing.assert_allclose(joints, (q_slew, q_boom, q_stick), atol=1e-8)


@given(SLEW, BOOM, STICK)
def test_symbols_and_numbers_agree(q_slew: float, q_boom: float, q_stick: float) -> None:
    point = k.grab_point(q_slew, *k.arm_tip(q_boom, q_stick, G), G)
    symbols = ca.SX.sym("target", 3)
    symbolic = ca.Function("inverse", [symbols], list(k.inverse(symbols[0], symbols[1], symbols[2], G)))
    np.testing.assert_allclose([float(q) for q in symbolic(point)], k.inverse(*point, G), atol=1e-12)


@given(BOOM, STICK, RATE, RATE, st.floats(0, 2000))
def test_rates_are_derivatives(
    q_boom: float, q_stick: float, qd_boom: float, qd_stick: float, load: float
) -> None:
    def at(t: float) -> list[float]:
        pose = (q_boom + t * qd_boom, q_stick + t * qd_stick)
        return [*k.arm_tip(*pose, G), k.inertia_z(*pose, load, G) / 1e5]

    h = 1e-4
    numeric = (np.array(at(h)) - np.array(at(-h))) / (2 * h)
    inertia_rate = k.inertia_rate(q_boom, q_stick, qd_boom, qd_stick, load, G) / 1e5
    exact = [*k.arm_tip_rate(q_boom, q_stick, qd_boom, qd_stick, G), inertia_rate]
    np.testing.assert_allclose(exact, numeric, atol=1e-6)


@given(BOOM, STICK, st.floats(0, 2000))
def test_inertia_is_twice_the_kinetic_energy_of_a_unit_turn(
    q_boom: float, q_stick: float, load: float
) -> None:
    """Boom and stick as a thousand point masses each, turning at 1 rad/s."""
    s = (np.arange(1000) + 0.5) / 1000
    boom = G.boom_foot_x + s * G.boom_length * np.cos(q_boom)
    elbow = G.boom_foot_x + G.boom_length * np.cos(q_boom)
    stick = elbow + s * G.stick_length * np.cos(q_boom + q_stick)
    tip, _ = k.arm_tip(q_boom, q_stick, G)
    arm = G.boom_mass * np.mean(boom**2) + G.stick_mass * np.mean(stick**2) + (G.tool_mass + load) * tip**2
    bare = k.inertia_z(q_boom, q_stick, load, G) - arm
    box = G.carriage_mass * ((G.carriage_length**2 + G.carriage_width**2) / 12 + G.carriage_x**2)
    cabin = (G.cabin_length**2 + G.cabin_width**2) / 12 + G.cabin_x**2 + G.cabin_y**2
    assert bare == pytest.approx(box + G.cabin_mass * cabin, rel=1e-4)


@pytest.mark.parametrize(
    ("radius", "boom", "load", "known"),
    [(7.7, (0.8, 1.4), 0, 270e3), (15.9, (0.7, 1.4), 0, 925e3), (15.9, (0.7, 1.4), 2000, 1430e3)],
)
def test_inertia_meets_the_known_figures(
    radius: float, boom: tuple[float, float], load: float, known: float
) -> None:
    """Middle of the poses that have this radius, within 5 %."""
    q_boom, q_stick = np.meshgrid(np.linspace(*boom, 121), np.linspace(-2.1, -0.3, 361), indexing="ij")
    here = np.abs(k.arm_tip(q_boom, q_stick, G)[0] - radius) < 0.02
    inertia = k.inertia_z(q_boom, q_stick, load, G)[here]
    assert len(inertia) > 10
    assert np.median(inertia) == pytest.approx(known, rel=0.05)


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        ((9.0, 0.0, 1.0), "keep-out height"),
        ((1.0, 1.0, 5.0), "keep-out radius"),
        ((25.0, 0.0, 6.0), "beyond the arm"),
        ((7.0, 0.0, 8.0), "needs boom"),
        ((16.5, 0.0, 2.1), "needs boom"),
    ],
)
def test_unreachable_targets_say_why(target: tuple[float, float, float], reason: str) -> None:
    said = k.reachable(*target)
    assert said is not None
    assert said.startswith("target out of reach: ")
    assert reason in said


@given(SLEW, st.floats(9, 11), st.floats(4, 7))
def test_typical_targets_are_reachable(q_slew: float, radius: float, z: float) -> None:
    assert k.reachable(radius * np.cos(q_slew), radius * np.sin(q_slew), z, margin=0.03) is None


def test_margin_shrinks_the_reach() -> None:
    point = k.grab_point(0.0, *k.arm_tip(G.boom_max - 0.01, -1.8, G), G)
    assert k.reachable(*point) is None
    assert k.reachable(*point, margin=0.03) is not None
