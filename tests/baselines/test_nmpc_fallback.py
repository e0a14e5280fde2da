"""The predictive controller when its solver does not converge: a safe plan of now, counted and reported."""

from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from baselines import registry
from baselines.nmpc import cost, model as nmpc, prediction, solver
from fmus.equations import slew_control as control
from fmus.toolchain.discrete import DiscreteStepper
from fmus.toolchain.loader import load_model
from orchestrator.system.pack import pack_system
from tests.baselines.test_nmpc import POSE, _inputs
from verification.campaign import worker
from verification.comparison.figures import figures
from verification.comparison.plan import Question, make_plan

NEVER, ALWAYS = -1.0, 10.0  # tolerances that no plan and every plan meets
LEAST = 1e-6  # the smallest that the controller takes
CHANNELS = ("slew_command", "boom_reference", "stick_reference")
LOW = 0.9  # rad, boom: far from its target, so that a plan moves the arm


def _stepper() -> DiscreteStepper:
    stepper = DiscreteStepper(load_model("nmpc"))
    _tolerate(stepper, ALWAYS)
    return stepper


def _tolerate(stepper: DiscreteStepper, value: float) -> None:
    stepper.p[stepper.model.index("parameters", "nmpc_tolerance")] = value


def _at(tick: int, away: float = 80.0) -> dict[str, float]:
    """Sensors of a slew that turns at 0.2 rad/s, the boom far off."""
    return _inputs(away, q_boom=LOW, q_slew=0.2 * 0.02 * tick, imu_cabin_rate_z=0.2)


def _advance(stepper: DiscreteStepper, ticks: int, away: float = 80.0) -> None:
    for _ in range(ticks):
        stepper.set(**_at(stepper.tick, away))
        stepper.advance()


def _commands(stepper: DiscreteStepper) -> list[float]:
    return [stepper.state(name) for name in CHANNELS]


def _fallback_of_now(stepper: DiscreteStepper) -> float:
    """Opening of the braking parabola at the state that the next tick's sensors predict."""
    groups = {"states": stepper.x, "inputs": stepper.u, "parameters": stepper.p}
    x, u, p = (
        SimpleNamespace(**{v.name: float(a) for v, a in zip(getattr(stepper.model, g), values, strict=True)})
        for g, values in groups.items()
    )
    speed, _, _ = control.observed(x.angle, x.bias, u, p)
    sent = ca.vertcat(*(getattr(x, f"{c}_{i}") for c in nmpc.CHANNELS for i in range(nmpc.WAY)))
    ahead = nmpc._ahead(nmpc._state(x, u, speed, p), sent, nmpc._load(x, u, p))
    return float(ca.DM(nmpc._fallback(ahead)[0]))


def test_good_then_bad_then_good_again() -> None:
    """The fallback takes over in the tick of the solve, is made anew each time, ends with the next plan."""
    stepper = _stepper()
    _advance(stepper, 2 * nmpc.PERIOD)
    planned = _commands(stepper)
    assert stepper.state("fallbacks") == 0.0
    assert planned[1] > 0.0
    _tolerate(stepper, NEVER)
    seen = []
    for solve in range(1, 4):
        stepper.set(**_at(stepper.tick))
        expected = _fallback_of_now(stepper)
        stepper.advance()
        assert stepper.state("fallbacks") == solve
        assert _commands(stepper)[1:] == [0.0, 0.0]  # the arm rests at once
        assert stepper.state(f"opening_{nmpc.WAY - 1}") == pytest.approx(expected, rel=1e-9)
        seen.append(expected)
        _advance(stepper, nmpc.PERIOD - 1)
    assert len(set(seen)) == 3  # of three different moments
    assert planned[0] not in seen
    assert stepper.state("solves") == 5.0
    _tolerate(stepper, ALWAYS)
    _advance(stepper, 1)
    assert stepper.state("fallbacks") == 3.0
    assert stepper.state("boom_reference") > 0.0


def test_no_command_outlives_its_period() -> None:
    """Two machines with the same past, one nearer to its target when the solver fails: other commands."""
    near, far = _stepper(), _stepper()
    for stepper in (near, far):
        _advance(stepper, nmpc.PERIOD)
        _tolerate(stepper, NEVER)
    assert _commands(near) == _commands(far)
    for stepper, degrees in ((near, 4.0), (far, 80.0)):
        _advance(stepper, 1, degrees)
    assert near.state("slew_command") < 0 < far.state("slew_command")  # the one brakes, the other goes on


def test_numbers_that_are_none_count_as_not_converged_and_spoil_no_plan() -> None:
    """A predicted state that is not a number: the fallback is on, the plan stays one to begin with."""
    now = prediction.rest(*POSE)
    now[prediction.STATES.index("roll")] = np.nan
    plan = np.full(solver.SIZE, 0.1)
    values = {"boom": POSE[0], "stick": POSE[1], "speed_limit": 0.5, "huber": 0.05, "arm_huber": 0.1}
    task = [values.get(name, 1.0) for name in cost.TASK]
    sent = np.zeros(len(nmpc.CHANNELS) * nmpc.WAY)
    _, kept, failed = nmpc._planned()(1, now, sent, plan, task, ALWAYS)
    assert float(failed) == 1.0
    np.testing.assert_array_equal(np.array(kept).ravel(), np.array(ca.DM(solver.shifted(plan))).ravel())


def test_the_fallback_alone_reaches_the_target_and_is_reported(tmp_path: Path) -> None:
    """No solve converges on the way: the nominal slew arrives all the same, and the comparison says so."""
    controller = registry.find("nmpc")
    question = Question([controller], tasks=["slew"], loads=["empty"], machines=1)
    run = next(r for r in make_plan(question).runs if r.spec["system"] == "nominal")
    ssp = pack_system("nominal", out=tmp_path, models=controller.models)
    spec = {**run.spec, "stop_s": 15.0, "parameters": {f"{registry.SLOT}.nmpc_tolerance": LEAST}}
    result = worker.work([{"key": run.key, "digest": "", "spec": spec, "ssp": str(ssp)}])[0]
    found = result["figures"]
    assert found["solves"] == 150
    assert 50 < found["fallbacks"] < 150  # at the target there is nothing left to gain
    assert found["missed"] == 0
    assert found["overshoot"] < 3.0
    assert found["slew_error"] < 1.0
    cell = figures(question, [run], {run.key: result})["single"]["nominal"]["slew"]["nmpc"]["empty"]
    assert (cell["solves"], cell["fallbacks"]) == (150, found["fallbacks"])
