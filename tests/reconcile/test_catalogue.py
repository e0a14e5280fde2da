"""Entries of the catalogue by their own definitions: names, nothing when absent, exact steps, shafts."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pytest

from fmus.definition import Model, Variable
from reconcile.catalogue import ALL, Scales
from reconcile.equations.extended import Extended
from reconcile.equations.model import Attached, Folder, candidates, read_folder
from reconcile.equations.ports import find_ports
from tests.reconcile import models

INPUT = [
    "input_dead_zone",
    "input_delay",
    "input_lag",
    "input_saturation",
    "input_rate_limit",
    "input_backlash",
    "input_hysteresis",
    "asymmetric_gain",
    "input_offset",
    "input_crosstalk",
    "valve_flow_curve",
]
AXIS = [
    "coulomb_friction",
    "asymmetric_coulomb_friction",
    "stribeck_friction",
    "viscous_friction",
    "asymmetric_viscous_friction",
    "load_dependent_friction",
    "quadratic_drag",
    "presliding_hysteresis",
    "constant_load",
    "gravity_load",
    "slope_torque",
    "stiffness",
    "cubic_stiffness",
    "torque_ripple",
    "wind_load",
    "end_stop",
    "payload_mass",
    "pose_dependent_inertia",
    "structural_compliance",
    "gear_backlash",
]
OUTPUT = [
    "sensor_bias",
    "sensor_scale",
    "sensor_nonlinearity",
    "sensor_delay",
    "sensor_lag",
    "sensor_backlash",
    "sensor_drift",
    "clock_drift",
    "cross_axis_misalignment",
]
STEP = 0.02


@dataclass
class At:
    """Functions of an extended model at one point, by names."""

    extended: Extended
    values: dict[str, float]

    def step(self, x: dict[str, float], u: dict[str, float]) -> dict[str, float]:
        """Rates or next states."""
        e = self.extended
        inputs = [u.get(v.name, 0.0) for v in e.model.inputs]
        arguments = [
            [x.get(n, 0.0) for n in e.state_names],
            inputs + [0.0] * (e.symbols[1].numel() - len(inputs)),
            [],
            [self.values[n] for n in e.parameter_names],
        ]
        return dict(zip(e.state_names, np.asarray(e.functions[0](*arguments)).ravel(), strict=True))


def only(folder: Folder, key: str, port: str, **parameters: float) -> At:
    """The model with one effect in, sharply."""
    effect = next(e for e in ALL if e.key == key)
    a = Attached(effect, port)
    extended = Extended(folder, [a])
    values = extended.base_start()
    more = {"width": 1e-9, "gate": 1.0} | parameters
    return At(extended, values | {a.name(n): v for n, v in more.items() if a.name(n) in values})


@pytest.fixture(scope="session")
def stepped() -> Folder:
    """A mass in steps of 0.02 s whose speed takes a force, positions following the new speed."""

    def rhs(x, u, m, p):
        v = x.v + STEP * (u.force + u.disturbance) / p.mass
        return {"x": x.x + STEP * v, "v": v}

    model = Model(
        name="stepped",
        description="Mass in steps",
        kind="discrete",
        step=STEP,
        states=(Variable("x", "m", "Position"), Variable("v", "m/s", "Speed")),
        inputs=(Variable("force", "N", "Force"), Variable("disturbance", "N", "Disturbing force")),
        outputs=(Variable("position", "m", "Position"), Variable("speed", "m/s", "Speed")),
        parameters=(Variable("mass", "kg", "Mass", start=2.0),),
        rhs=rhs,
        out=lambda x, u, m, p: {"position": x.x, "speed": x.v},
    )
    axis = {"velocity": "v", "position": "x", "unit": "N", "input": "disturbance", "drive": "force"}
    return Folder(model, find_ports(model, {"carriage": axis}), None)  # type: ignore[arg-type]


def test_every_name_of_the_contract_at_inputs_axes_and_outputs_is_there():
    names = {e.name for e in ALL}
    assert set(INPUT + AXIS + OUTPUT) <= names
    assert len({e.key for e in ALL}) == len(ALL)
    for effect in ALL:
        assert effect.equation
        assert effect.source
        assert effect.amplitudes or effect.gated


@pytest.mark.parametrize(
    ("name", "value", "half", "expected"),
    [
        ("sensor_lag", 0.015, 0.018, [0.0, 0.033]),
        ("sensor_lag", 0.015, 0.001, [0.014, 0.016]),
        ("sensor_bias", 0.1, 0.3, [-0.2, 0.4]),
    ],
)
def test_an_interval_ends_where_the_parameter_does(name, value, half, expected):
    effect = next(e for e in ALL if e.key == name)
    assert effect.parameters[0].within(value, value - half, value + half) == pytest.approx(expected)


@pytest.mark.parametrize("name", ["rig", "stepped", "arm"])
def test_absent_effects_leave_the_base_model_as_it_is(rig, stepped, name):
    folder = {"rig": rig, "stepped": stepped}.get(name) or read_folder(name)
    model = folder.model
    found = candidates(folder, [v.name for v in (*model.inputs, *model.outputs)])
    extended = Extended(folder, found)
    values = extended.base_start()
    for a in found:
        shapes = a.effect.start(Scales(), 0)
        values |= {a.name(n): v for n, v in shapes.items() if n not in {q.name for q in a.effect.amplitudes}}
        if a.effect.width:
            values[a.name("width")] = 1e-3
    rng = np.random.default_rng(1)
    x = {v.name: 0.3 + 0.05 * rng.standard_normal() for v in model.states}
    u = {v.name: 0.05 * rng.standard_normal() for v in model.inputs}
    hidden = {n: rng.standard_normal() for n in extended.state_names[len(model.states) :]}
    after = At(extended, values).step(x | hidden, u)
    own = np.asarray(model.f(list(x.values()), list(u.values()), [], model.start_parameters())).ravel()
    np.testing.assert_allclose([after[n] for n in x], own, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("time", [0.001, 0.02, 0.5])
def test_a_lag_in_steps_is_the_exact_one_for_a_held_input(stepped, time):
    at = only(stepped, "input_lag", "force", time=time)
    state = "input_lag@force.lagged"
    after = at.step({state: 0.2}, {"force": 1.0})
    wanted = 1.0 - 0.8 * np.exp(-STEP / time)
    assert after[state] == pytest.approx(wanted, rel=1e-12)
    assert after["v"] == pytest.approx(STEP * wanted / 2.0)


def test_play_in_steps_follows_at_once_and_rests_within_the_gap(stepped):
    at = only(stepped, "input_backlash", "force", gap=0.4)
    state = "input_backlash@force.follower"
    assert at.step({state: 0.1}, {"force": 1.0})[state] == pytest.approx(0.8)
    assert at.step({state: 0.1}, {"force": -1.0})[state] == pytest.approx(-0.8)
    assert at.step({state: 0.1}, {"force": 0.25})[state] == 0.1


def test_a_rate_limit_in_steps_goes_so_far_and_no_further(stepped):
    at = only(stepped, "input_rate_limit", "force", rate=5.0)
    state = "input_rate_limit@force.limited"
    assert at.step({state: 0.0}, {"force": 1.0})[state] == pytest.approx(5.0 * STEP)
    assert at.step({state: 0.0}, {"force": -0.03})[state] == pytest.approx(-0.03)


@pytest.mark.parametrize(
    ("form", "more"), [("input_hysteresis", {"share": 0.5}), ("input_hysteresis.even", {})]
)
def test_hysteresis_is_half_the_command_and_two_plays(form, more, stepped):
    at = only(stepped, form, "force", full_width=0.4, **more)
    after = at.step({}, {"force": 1.0})
    wide, narrow = 1.0 - 0.2, 1.0 - 0.1
    assert after["v"] == pytest.approx(STEP * (0.5 + 0.25 * (wide + narrow)) / 2.0)


def test_dry_friction_in_steps_slows_and_stops_and_never_turns(stepped):
    at = only(stepped, "coulomb_friction", "carriage", Fc=1.5)
    moving = at.step({"x": 1.0, "v": 0.5}, {"force": 0.5})
    assert moving["v"] == pytest.approx(0.5 + STEP * (0.5 - 1.5) / 2.0)
    assert moving["x"] == pytest.approx(1.0 + STEP * moving["v"])  # the position follows the slowed speed
    stopping = at.step({"x": 1.0, "v": 0.005}, {"force": 0.5})
    assert stopping["v"] == pytest.approx(0.0, abs=1e-8)
    assert stopping["x"] == pytest.approx(1.0, abs=1e-8)
    assert at.step({"v": 0.0}, {"force": -1.6})["v"] == pytest.approx(-STEP * 0.1 / 2.0, abs=1e-8)


def test_stribeck_friction_in_steps_breaks_away_from_the_static_level(stepped):
    at = only(stepped, "stribeck_friction", "carriage", Fc=1.0, Fs=2.0, vs=0.1)
    assert at.step({"v": 0.0}, {"force": 1.9})["v"] == pytest.approx(0.0, abs=1e-8)
    assert at.step({"v": 1.0}, {"force": 1.9})["v"] == pytest.approx(1.0 + STEP * (1.9 - 1.0) / 2.0)


def test_static_friction_is_not_below_the_kinetic_one(stepped):
    """Fitted where friction grows with speed, Stribeck's form would have the sign that it has not."""
    at = only(stepped, "stribeck_friction", "carriage", Fc=1.0, Fs=0.2, vs=0.1)
    assert at.step({"v": 0.0}, {"force": 0.9})["v"] == pytest.approx(0.0, abs=1e-8)


