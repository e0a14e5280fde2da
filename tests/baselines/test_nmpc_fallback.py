"""The predictive controller when its solver does not converge: a safe plan of now, counted and reported."""

from pathlib import Path

import casadi as ca
import numpy as np

from baselines import registry
from baselines.nmpc import model as nmpc, solver
from fmus.toolchain.discrete import DiscreteStepper
from fmus.toolchain.loader import load_model
from orchestrator.system.pack import pack_system
from tests.baselines.test_nmpc import inputs
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
    return inputs(away, q_boom=LOW, q_slew=0.2 * 0.02 * tick, imu_cabin_rate_z=0.2)


def _advance(stepper: DiscreteStepper, ticks: int, away: float = 80.0) -> None:
    for _ in range(ticks):
        stepper.set(**_at(stepper.tick, away))
        stepper.advance()


def _commands(stepper: DiscreteStepper) -> list[float]:
    return [stepper.state(name) for name in CHANNELS]


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
        _advance(stepper, 1)
        assert stepper.state("fallbacks") == solve
        assert _commands(stepper)[1:] == [0.0, 0.0]  # the arm rests at once
        seen.append(stepper.state(f"opening_{nmpc.WAY - 1}"))
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
    """A sensor gives no number in the tick of a solve: the fallback is on, the next plan begins sound."""
    stepper = _stepper()
    _advance(stepper, nmpc.PERIOD)
    names = [f"plan_{i:02d}" for i in range(solver.SIZE)]
    last = np.array([stepper.state(name) for name in names])
    stepper.set(**{**_at(stepper.tick), "imu_tool_roll": np.nan})
    stepper.advance()
    assert stepper.state("fallbacks") == 1.0
    assert np.isfinite(_commands(stepper)).all()
    kept = [stepper.state(name) for name in names]
    np.testing.assert_array_equal(kept, np.array(ca.DM(solver.shifted(last))).ravel())


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
