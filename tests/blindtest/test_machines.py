"""Arm, tool, slew and the whole machine: without effects they are the plain models, with them as stated."""

from dataclasses import replace

import numpy as np
import pytest

from blindtest.effects.effect import Scale
from blindtest.systems import machine
from blindtest.systems.kit import KITS
from blindtest.systems.system import STEP, Drive
from fmus.equations import kinematics
from fmus.models.arm.model import MODEL as ARM
from fmus.models.slew.model import MODEL as SLEW
from fmus.models.tool.model import MODEL as TOOL

LIMITS = {
    "input_saturation": 0.8,
    "input_rate_limit": 0.8,
    "relief_limit": 1.0,
}  # magnitudes: a gentle run does not reach a limit


def open_loop(name, seed=3):
    """A machine with a run without a controller."""
    rng = np.random.default_rng(seed)
    kit = KITS[name]
    system = kit.draw(rng)
    drives = kit.drives(system, rng)
    while drives[0][0].closed:
        drives = kit.drives(system, rng)
    return system, {b.name: b.value for b in system.base}, *drives[0]


def plain_discrete(model, system, values, drive, started, samples):
    """Outputs [samples, outputs] of a difference equation of fmus on recorded inputs."""
    p = model.start_parameters({**values, **started})
    names, outputs = [v.name for v in model.inputs], [v.name for v in model.outputs]
    x, found = model.x0(p), []
    for k in range(samples):
        u = np.zeros(len(names))
        for j, signal in enumerate(system.inputs):
            late = round(values.get(model.delays.get(signal.name, ""), 0.0) / STEP)
            u[names.index(signal.name)] = drive.commands[k - late, j] if k >= late else 0.0
        y = np.asarray(model.h(x, u, [], p)).ravel()
        found.append([y[outputs.index(s.name)] for s in system.outputs])
        x = model.f(x, u, [], p)
    return np.array(found)


def test_the_arm_without_effects_is_the_plain_arm():
    system, values, drive, start = open_loop("arm")
    started = {"start_q_boom": start[0], "start_q_stick": start[1]}
    plain = plain_discrete(ARM, system, values, drive, started, 400)
    assert system.simulate(values, drive, start).outputs[:400] == pytest.approx(plain, abs=1e-12)


def test_the_tool_without_effects_is_the_plain_tool():
    system, values, drive, start = open_loop("tool")
    started = {"start_q_tool_x": start[0], "start_q_tool_y": start[1]}
    plain = plain_discrete(TOOL, system, values, drive, started, 400)
    assert system.simulate(values, drive, start).outputs[:400] == pytest.approx(plain, abs=1e-12)


