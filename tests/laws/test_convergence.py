"""Smaller steps, smaller errors, with the order of the method."""

import dataclasses
import math
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from fmus.models.machine.model import MODEL as MACHINE
from fmus.models.slew.model import MODEL as SLEW
from fmus.toolchain.stepper import Stepper
from orchestrator.run.simulate import simulate
from tests.fmus.models.machine_runs import start
from tests.fmus.models.test_slew import running
from tests.orchestrator.run.test_rollback import error
from tests.orchestrator.systems import chain, load

LONGEST_DELAY_S = 0.2  # of a valve: the slew's is 0.172 s


@pytest.mark.parametrize(("algorithm", "order"), [("jacobi", 1.0), ("iterate", 2.0)])
def test_algorithms_that_take_steps_back_converge_with_their_order(
    tmp_path: Path, algorithm: str, order: float
) -> None:
    errors = [error(tmp_path, 2.0**-k, algorithm, tolerance=1e-12)[0] for k in (4, 5, 6, 7)]
    observed = [math.log2(a / b) for a, b in pairwise(errors)]
    assert observed == pytest.approx([order] * 3, abs=0.07)


@pytest.mark.parametrize(("algorithm", "sign"), [("jacobi", 1.0), ("gauss-seidel", -1.0)])
def test_algorithms_that_never_take_steps_back_are_of_order_one(
    tmp_path: Path, algorithm: str, sign: float
) -> None:
    """x' = exp(-t), x(0) = 1: held input from the start of a step (Jacobi) or from its end (Gauss-Seidel)."""
    errors = []
    for step_ms in (40, 20, 10):
        text = chain().replace('stepSize="0.01"', f'stepSize="{step_ms / 1000}"')
        record = simulate(load(tmp_path, text, ["decay", "position"]), 2000 // step_ms, algorithm=algorithm)
        errors.append(record.column("place")[-1] - (2.0 - math.exp(-2.0)))
    assert all(math.copysign(1.0, e) == sign for e in errors)
    orders = [math.log2(a / b) for a, b in pairwise(errors)]
    assert orders == pytest.approx([1.0, 1.0], abs=0.03)


@pytest.mark.parametrize("serves", [1, MACHINE.serves, 1000], ids=["every step", "as shipped", "for good"])
def test_the_machine_is_of_order_two_on_a_smooth_stretch(serves: int) -> None:
    """A quarter of a second in motion, held joysticks: halving the step quarters the error, whatever J."""
    model = dataclasses.replace(MACHINE, serves=serves)
    machine = Stepper(model, start(1.0, -1.3), step=1e-3)
    held = {"u_slew": 0.6, "u_boom": 0.5, "u_stick": -0.5}
    machine.set(**held)
    machine.advance(1500)
    results = {h: _continue(machine, h, held) for h in (2e-3, 1e-3, 5e-4, 3.125e-5)}
    exact = results.pop(3.125e-5)
    scale = np.array([v.nominal or 1.0 for v in MACHINE.states])
    errors = [np.linalg.norm((r - exact) / scale) for r in results.values()]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 1.8), orders
    assert errors[1] < 1e-5


def _continue(machine: Stepper, step: float, held: Mapping[str, float]) -> np.ndarray:
    other = Stepper(machine.model, None, step)
    other.p, other.x, other.m = machine.p, machine.x.copy(), machine.m.copy()
    other.set(**held)
    other.advance(round(LONGEST_DELAY_S / step))  # what is held has come through every delay
    other.x, other.m = machine.x.copy(), machine.m.copy()
    other.advance(round(0.25 / step))
    return other.x


def test_halving_the_step_hardly_moves_a_slew():
    def run(step: float) -> dict[str, np.ndarray]:
        drive = running(step=step)
        return drive.run(lambda t: {"u_slew": 1.0 if t < 2.5 else -0.6 if t < 5 else 0.0}, 6.0, every=0.1)

    whole, half = run(SLEW.step), run(SLEW.step / 2)
    assert np.degrees(np.abs(whole["qd_slew"] - half["qd_slew"]).max()) < 0.02
    assert np.abs(whole["p_slew_a"] - half["p_slew_a"]).max() < 2e5