def test_added_inertia_in_steps_moves_the_position_with_it(stepped):
    at = only(stepped, "payload_mass", "carriage", inertia=2.0)
    after = at.step({"x": 0.0, "v": 0.0}, {"force": 1.0})
    assert after["v"] == pytest.approx(STEP * 1.0 / 4.0)
    assert after["x"] == pytest.approx(STEP * after["v"])


def test_a_bristle_in_steps_bends_to_the_full_force_for_any_step(stepped):
    at = only(stepped, "presliding_hysteresis", "carriage", Fc=1.0, distance=1e-4)
    state = "presliding_hysteresis@carriage.bristle"
    assert at.step({"v": 1.0, state: -1.0}, {})[state] == pytest.approx(1.0)
    slow = at.step({"v": 1e-3, state: 0.0}, {})[state]
    assert slow == pytest.approx(1.0 - np.exp(-1e-3 * STEP / 1e-4))


def test_friction_goes_with_what_the_drive_pushes_not_with_its_signal():
    folder = read_folder("arm")
    key = "load_dependent_friction"
    at = only(folder, key, "boom", mu=0.5)
    free = At(Extended(folder, []), Extended(folder, []).base_start())
    x, u = {"boom": 1.0, "boom_rate": 0.05}, {"qd_boom_ref": 0.1}
    response = free.step(x, u)["boom_rate"] - 0.05
    slowed = at.step(x, u)["boom_rate"] - 0.05
    assert slowed == pytest.approx(0.5 * response, rel=1e-6)  # force 1, friction 0.5 of it


