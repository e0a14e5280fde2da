"""The machine's multibody equations against independent forms: I_z, Lagrange by differentiation, energy."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from fmus.equations import kinematics, multibody
from fmus.models.machine.model import MODEL

P = SimpleNamespace(**{v.name: v.start for v in MODEL.parameters})
Q, V = ca.SX.sym("q", 5), ca.SX.sym("v", 5)


def functions(**overrides: float) -> SimpleNamespace:
    """CasADi functions of (q, v): M, c without and with gravity, kinetic and potential energy."""
    p = SimpleNamespace(**vars(P) | overrides)
    motion = multibody.motion(ca.vertsplit(Q), ca.vertsplit(V), p)
    gravity = multibody.gravity_in_s(Q[0], p)
    mass, c = multibody.equations_of_motion(motion, gravity)
    kinetic, potential = multibody.energy(motion, gravity)
    acceleration = multibody.solve(mass, -c)
    results = {
        "mass": mass, "c": c, "kinetic": kinetic, "potential": potential,
        "acceleration": acceleration, "grab": motion.grab,
    }  # fmt: skip
    return SimpleNamespace(**{n: ca.Function(n, [Q, V], [r]) for n, r in results.items()})


@pytest.fixture(scope="module")
def sloping() -> SimpleNamespace:
    return functions(slope_pitch=0.05, slope_roll=-0.03, load_mass=800.0)


def states(count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(1)
    low, high = [-3, 0.6, -2.4, -0.8, -0.8], [3, 1.5, -0.15, 0.8, 0.8]
    return [(rng.uniform(low, high), rng.normal(0, 0.5, 5)) for _ in range(count)]


@pytest.mark.parametrize("load", [0.0, 700.0, 2000.0])
def test_slew_row_is_the_inertia_of_kinematics(load: float) -> None:
    mass = functions(load_mass=load).mass
    for q_boom, q_stick in ((0.8, -0.3), (1.1, -1.2), (1.4, -2.1), (1.2, -1.7)):
        found = float(mass([0.4, q_boom, q_stick, 0, 0], [0] * 5)[0, 0])
        assert found == pytest.approx(kinematics.inertia_z(q_boom, q_stick, load, P), rel=1e-12)


def test_equations_are_lagranges(sloping: SimpleNamespace) -> None:
    """c = M' v - dT/dq + dU/dq, formed by differentiating the energies."""
    mass, kinetic, potential = sloping.mass(Q, V), sloping.kinetic(Q, V), sloping.potential(Q, V)
    momentum = ca.gradient(kinetic, V)
    lagrange = ca.jtimes(momentum, Q, V) - ca.gradient(kinetic - potential, Q)
    check = ca.Function("check", [Q, V], [lagrange, ca.hessian(kinetic, V)[0] - mass])
    for q, v in states(20):
        expected, difference = (np.array(r) for r in check(q, v))
        c = np.array(sloping.c(q, v))
        np.testing.assert_allclose(c, expected, rtol=1e-9, atol=1e-6)
        assert np.abs(difference).max() < 1e-6


def test_a_tool_on_a_suspension_that_moves_so_swings_as_on_the_whole_machine(
    sloping: SimpleNamespace,
) -> None:
    p = SimpleNamespace(**vars(P) | {"slope_pitch": 0.05, "slope_roll": -0.03, "load_mass": 800.0})
    motion = multibody.motion(ca.vertsplit(Q), ca.vertsplit(V), p)
    moved = ca.SX.sym("moved", 3)
    found = multibody.tool_swing(motion, multibody.gravity_in_s(Q[0], p), moved)
    swing = ca.Function("swing", [Q, V, moved], [found])
    for q, v in states(20):
        whole = np.array(sloping.acceleration(q, v)).ravel()
        np.testing.assert_allclose(np.array(swing(q, v, whole[:3])).ravel(), whole[3:], rtol=1e-9, atol=1e-9)


def test_mass_matrix_is_positive_definite_and_solved(sloping: SimpleNamespace) -> None:
    for q, v in states(20):
        mass, c = np.array(sloping.mass(q, v)), np.array(sloping.c(q, v)).ravel()
        assert np.linalg.eigvalsh(mass).min() > 0
        found = np.array(sloping.acceleration(q, v)).ravel()
        np.testing.assert_allclose(found, np.linalg.solve(mass, -c), rtol=1e-9, atol=1e-10)


def test_free_motion_keeps_its_energy(sloping: SimpleNamespace) -> None:
    """Half a second of falling, swinging and turning without any torque, by Runge-Kutta of order 4."""
    q, v = states(1)[0]
    y, h = np.concatenate([q, v]), 1e-3

    def f(y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[5:], np.array(sloping.acceleration(y[:5], y[5:])).ravel()])

    def energy(y: np.ndarray) -> float:
        return float(sloping.kinetic(y[:5], y[5:])) + float(sloping.potential(y[:5], y[5:]))

    start = energy(y)
    for _ in range(500):
        k1 = f(y)
        k2 = f(y + h / 2 * k1)
        k3 = f(y + h / 2 * k2)
        k4 = f(y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    assert np.abs(y[:5] - q).max() > 0.1  # it did move
    assert energy(y) == pytest.approx(start, abs=1e-3)


def test_tool_hangs_along_gravity_on_a_slope(sloping: SimpleNamespace) -> None:
    p = SimpleNamespace(**vars(P) | {"slope_pitch": 0.05, "slope_roll": -0.03})
    pitch, roll = multibody.hanging(ca.DM(multibody.gravity_in_s(0.7, p)))
    c = np.array(sloping.c([0.7, 1.1, -1.5, float(pitch), float(roll)], [0] * 5)).ravel()
    assert abs(pitch) > 0.02
    np.testing.assert_allclose(c[3:], 0, atol=1e-9)


def test_grab_point_follows_the_sign_convention() -> None:
    """Positive pitch swings the tool towards the machine, positive roll to the left."""
    grab = functions().grab
    rest, pitched, rolled = (
        np.array(grab([0, 1.1, -1.5, *angles], [0] * 5)).ravel() for angles in ((0, 0), (0.1, 0), (0, 0.1))
    )
    radius, height = kinematics.arm_tip(1.1, -1.5, P)
    np.testing.assert_allclose(rest, [radius, 0, height - P.tool_length], atol=1e-12)
    assert pitched[0] == pytest.approx(radius - P.tool_length * np.sin(0.1), abs=1e-12)
    assert rolled[1] == pytest.approx((P.tool_length - P.grab_offset) * np.sin(0.1), abs=1e-12)
