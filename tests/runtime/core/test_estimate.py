"""The load estimate in the core: there while its sensors are, in every mode, and about right."""

import numpy as np
import pytest

from baselines.load.online import model
from deployment.hil.lockstep import lockstep
from fmus.toolchain.discrete import DiscreteStepper
from runtime.image import OUTPUT, Status
from specs import scenario
from tests.runtime.bench import MANUAL, Bench
from tests.runtime.bundles import core

STILL_KG = (
    150.0  # docs/explanation/load-estimate.md: without calibration, at rest, 95 % of errors are below 168 kg
)
PLACE = OUTPUT.at("load_estimate")


def status(bench: Bench) -> int:
    return int(bench.seen[-1]["status"][PLACE])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_targets_empty", "four_targets_2t"])
def test_it_finds_the_load_of_the_reference_machine(name: str) -> None:
    """On the nominal machine, which it was written for; what the machine hangs on it after 14 s of work."""
    chosen = scenario.load(name)
    known: list[bool] = []
    found = lockstep(core(), chosen, 1, 740, look=lambda _, out, k: known.append(not out["status"][PLACE]))
    assert not known[0]
    assert known[-1]
    assert abs(found.column("load_estimate")[-1] - chosen.true_load(1)) < STILL_KG


@pytest.mark.slow
def test_the_core_computes_what_the_model_says() -> None:
    """Bit for bit but for the last places of libm, which the stepper uses and the core does not."""
    found = lockstep(core(), scenario.load("four_targets_2t"), 2, 450)
    stepper, told = DiscreteStepper(model()), []
    for k in range(451):
        stepper.set(**{v.name: float(found.column(v.name)[k]) for v in model().inputs})
        stepper.advance()
        told.append(stepper.state("load"))
    ours = found.column("load_estimate")
    late = np.array(told)[-1]
    assert late > 1500.0
    assert abs(ours[-1] - late) < 5.0  # the core has seen four ticks more: those before tick 0


def test_without_its_sensors_it_is_not_available_and_it_comes_back() -> None:
    bench = Bench(core()).set(p_boom_a=2e7, p_boom_b=2e6, p_stick_a=1e7, p_stick_b=5e6)
    bench.set(imu_tool_pitch=0.001, imu_tool_roll=0.001).manual()
    assert (bench.mode, status(bench)) == (MANUAL, Status.NOT_AVAILABLE)
    assert bench.out("load_estimate") == 0.0
    bench.silent.clear()
    for name in ("imu_tool_pitch", "imu_tool_roll"):
        del bench.values[name]  # they are noisy again
    assert status(bench.tick(100)) == Status.OK
    bench.status["p_boom_a"] = Status.TIMEOUT
    assert status(bench.tick()) == Status.NOT_AVAILABLE
    bench.status.clear()
    assert status(bench.tick(20)) == Status.NOT_AVAILABLE  # it starts anew
    assert status(bench.tick(100)) == Status.OK