@pytest.mark.parametrize("form", ["", ".motor_sensor"])
def test_a_shaft_passes_momentum_on(rig, form):
    key, mass, drag = "structural_compliance" + form, 2.0, 1.5
    at = only(rig, key, "v", k=50.0, c=3.0, share=0.25)
    twist, rate = f"{key}@v.twist", f"{key}@v.twist_rate"
    after = at.step({"v": 0.4, twist: 0.02, rate: 0.1}, {"force": 5.0})
    load_speed = 0.4 if not form else 0.5
    ahead, ahead_rate = (0.02, 0.1) if not form else (-0.02, -0.1)
    torque = 50.0 * ahead + 3.0 * ahead_rate
    motor, load = (5.0 - torque) / (0.25 * mass), (torque - drag * load_speed) / (0.75 * mass)
    shown, other = (load, motor) if not form else (motor, load)
    assert after["v"] == pytest.approx(shown)
    assert after[rate] == pytest.approx(other - shown)
    assert after[twist] == pytest.approx(0.1)


def test_a_gear_lets_go_within_its_full_gap(rig):
    at = only(rig, "gear_backlash", "v", gap=0.01, share=0.5, k=1000.0)
    twist = "gear_backlash@v.twist"
    inside = at.step({"v": 0.0, twist: 0.0049}, {"force": 5.0})
    beyond = at.step({"v": 0.0, twist: 0.007}, {"force": 5.0})
    assert inside["v"] == pytest.approx(0.0, abs=1e-5)
    assert beyond["v"] == pytest.approx(1000.0 * 0.002 / (0.5 * 2.0), rel=1e-5)


def test_an_end_stop_pushes_and_never_pulls(rig):
    at = only(rig, "end_stop", "v", k=200.0, position=1.0, relaxation=0.02)
    assert at.step({"x": 1.1, "v": 0.0}, {})["v"] == pytest.approx(-200.0 * 0.1 / 2.0)
    assert at.step({"x": -1.1, "v": 0.0}, {})["v"] == pytest.approx(200.0 * 0.1 / 2.0)
    leaving = at.step({"x": 1.1, "v": -20.0}, {})["v"]
    assert leaving == pytest.approx(1.5 * 20.0 / 2.0)  # the rig's drag alone
    assert at.step({"x": 0.99, "v": 0.0}, {})["v"] == pytest.approx(0.0, abs=1e-5)


def test_a_force_is_in_newton_where_the_model_has_the_mass(rig):
    def rhs(x, u, m, p):
        return {"x": x.v, "v": (p.gain * u.command - p.drag * x.v) / p.mass}

    inputs = (Variable("command", "1", "Command"),)
    more = Variable("gain", "N", "Force at full command", start=3.0)
    model = replace(rig.model, inputs=inputs, parameters=(*rig.model.parameters, more), rhs=rhs)
    (axis,) = find_ports(model).axes
    assert (axis.unit, axis.inertia) == ("N", "mass")
    without = replace(model, rhs=lambda x, u, m, p: {"x": x.v, "v": p.gain * u.command - p.drag * x.v})
    (axis,) = find_ports(without).axes
    assert (axis.unit, axis.inertia) == ("m/s2", 1.0)


