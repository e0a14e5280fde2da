"""Every controller of the registry: interface, signs, bounds, mirror symmetry, target reached."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from baselines import registry
from baselines.registry import Controller
from fmus.definition import Model
from fmus.equations import kinematics
from fmus.toolchain.build import build_fmu
from fmus.toolchain.discrete import DiscreteStepper
from fmus.toolchain.loader import load_model
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from specs import parameters, systems
from specs.errors import InputError
from specs.signals import signal
from tests.fmus.importer import Imported
from tests.fmus.models.roll_out import check_reference, feeds_through, unused_parameters

OWN = [c for c in registry.select() if c.folder != "pi"]  # the PI has tests of its own
FOLDERS = sorted({c.folder for c in OWN})
G = kinematics.geometry()
POSE = (1.3, -1.9)
TICKS = 120


def _point(slew: float) -> dict[str, float]:
    x, y, z = kinematics.grab_point(slew, *kinematics.arm_tip(*POSE, G), G)
    return {"target_x": x, "target_y": y, "target_z": z}


def _stimuli(model: Model, tick: int, sign: float = 1.0) -> dict[str, float]:
    """Two targets, a slew that follows slowly, a swinging tool; `sign` -1 is the mirrored motion."""
    t = tick * model.step
    values = {
        **_point(sign * (1.2 if t < 1.5 else 0.4)),
        "load_told": 500.0,
        "pace": 1.0 if t < 2 else 0.7,
        "q_slew": sign * 0.12 * t,
        "qd_slew": sign * 0.12,
        "q_boom": 1.25 + 0.05 * math.sin(t),
        "q_stick": -1.8 + 0.1 * math.sin(2 * t),
        "qd_boom": 0.05 * math.cos(t),
        "qd_stick": 0.2 * math.cos(2 * t),
        "imu_cabin_rate_z": sign * (0.12 + 0.03 * math.sin(2 * t)),
        "imu_tool_roll": sign * 0.1 * math.sin(2.3 * t),
        "imu_tool_rate_x": sign * 0.23 * math.cos(2.3 * t),
        "imu_tool_pitch": 0.05 * math.sin(2.2 * t),
        "imu_tool_rate_y": 0.11 * math.cos(2.2 * t),
        "p_slew_a": (8e6 if sign > 0 else 2e6),
        "p_slew_b": (2e6 if sign > 0 else 8e6),
        "brake_released": 1.0,
    }
    return {v.name: values[v.name] for v in model.inputs}


def _commands(controller: Controller, ticks: int, sign: float = 1.0) -> np.ndarray:
    model = load_model(controller.folder)
    stepper, rows = DiscreteStepper(model, controller.settings), []
    for tick in range(ticks):
        stepper.set(**_stimuli(model, tick, sign))
        stepper.advance()
        rows.append(list(stepper.outputs().values()))
    return np.array(rows)


@pytest.mark.parametrize("controller", OWN, ids=lambda c: c.name)
def test_commands_are_bounded_and_mirrored(controller: Controller) -> None:
    right, left = _commands(controller, TICKS), _commands(controller, TICKS, -1.0)
    assert np.abs(right[:, 0]).max() <= 1.0
    assert np.abs(right[:, 1:]).max() <= parameters.parameter("control_arm_rate_limit").value
    if not controller.human:  # an operator's noise does not turn with the motion
        np.testing.assert_allclose(left[:, 0], -right[:, 0], atol=1e-9)
        np.testing.assert_allclose(left[:, 1:], right[:, 1:], atol=1e-9)
    np.testing.assert_array_equal(_commands(controller, TICKS), right)


@pytest.mark.parametrize("controller", OWN, ids=lambda c: c.name)
@pytest.mark.parametrize("slew", [-1.0, 1.0])
def test_it_turns_towards_the_target_by_more_than_the_dead_band(controller: Controller, slew: float) -> None:
    model = load_model(controller.folder)
    stepper = DiscreteStepper(model, controller.settings)
    still = dict(zip(("q_boom", "q_stick"), POSE, strict=True))
    stepper.set(**_point(slew), **still, pace=1.0)
    stepper.advance(100)
    command = stepper.outputs()["u_slew"]
    assert math.copysign(1.0, slew) * command > parameters.parameter("slew_dead_band").value


@pytest.mark.parametrize("controller", OWN, ids=lambda c: c.name)
def test_a_slower_pace_asks_for_less(controller: Controller) -> None:
    effort = []
    for pace in (0.4, 1.0):
        stepper = DiscreteStepper(load_model(controller.folder), controller.settings)
        stepper.set(**_point(1.5), **dict(zip(("q_boom", "q_stick"), POSE, strict=True)), pace=pace)
        stepper.advance(100)
        effort.append(stepper.outputs()["u_slew"])
    assert 0 < effort[0] < 0.95 * effort[1]


@pytest.mark.parametrize("folder", FOLDERS)
def test_interface(folder: str) -> None:
    model = load_model(folder)
    needed_in, needed_out = systems.load("nominal").connectors(registry.SLOT)
    assert set(needed_in) <= {v.name for v in model.inputs}
    assert [v.name for v in model.outputs] == ["u_slew", "qd_boom_ref", "qd_stick_ref"]
    assert set(needed_out) == {v.name for v in model.outputs}
    assert {signal(v.name).kind for v in model.inputs} <= {"target", "sensor"}
    for v in (*model.inputs, *model.outputs):
        assert (v.vr, v.unit) == (signal(v.name).vr, signal(v.name).unit)
    assert model.step == 1.0 / registry.RATE_HZ
    assert feeds_through(model) == []
    assert unused_parameters(model) == []


# An optimisation amplifies the last digits of a sine: the predictive controller has a test of its own.
@pytest.mark.parametrize("folder", [f for f in FOLDERS if f != "nmpc"])
def test_the_fmu_computes_what_the_equations_say(folder: str) -> None:
    model = load_model(folder)
    stepper, names = DiscreteStepper(model), [v.name for v in model.outputs]
    with Imported(build_fmu(folder, 2), None, **_stimuli(model, 0)) as fmu:
        for tick in range(300):
            stepper.set(**_stimuli(model, tick))
            fmu.set(**_stimuli(model, tick))
            stepper.advance()
            fmu.step()
            expected = stepper.outputs()
            np.testing.assert_allclose(fmu.get(*names), [expected[n] for n in names], atol=1e-9)


@pytest.mark.parametrize("folder", FOLDERS)
def test_reference_roll_out(folder: str) -> None:
    model = load_model(folder)
    check_reference(model, f"baselines/{folder}", lambda tick: _stimuli(model, tick), 400)


@pytest.mark.parametrize("controller", registry.select(), ids=lambda c: c.name)
def test_settings_and_tuned_gains_are_parameters_of_the_model(controller: Controller) -> None:
    known = {v.name for v in load_model(controller.folder).parameters}
    own = parameters.load(controller.gains)
    assert set(controller.settings) <= known
    for gain in controller.tuned:
        assert gain.low < gain.high
        for value in (gain.low, gain.high):
            own[gain.name].check(value)


@cache
def _system(folder: str, name: str, tmp: str) -> System:
    controller = next(c for c in registry.select() if c.folder == folder)
    return load_system(pack_system(name, out=Path(tmp), models=controller.models))


@pytest.mark.parametrize("controller", OWN, ids=lambda c: c.name)
def test_it_reaches_its_target_on_the_nominal_system(
    controller: Controller, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """75 degrees in 15 s, as FMU in the loop: within the band of the metrics, and there to stay."""
    folder = tmp_path_factory.getbasetemp() / f"controllers-{controller.folder}"
    system = _system(controller.folder, "nominal", str(folder))
    slew = math.radians(75.0)
    start = {"slew.start_q_slew": 0.0}
    start |= {
        f"{c}.start_q_{j}": q for c in ("arm", "tool") for j, q in zip(("boom", "stick"), POSE, strict=True)
    }
    stimuli = Stimuli({0: {**_point(slew), "pace": 1.0, "load_told": 0.0}})
    record = simulate(system, 750, stimuli, start | controller.parameters, record=["q_slew", "radius"])
    angle = np.degrees(record.column("q_slew"))
    assert abs(angle[-50:] - 75.0).max() < (6.0 if controller.human else 3.0)
    assert angle.max() < 85.0
    radius = record.column("radius")
    assert abs(radius[-1] - radius[0]) < 0.05


def test_an_unknown_controller_is_named_with_the_valid_ones() -> None:
    with pytest.raises(InputError, match=r"no controller 'parabel'.*parabola"):
        registry.find("parabel")
