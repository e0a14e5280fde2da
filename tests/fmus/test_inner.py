"""The code of an internal step computes what the equations say: constants, rates, factors."""

import casadi as ca
import numpy as np
import pytest

from fmus.constants import split
from fmus.definition import Model
from fmus.factors import GAMMA, factorised
from fmus.models.machine.model import MODEL as MACHINE
from fmus.models.slew.model import MODEL as SLEW


@pytest.mark.parametrize("model", [MACHINE, SLEW], ids=lambda m: m.name)
def test_rates_and_solution_are_those_of_the_equations(model: Model) -> None:
    random = np.random.default_rng(3)
    p = model.start_parameters()
    u, m = np.array([v.start for v in model.inputs]), np.ones(len(model.modes))
    scale = np.array([v.nominal or 1.0 for v in model.states])
    x = np.array(model.x0(p)).ravel() + 0.05 * scale * random.random(len(scale))
    constants, f, factors, solve = model.inner
    q = constants(p)
    rates = np.array(model.f(x, u, m, p)).ravel()
    assert np.array(f(x, u, m, q)).ravel() == pytest.approx(rates, rel=1e-10)
    also, stored = factors(x, u, m, q)
    assert np.array_equal(np.array(also), np.array(f(x, u, m, q)))
    matrix = np.eye(len(x)) - GAMMA * model.step * np.array(model.jacobian(x, u, m, p))
    back = matrix @ np.array(solve(stored, rates)).ravel()
    assert back / scale == pytest.approx(rates / scale, rel=1e-8, abs=1e-8 * np.abs(rates / scale).max())


def test_what_only_parameters_decide_is_computed_apart() -> None:
    x, u, m, p = (ca.SX.sym(n) for n in "xump")
    function = ca.Function("f", [x, u, m, p], [ca.sin(p) * x / p + ca.cos(x) / (u + 2) + m / (u + 2)])
    constants, given, results = split(function)
    rest = ca.Function("rest", given, results)
    assert constants.n_out() == 1
    operations = [rest.instruction_id(k) for k in range(rest.n_instructions())]
    assert ca.OP_SIN not in operations
    assert operations.count(ca.OP_DIV) + operations.count(ca.OP_INV) == 1
    point = (0.3, 0.7, 1.0, 1.9)
    assert float(rest(*point[:3], constants(point[3]))) == pytest.approx(float(function(*point)), rel=1e-14)


def test_zeros_are_left_out_of_the_factors() -> None:
    """An arrow: the full row and column come last, and nothing fills in."""
    arrow = ca.Sparsity.diag(6) + ca.Sparsity.triplet(6, 6, [0] * 5, [*range(1, 6)])
    pattern = arrow + arrow.T
    factorise, solve = factorised(pattern, 0.01)
    entries = np.linspace(-3.0, 2.0, pattern.nnz())
    assert factorise.size1_out(0) == pattern.nnz()
    matrix = np.eye(6) - GAMMA * 0.01 * np.array(ca.DM(pattern, entries))
    b = np.arange(6.0)
    assert np.array(solve(factorise(entries), b)).ravel() == pytest.approx(np.linalg.solve(matrix, b))