@pytest.mark.parametrize(
    ("units", "force", "friction"),
    [
        (("V", "V/s"), "V/s2", "V/s2/(V/s)"),
        (("V.s", "V"), "V/s", "V/s/(V)"),
        (("1", "1"), "1/s", "1/s/(1)"),
    ],
)
def test_a_state_whose_derivative_is_another_is_an_axis_in_any_unit(units, force, friction):
    """A sensor in volts, of which nobody recorded the scale."""
    model = unlabelled(units)
    (axis,) = find_ports(model).axes
    assert (axis.velocity, axis.position, axis.unit, axis.inertia) == ("v", "q", force, 1.0)
    at = models.folder(model)
    found = [a for a in candidates(at, ["shown"]) if a.port == "v"]
    assert {"viscous_friction", "coulomb_friction", "stiffness", "end_stop"} <= {a.effect.name for a in found}
    whole = Extended(at, found)
    spelled = {whole.unit(a, p.name) for a in found for p in a.effect.parameters}
    assert friction in spelled
    assert whole.inertia(axis) == 1.0


def test_of_a_chain_of_integrators_the_first_rate_is_the_axis():
    """What is more is the motor's or a controller's: jerk and so on is no force."""

    def rhs(x, u, m, p):
        return {"q": x.v, "v": x.a, "a": -p.pull * x.q - p.pull * x.v - x.a}

    model = unlabelled(("V", "V/s"))
    model = replace(model, states=(*model.states, Variable("a", "V/s2", "Acceleration")), rhs=rhs)
    assert [a.velocity for a in find_ports(model).axes] == ["v"]


def test_a_state_that_another_follows_late_is_no_axis():
    model = replace(unlabelled(("K", "K")), rhs=lambda x, u, m, p: {"q": p.pull * (x.v - x.q), "v": -x.v})
    assert not find_ports(model).axes


def unlabelled(units: tuple[str, str]) -> Model:
    """Something that swings, without inputs."""
    return Model(
        name="unlabelled",
        description="Swings",
        kind="continuous",
        step=0.1,
        states=(Variable("q", units[0], "Place"), Variable("v", units[1], "Rate")),
        inputs=(),
        outputs=(Variable("shown", units[0], "Place"),),
        parameters=(Variable("pull", "1/s2", "Stiffness by inertia", start=0.5, min=0.0),),
        rhs=lambda x, u, m, p: {"q": x.v, "v": -p.pull * x.q},
        out=lambda x, u, m, p: {"shown": x.q},
    )


def test_slopes_by_every_parameter_are_finite_where_effects_are_absent(rig):
    found = candidates(rig, ["force", "position", "velocity"])
    extended = Extended(rig, found)
    x, u, m, p = extended.symbols
    f = extended.functions[0](x, u, m, p)
    slope = ca.Function("s", [x, u, m, p], [ca.jacobian(f, p), ca.jacobian(f, x)])
    values = extended.base_start()
    for a in found:
        values |= {a.name(n): v for n, v in a.effect.start(Scales(), 0).items()}
        if a.effect.width:
            values[a.name("width")] = 1e-4
    for at in (0.0, 0.3):
        state = [at] * x.numel()
        for block in slope(state, [at] * u.numel(), [], [values[n] for n in extended.parameter_names]):
            assert np.isfinite(np.asarray(block)).all()


def test_what_has_a_factor_of_one_in_nature_is_not_taken_for_something_tiny():
    factors = [q for e in ALL for q in e.parameters if q.name == "factor"]
    assert factors
    assert all(0.0 < q.low < 1.0 < q.high for q in factors)


def test_what_shows_less_than_half_a_wave_or_turns_slower_than_once_a_turn_is_no_ripple():
    (ripple,) = [e for e in ALL if e.name == "torque_ripple"]
    (waves,) = [q for q in ripple.parameters if not q.amplitude]
    for scales, fewest in (
        (Scales(q_low=-0.1, q_high=0.1, angular=True), np.pi / 0.2),
        (Scales(q_low=-2.0, q_high=2.0, angular=True), 1.0),
        (Scales(q_low=0.0, q_high=20.0), np.pi / 20.0),
    ):
        assert waves.bounds(scales)[0] == pytest.approx(fewest)
        assert min(waves.starts(scales)) >= fewest - 1e-9
