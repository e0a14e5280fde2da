"""The models' FMU variables are the signals of signals.toml, on the right side of the wire."""

import pytest

from baselines.arm_velocity.model import MODEL as ARM_VELOCITY
from baselines.pi.model import MODEL as PI
from fmus.definition import Model
from fmus.models.arm.model import MODEL as ARM
from fmus.models.machine.model import MODEL as MACHINE
from fmus.models.slew.model import MODEL as SLEW
from fmus.models.tool.model import MODEL as TOOL
from specs import draws, scenario
from specs.signals import signal

MODELS = {m.name: m for m in (MACHINE, SLEW, ARM, TOOL, PI, ARM_VELOCITY)}


@pytest.mark.parametrize("name", MODELS)
def test_inputs_and_outputs_are_signals(name: str) -> None:
    model: Model = MODELS[name]
    for v in (*model.inputs, *model.outputs):
        s = signal(v.name)
        assert (v.vr, v.unit, v.min, v.max) == (s.vr, s.unit, s.min, s.max), v.name


def test_causality_of_the_machine() -> None:
    assert {signal(v.name).causality("machine") for v in MACHINE.inputs} == {"input"}
    assert {signal(v.name).causality("machine") for v in MACHINE.outputs} == {"output"}


def test_controllers_see_no_true_state_and_no_disturbance() -> None:
    for controller in (PI, ARM_VELOCITY):
        kinds = {signal(v.name).kind for v in controller.inputs}
        assert kinds <= {"target", "sensor", "status", "estimate", "command"}, controller.name


def test_every_sensor_but_the_brake_switch_has_noise() -> None:
    sensors = {v.name for v in MACHINE.outputs if signal(v.name).kind == "sensor"}
    assert set(MACHINE.sensors) == sensors
    assert {n for n, s in MACHINE.sensors.items() if s.noise is None} == {"brake_released"}


def test_draws_and_scenarios_set_parameters_that_the_machine_has() -> None:
    known = {v.name for v in MACHINE.parameters}
    assert set(draws.spreads()) <= known
    assert set(scenario.load("four_targets_unknown").parameters(seed=0)) <= known
