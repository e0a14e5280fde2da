"""The plain-Python step and the FMU's C code are the same step."""

import numpy as np
import pytest

from fmus.models.arm.model import MODEL as DISCRETE
from fmus.models.machine.model import MODEL as MACHINE
from fmus.models.slew.model import MODEL as SLEW
from fmus.toolchain.build import build_fmu
from fmus.toolchain.stepper import Stepper
from specs.errors import InputError, RunError
from tests.fmus.importer import Imported

RUNS = {
    "machine": (MACHINE, {"u_slew": 0.8, "u_boom": -0.6, "u_stick": 0.7}),
    "slew": (SLEW, {"u_slew": 0.8, "inertia": 4e5, "inertia_rate": 0.0}),
}


@pytest.mark.parametrize("name", RUNS)
def test_agrees_with_the_fmu(name: str) -> None:
    """Three seconds on and off: delays, brake and every output that is not a noisy sensor."""
    model, moving = RUNS[name]
    stopped = moving | {n: 0.0 for n in moving if n.startswith("u_")}
    stepper, plain = Stepper(model), [v for v in model.outputs if v.name not in model.sensors]
    stepper.set(**stopped)
    with Imported(build_fmu(name, 2), 0 if model.sensors else None, **stopped) as fmu:
        for k in range(150):
            inputs = stopped if k < 5 or k > 100 else moving
            stepper.set(**inputs)
            fmu.set(**inputs)
            stepper.advance(round(0.02 / model.step))
            fmu.step()
            ours, theirs = stepper.outputs(), fmu.get(*(v.name for v in plain))
            for variable, value in zip(plain, theirs, strict=True):
                scale = max(abs(value), variable.nominal or 1.0)
                assert abs(ours[variable.name] - value) < 1e-10 * scale, (variable.name, k)


def test_unknown_names_and_discrete_models_are_refused() -> None:
    with pytest.raises(InputError, match="no input 'u_swing'"):
        Stepper(SLEW).set(u_swing=1.0)
    with pytest.raises(InputError, match="discrete"):
        Stepper(DISCRETE)


def test_says_which_state_is_lost() -> None:
    stepper = Stepper(SLEW)
    stepper.set(inertia=float("nan"), inertia_rate=0.0)
    with pytest.raises(RunError, match=r"state \w+ is not finite"):
        stepper.advance(3)


def test_measured_is_late_by_the_sensors_delay() -> None:
    stepper = Stepper(MACHINE, step=0.002)
    run = stepper.run({"u_slew": 1.0}, 1.0)
    late = stepper.measured(run, "qd_slew")
    np.testing.assert_array_equal(late[10:], run["qd_slew"][:-10])
