"""Loop gains: sines found in signals, margins of known loops, a controller on recorded sensors."""

import json
import math

import numpy as np
import pytest

from baselines.margins.loop import FREQUENCIES_HZ, Loop, share
from fmus.toolchain.build import build_fmu
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from specs.scenario import TICK_S
from tests.conftest import Command
from verification.evaluation.policies import SHIPPED
from verification.plants import loop_gain, plant as plants, study
from verification.plants.loop_gain import RUN_S
from verification.plants.trial import Trial
from verification.runs import plant_parameters

OMEGA = 2 * np.pi * np.array(FREQUENCIES_HZ)


def delayed(gain: float, late_s: float) -> Loop:
    """An integrator behind a delay, fed back: it is on its limit at a frequency of 1 / (4 late)."""
    return Loop(-gain / (1j * OMEGA) * np.exp(-1j * OMEGA * late_s))


@pytest.mark.parametrize("frequency", [0.3, 1.0, 3.0])
def test_a_sine_is_found_beside_offset_drift_and_another_one(frequency):
    t = np.arange(round(RUN_S / TICK_S) + 1) * TICK_S
    u = 0.7 * np.sin(2 * np.pi * frequency * t + 0.4) + 3.0 - 0.5 * t + 0.3 * np.sin(2 * np.pi * 0.55 * t)
    found = share(u, frequency)
    assert abs(found) == pytest.approx(0.7, rel=0.02)
    assert np.angle(found) == pytest.approx(0.4 - np.pi / 2, abs=0.02)


@pytest.mark.parametrize("late", [0.1, 0.25, 0.6])
def test_margins_of_an_integrator_with_a_delay(late):
    critical = np.pi / 2 / late  # gain at which it swings by itself
    loop = delayed(0.5 * critical, late)
    assert loop.in_phase is not None
    assert loop.in_phase[0] == pytest.approx(1 / (4 * late), rel=0.02)
    assert loop.gain_margin == pytest.approx(2.0, rel=0.02)
    assert not loop.swings
    assert delayed(1.05 * critical, late).swings


def test_a_controller_that_does_not_answer_has_every_margin():
    still = Loop(np.zeros(len(FREQUENCIES_HZ), complex))
    assert math.isinf(still.delay_margin_s)
    assert still.gain_margin > 1e6
    assert not still.swings


def test_margin_of_delay():
    loop = delayed(4.0, 0.1)  # crosses 1 at 4 rad/s
    margin = np.pi / 2 / 4.0 - 0.1
    assert loop.delay_margin_s == pytest.approx(margin, rel=0.1)
    assert not delayed(4.0, 0.1 + 0.8 * margin).swings
    assert delayed(4.0, 0.1 + 1.2 * margin).swings
    assert delayed(4.0, 0.1 + 1.2 * margin).delay_margin_s == 0.0
    assert math.isinf(delayed(0.5, 0.1).delay_margin_s)


def test_a_controller_answers_recorded_sensors_as_it_did_in_the_system():
    nominal, (c,) = plants.find("nominal"), study.find_controllers(["pd"])
    scenario = next(iter(Trial(targets=1, load="empty").scenarios()))[1]
    system = load_system(nominal.pack(c.models, c.name))
    values = plant_parameters(system, nominal.system, scenario.parameters(1)) | c.parameters
    record = simulate(system, 300, Stimuli(scenario.stimuli()), values, seed=1)
    alone = load_system(build_fmu(c.path, 2), TICK_S)
    found = loop_gain.answer(alone, c, nominal, record, scenario.stimuli()[0])
    np.testing.assert_array_equal(found, record.column("u_slew"))
    assert np.ptp(found) > 0.1


@pytest.mark.long
def test_the_command_says_who_swings_where(slewright_here: Command, tmp_path):
    policy = SHIPPED.parent / "ppo.onnx"
    done = slewright_here("analyse", "pd", policy, "--plant", "nominal", "--json", tmp_path / "f.json")
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "f.json").read_text())["loops"]
    assert found["pd"]["nominal"]["gain_margin"] > 1.0
    assert found["ppo"]["nominal"]["fastest"]["gain"] < 1.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("pd", "--plant", "moon"), "no plant 'moon'"),
        (("pd", "nmpc"), "need --plant"),
        (("pd", "--plant", "nominal", "--gain", "a=1"), "--plant excludes --gain"),
        (("learning/policies/full.onnx",), "--plant PLANT measures it"),
    ],
)
def test_bad_input(slewright_here: Command, words, said):
    done = slewright_here("analyse", *words)
    assert done.returncode == 2
    assert said in done.stderr
