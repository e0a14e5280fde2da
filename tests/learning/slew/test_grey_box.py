"""The refitted hydraulic model: its runs along recordings, the late speed, recovery of changed parameters."""

from dataclasses import replace

import numpy as np
import pytest

from fmus.models.slew import fit as slew_fit, traces
from fmus.models.slew.model import MODEL
from fmus.models.slew.simulation import Course, Simulator
from fmus.toolchain.stepper import Stepper
from learning.slew import grey_box
from learning.slew.score import score
from learning.slew.trajectory import Trajectory, of_trace, windows
from specs import parameters as parameter_specs
from specs.errors import InputError

CHANGED = {
    "slew_inlet_flow": 1.2e-3, "slew_friction_viscous": 5.0e4, "slew_stop_pressure": 21e6,
    "slew_inertia_extra": 5e4, "slew_cut_off_high": 42e6,
}  # fmt: skip
SHIPPED = {name: float(p.value) for name, p in parameter_specs.load("slew").items()}


def _course(rows: int, seed: int, inertia: float = 4e5) -> Course:
    """Random levels of the joystick from rest, while the arm reaches out and back."""
    rng, levels = np.random.default_rng(seed), [0.0] * 10
    while len(levels) < rows:
        levels += [float(rng.choice([0.0, *rng.uniform(-1, 1, 3)]))] * int(rng.integers(15, 45))
    reach = inertia * (1.0 + 0.3 * np.sin(0.06 * np.arange(rows + 1) + seed))
    known = np.full((rows, len(MODEL.states)), np.nan)
    known[0] = [0.0, 0.0, 16e5, 16e5, 0.0, 0.0]
    middle = (reach[1:] + reach[:-1]) / 2
    return Course(np.array(levels[:rows]), middle, np.diff(reach) / 0.1, known, released=False)


def _recording(values, seed: int, late_s: float, inertia: float = 4e5, rows: int = 500) -> Trajectory:
    """What the model's sensors would show; a speed late by whole or half rows."""
    run = Simulator((), replace(MODEL, step=grey_box.STEP_S))
    course = _course(rows, seed, inertia)
    states, _ = run.follow(course, run.parameters(values))
    p_a, p_b, speed = (states[:, run.column(n)] for n in ("p_a", "p_b", "qd"))
    late = np.interp(np.arange(rows) - late_s / 0.1, np.arange(rows), speed)
    ends = course.inertia + course.inertia_rate * 0.05
    return Trajectory(f"made_{seed}", course.command, p_b, p_a, late, ends)


@pytest.fixture(scope="module")
def recordings() -> list[Trajectory]:
    return [_recording(CHANGED, seed, 0.2, inertia) for seed, inertia in enumerate((3e5, 4e5, 6e5, 9e5))]


def test_a_course_of_constant_inertia_is_a_trace():
    trace = traces.load()["reversal_I550"]
    run = Simulator()
    wanted, _ = run.run(trace, run.start)
    rows = len(trace.time)
    known = np.full((rows, len(MODEL.states)), np.nan)
    known[: trace.first + 1] = run.initial(trace)
    still = np.zeros(rows)
    found, _ = run.follow(Course(trace.u_slew, still + trace.inertia, still, known, False), run.start)
    # the joystick of a trace is neutral up to its settled row, and the brake engaged
    assert not np.any(trace.u_slew[: trace.first + 1])
    np.testing.assert_allclose(found[trace.first :], wanted, rtol=1e-9, atol=1e-9)


def test_a_course_takes_the_steps_of_the_reference_integrator():
    course, run = _course(60, 3), Simulator()
    found, _ = run.follow(course, run.start)
    own = Stepper(MODEL)
    own.x = course.known[0].copy()
    for k in range(59):
        np.testing.assert_allclose(found[k], own.x, rtol=1e-7, atol=1e-9)
        own.set(
            u_slew=float(course.command[k + 1]),
            inertia=float(course.inertia[k + 1]),
            inertia_rate=float(course.inertia_rate[k + 1]),
        )
        own.advance(round(0.1 / MODEL.step))
    assert np.abs(found[:, run.column("qd")]).max() > 0.1


def test_states_are_taken_over_where_they_are_known():
    course, run = _course(40, 1), Simulator((), replace(MODEL, step=grey_box.STEP_S))
    known = course.known.copy()
    known[20, run.column("qd")] = 0.25
    free, _ = run.follow(course, run.start)
    found, _ = run.follow(replace(course, known=known), run.start)
    np.testing.assert_array_equal(found[:20], free[:20])
    assert found[20, run.column("qd")] == 0.25
    np.testing.assert_array_equal(found[20, run.column("p_a")], free[20, run.column("p_a")])
    assert abs(found[21, run.column("qd")] - 0.25) < 0.05