def test_the_slew_without_effects_is_the_plain_slew():
    system, values, drive, start = open_loop("slew")
    p = SLEW.start_parameters({**values, "start_q_slew": start[0]})
    x, step, gamma = np.asarray(SLEW.x0(p)).ravel(), SLEW.step, 1 - 1 / np.sqrt(2)
    late, off_since, released, plain = round(values["slew_delay"] / step), None, 0.0, []
    joystick = np.repeat(drive.commands[:, 0], 10)
    outputs = [v.name for v in SLEW.outputs]
    for k in range(10 * 150):
        u = np.array([joystick[k - late] if k >= late else 0.0, *drive.commands[k // 10, 1:], 0.0])
        if k % 10 == 0:
            y = np.asarray(SLEW.h(x, u, [released], p)).ravel()
            plain.append([y[outputs.index(s.name)] for s in system.outputs])
        off = abs(u[0]) > values["slew_brake_threshold"]
        off_since = (k if off_since is None else off_since) if off else None
        if off_since is not None and (k - off_since) * step > values["slew_brake_release_time"] - 1e-9:
            released = 1.0
        stage = np.eye(6) - gamma * step * np.asarray(SLEW.jacobian(x, u, [released], p))
        k1 = np.linalg.solve(stage, np.asarray(SLEW.f(x, u, [released], p)).ravel())
        ahead = np.asarray(SLEW.f(x + step * k1, u, [released], p)).ravel()
        x = x + step * (1.5 * k1 + 0.5 * np.linalg.solve(stage, ahead - 2 * k1))
    off_by = np.abs(system.simulate(values, drive, start).outputs[:150] - np.array(plain)).max(axis=0)
    assert np.all(off_by < [1e-5, 1e-5, 2e4, 2e4])
    assert np.abs(np.array(plain)[:, 1]).max() > 0.02


def test_reach_and_inertia_of_the_whole_machine_are_the_plain_models():
    boom, stick, p = np.array([0.8, 1.2]), np.array([-1.9, -0.6]), kinematics.geometry()
    assert np.array(machine.reach(boom, stick)) == pytest.approx(np.array(kinematics.arm_tip(boom, stick, p)))
    expected = kinematics.inertia_z(boom, stick, p.load_mass, p)
    assert machine.turning_inertia(boom, stick) == pytest.approx(expected)
    turning = (boom, stick, np.array([0.1, -0.1]), np.array([0.05, 0.2]))
    radius_rate, inertia_rate = machine.rates(*turning)
    assert radius_rate == pytest.approx(kinematics.arm_tip_rate(*turning, p)[0])
    assert inertia_rate == pytest.approx(kinematics.inertia_rate(*turning, p.load_mass, p))


def test_a_joint_with_dry_friction_stands_exactly_still():
    system, values, _, _ = open_loop("arm")
    inertia, response = values["boom_joint_inertia"], values["boom_response"]
    held = {"boom.coulomb_plus": inertia * response * 0.1 / STEP, "boom.coulomb_minus": 0.0}
    commands = np.zeros((100, 2))
    commands[:, 0] = 0.0999
    still = system.simulate(values | held, Drive(commands), np.array([1.2, -1.7, 0, 0])).outputs
    assert np.all(still[:, 0] == 1.2)
    commands[:, 0] = 0.15
    moves = system.simulate(values | held, Drive(commands), np.array([1.2, -1.7, 0, 0])).outputs
    assert moves[-1, 2] == pytest.approx(0.05, rel=1e-6)


def test_wind_hangs_the_tool_aslant_in_the_world():
    system, values, _, _ = open_loop("tool")
    motion = np.zeros((4000, 5))
    motion[:, 0], motion[:, 2] = np.pi / 2, 10.0
    values = values | {"wind_y": 0.5, "tool_damping_x": 1.0, "tool_damping_y": 1.0}
    y = system.simulate(values, Drive(motion), np.zeros(4)).outputs[-1]
    assert y[1] == pytest.approx(-np.arctan(0.5 / 9.81), abs=2e-3)  # outwards, seen from the turned machine
    assert y[0] == pytest.approx(0.0, abs=1e-6)


def test_a_tool_let_down_slowly_swings_as_its_adiabatic_invariant_says():
    system, values, _, _ = open_loop("tool")
    samples, rate = 4000, 0.0125  # 2 m to 3 m in 80 s
    still = np.tile([0.0, 0.0, 10.0, 0.0, 8.0], (samples, 1))
    values = values | {f"tool_{n}_{a}": v for a in "xy" for n, v in (("damping", 0.0), ("length", 2.0))}
    swing = system.simulate(values | {"hoist": rate}, Drive(still), np.array([0.02, 0.0, 0.0, 0.0])).outputs
    first, last = (np.abs(swing[part, 0]).max() for part in (slice(0, 200), slice(-200, None)))
    assert last / first == pytest.approx((2.0 / 3.0) ** 0.75, rel=0.03)


def test_a_carriage_sticks_against_a_slope_and_a_worse_supply_is_slower():
    system, values, drive, start = open_loop("slew")
    still = Drive(np.column_stack([np.zeros(100), *drive.commands[:100, 1:].T]))
    held = {"slope_cos": 4e3, "coulomb_plus": 5e3, "coulomb_minus": 5e3}
    assert np.all(system.simulate(values | held, still, np.zeros(2)).outputs[:, 1] == 0.0)
    plain, sagging = (
        system.simulate(values | {"sag": sag}, drive, start).outputs[:, 1] for sag in (0.0, 0.5)
    )
    assert np.abs(sagging).sum() < np.abs(plain).sum()


def test_lags_of_the_slews_command_act_between_samples():
    """Two lags one after the other are the same in either order; held from sample to sample they are not."""
    system, values, drive, start = open_loop("slew")
    free = values | {"slew_spool_rate": 1e4, "slew_brake_threshold": -1.0}  # a linear spool, no brake
    one, other = (
        system.simulate(free | {"in_lag": a, "slew_spool_lag": b}, drive, start).outputs
        for a, b in ((0.05, 0.15), (0.15, 0.05))
    )
    assert np.ptp(one[:, 1]) > 0.01
    assert np.abs(one[:, :2] - other[:, :2]).max() < 1e-5 * np.ptp(one[:, 0])


def test_the_slews_rate_limit_acts_between_samples():
    """A limit that takes a third of a sample holds a step up by a sixth of a sample, as a delay does."""
    system, values, drive, start = open_loop("slew")
    steps = drive.commands.copy()
    steps[:, 0] = np.where(np.arange(len(steps)) >= 50, 0.6, 0.0)
    free = values | {"slew_spool_rate": 1e4, "slew_brake_threshold": -1.0}  # a linear spool, no brake
    held = [
        system.simulate(free | more, Drive(steps), start).outputs[:, 0]
        for more in ({}, {"in_rate": 0.6 / (STEP / 3.0)}, {"in_delay": STEP / 6.0})
    ]
    late = np.abs(held[0] - held[2]).max()
    assert late > 1e-4
    assert np.abs(held[1] - held[2]).max() < 0.02 * late


def test_lags_of_the_slews_sensors_are_those_of_what_moves_between_samples():
    system, values, drive, start = open_loop("slew")
    plain, lagged = (
        system.simulate(values | {"out_lag_q": lag}, drive, start).outputs[:, 0] for lag in (0.0, 0.1)
    )
    rate = np.gradient(lagged, STEP)
    assert np.abs(0.1 * rate + lagged - plain)[5:-5].max() < 0.01 * np.abs(lagged - plain).max()


@pytest.mark.parametrize("name", [k for k in KITS if k != "servo"])
def test_every_effect_of_a_machine_runs_and_changes_what_is_measured(name):
    system, values, drive, start = open_loop(name)
    kit = KITS[name]
    scale = kit.scale(system, [(drive, start)])
    drive = Drive(drive.commands[:400])
    plain = system.simulate(values, drive, start).outputs
    rng = np.random.default_rng(1)
    silent = []
    for effect in (*kit.declared(system), *kit.outside(system)):
        size = 1.0 if effect.as_it_is else LIMITS.get(effect.name, 0.1) * effect.largest
        parameters = effect.size(size, effect.shape(rng), scale)
        assert set(parameters) == {p.name for p in effect.parameters}
        entered = {k: v + values.get(k, 0.0) for k, v in effect.enter(parameters, scale).items()}
        if np.array_equal(system.simulate(values | entered, drive, start).outputs, plain):
            silent.append(effect.key)
    # Where the arm does not move, it takes no flow.
    assert set(silent) <= {"shared_pump_flow"}


@pytest.mark.parametrize(
    ("late_input", "late_outputs"), [("input_delay", "sensor_delay"), ("input_lag", "sensor_lag")]
)
def test_what_comes_late_into_a_tool_may_as_well_come_late_out_of_it(late_input, late_outputs):
    system, values, drive, _ = open_loop("tool")
    effects = {e.key: e for e in KITS["tool"].effects(system)}
    scale = Scale(1.0, 1.0, 1.0, 1.0, 1.0)
    runs = []
    for key in (f"tool/{late_input}/motion", f"tool/{late_outputs}/all"):
        (only,) = effects[key].parameters
        entered = effects[key].enter({only.name: 2.5 * STEP}, scale)
        # from rest, before which nothing moved
        still = replace(
            drive, commands=np.vstack([np.repeat(drive.commands[:1], 50, axis=0), drive.commands])
        )
        still.commands[:50, [1, 3]] = 0.0
        runs.append(system.simulate(values | entered, still, np.zeros(4)).outputs)
    assert np.ptp(runs[0][:, 0]) > 0.05
    assert runs[1] == pytest.approx(runs[0], abs=2e-3 * np.ptp(runs[0]))