@pytest.mark.parametrize("late_s", [0.0, 0.15, 0.2])
def test_the_late_speed_is_predicted(late_s):
    """With the parameters that made the recording, what remains is the interpolation between rows."""
    of = windows([_recording(CHANGED, 7, late_s)], 20, 100, 10)
    values = {**CHANGED, grey_box.SENSOR_DELAY: late_s}
    found = score(lambda w: grey_box.simulate(w, values), of)
    assert found.velocity_mae < 0.05
    assert found.position_mae < 0.2
    wrong = score(lambda w: grey_box.simulate(w, {**values, grey_box.SENSOR_DELAY: late_s + 0.1}), of)
    assert wrong.velocity_mae > 3 * found.velocity_mae


def test_tells_late_speeds_from_others(recordings):
    assert grey_box.sensor_delay(recordings) == 0.2
    assert grey_box.sensor_delay([_recording(CHANGED, seed, 0.0) for seed in range(3)]) == 0.0
    steps = [of_trace(t) for t in traces.load().values() if t.shape == "step"]
    assert grey_box.sensor_delay(steps) == 0.0


@pytest.mark.long
def test_recovers_changed_parameters(recordings, monkeypatch):
    """To a few percent of the change where the prior hardly counts: it is what draws 20 windows back."""
    monkeypatch.setattr(slew_fit, "PRIOR_WEIGHT", 0.02)
    found = grey_box.fit(recordings, count=20, evaluations=20)
    for name, value in CHANGED.items():
        assert abs(found.values[name] - value) < 0.1 * abs(value - SHIPPED[name]), name
    assert found.values[grey_box.SENSOR_DELAY] == pytest.approx(0.2, abs=0.005)


@pytest.mark.long
def test_the_refitted_model_predicts_what_it_was_not_fitted_to(recordings):
    found = grey_box.fit(recordings, count=20, evaluations=12)
    fresh = windows([_recording(CHANGED, 11, 0.2, 5e5)], 20, 100, 10)
    shipped = {n: SHIPPED[n] for n in slew_fit.starts()} | {grey_box.SENSOR_DELAY: 0.2}
    before = score(lambda w: grey_box.simulate(w, shipped), fresh)
    after = score(found.predictor(), fresh)
    assert after.velocity_mae < 0.1 * before.velocity_mae
    assert after.position_mae < 0.1 * before.position_mae
    assert set(found.figures()["values"]) == set(found.values)


def test_predicts_from_the_past_joystick_and_inertia_only(recordings):
    of = windows(recordings[:1], 20, 100, 60)
    values = {**CHANGED, grey_box.SENSOR_DELAY: 0.2}
    predicted = grey_box.simulate(of, values)
    assert predicted.shape == (len(of), 100)

    def late(x: np.ndarray) -> np.ndarray:
        return np.hstack([x[:, :20], x[:, 20:] * 3.0 + 1.0])

    other = replace(of, omega=late(of.omega), p_l=late(of.p_l), p_r=late(of.p_r))
    np.testing.assert_array_equal(grey_box.simulate(other, values), predicted)
    # a joystick that moves after 4 s shows 0.2 s later at the earliest
    moved = replace(of, u=np.hstack([of.u[:, :60], -of.u[:, 60:]]))
    again = grey_box.simulate(moved, values)
    np.testing.assert_array_equal(again[:, :42], predicted[:, :42])
    assert not np.array_equal(again, predicted)


def test_a_second_of_history_is_enough(recordings):
    """What lies further back than the run-in says nothing but whether the brake was used."""
    longer, shorter = windows(recordings[:1], 20, 100, 40), windows(recordings[:1], 10, 100, 40)
    shifted = replace(
        shorter, **{k: getattr(longer, k)[:, 10:] for k in ("u", "p_l", "p_r", "omega", "inertia")},
        owner=longer.owner,
    )  # fmt: skip
    values = {**CHANGED, grey_box.SENSOR_DELAY: 0.2}
    difference = grey_box.simulate(longer, values) - grey_box.simulate(shifted, values)
    assert np.degrees(np.abs(difference)).max() < 0.5


def test_refuses_recordings_that_are_too_short():
    with pytest.raises(InputError, match="11 s"):
        grey_box.fit([_recording(CHANGED, 1, 0.2, rows=60)])
