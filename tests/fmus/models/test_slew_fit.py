"""Traces, simulator, scores, features and fit of the slew model, with the acceptance of what is shipped."""

from dataclasses import replace

import numpy as np
import pytest

from fmus.models.slew import assessment, evidence, features, fit, lateness, score, traces
from fmus.models.slew.features import Features
from fmus.models.slew.model import MODEL
from fmus.models.slew.simulation import Simulator
from fmus.toolchain.stepper import Stepper
from specs import parameters as parameter_specs
from specs.errors import InputError

ENCODER_DELAY = 0.2  # s, of a machine's speed signal


@pytest.fixture(scope="module")
def known():
    return traces.load()


@pytest.fixture(scope="module")
def shipped(known):
    return assessment.assess(known)


def test_sets_are_what_the_fit_promises(known):
    used, judged, far = (f(known) for f in (traces.fit_set, traces.held_out, traces.unphysical))
    names = [{t.name for t in group} for group in (used, judged, far)]
    assert [len(n) for n in names] == [20, 26, 10]
    assert set.union(*names) == set(known)
    assert not names[0] & names[1]
    assert {t.inertia for t in used} == {250e3, 550e3}


def test_angle_of_a_trace_is_the_running_sum_of_its_speed(known):
    for trace in known.values():
        np.testing.assert_allclose(np.diff(trace.q), trace.qd[1:] * traces.PERIOD, atol=2e-6)


def test_damaged_trace_is_named(tmp_path):
    (tmp_path / "step_100_I250.csv").write_text("time,u_slew\n0.1,zero\n")
    with pytest.raises(InputError, match=r"step_100_I250\.csv"):
        traces.load(tmp_path)


def test_no_traces(tmp_path):
    with pytest.raises(InputError, match="no slew traces"):
        traces.load(tmp_path)


def test_simulator_takes_the_steps_of_the_reference_integrator(known):
    """With a delay of whole steps both do the same; only the order of the elimination differs."""
    trace = known["reversal_I550"]
    states, _ = (simulator := Simulator()).run(trace, simulator.start)
    run = Stepper(MODEL)
    run.set(u_slew=float(trace.u_slew[trace.first]), inertia=trace.inertia)
    run.x = simulator.initial(trace)
    for k in range(30):
        np.testing.assert_allclose(states[k], run.x, rtol=1e-7, atol=1e-9)
        run.set(u_slew=float(trace.u_slew[trace.first + k + 1]))
        run.advance(round(traces.PERIOD / MODEL.step))


@pytest.mark.parametrize("name", ["slew_delay", "slew_dead_band", "slew_relief_lag", "slew_friction_load"])
def test_sensitivities_are_exact(known, name):
    simulator, trace = Simulator(tuple(fit.starts())), known["bump_I250"]
    # Off the grid of steps: where the delayed command jumps between two steps there is no derivative.
    p = simulator.parameters({"slew_delay": 0.1413})
    _, sens = simulator.run(trace, p, sensitivities=True)
    exact = sens[:, simulator.fitted.index(name)]
    size = 1e-6 * p[MODEL.index("parameters", name)]
    ends = []
    for sign in (1, -1):
        moved = p.copy()
        moved[MODEL.index("parameters", name)] += sign * size
        ends.append(simulator.run(trace, moved)[0])
    slope = (ends[0] - ends[1]) / (2 * size)
    assert np.abs(slope).max() > 0
    assert np.all(np.abs(exact - slope).max(axis=0) <= 1e-4 * np.abs(slope).max(axis=0))


def test_score_of_known_errors(known):
    trace = known["sine_I250"]
    rest = slice(trace.first, None)
    run = score.Run(
        trace.q[rest] + 0.1, trace.qd[rest] + np.radians(3), trace.p_a[rest] + 1e6, trace.p_b[rest]
    )
    found = score.score(trace, run)
    assert found.velocity_mae_deg_s == pytest.approx(3.0)
    assert found.angle_mae_deg == pytest.approx(0.0, abs=1e-9)  # an offset is no error of the motion
    assert found.angle_mae_whole_run_deg == pytest.approx(np.degrees(0.1))
    assert found.pressure_mae_bar == pytest.approx(5.0)
    turned = score.score(trace, replace(run, p_a=run.p_b, p_b=run.p_a))
    assert turned.pressure_sign < 0.1


def test_windows_bound_a_drift():
    drift = 2.0 * traces.PERIOD * np.arange(400)  # 2 °/s
    assert score.windowed(drift) == pytest.approx(10.0)  # 0 .. 20° within every window of 10 s
    assert score.windowed(drift[:50]) == pytest.approx(drift[:50].mean())


def test_features_of_a_first_order_step():
    time = 0.02 * np.arange(1, 800)
    rising, falling = 1 - np.exp(-(time - 1) / 0.8), np.exp(-(time - 8) / 0.5)
    speed = 0.5 * np.where(time < 1, 0, np.where(time < 8, rising, falling))
    found = features.features(time, -speed, -np.cumsum(speed) * 0.02)
    assert found.speed_deg_s == pytest.approx(np.degrees(0.5), rel=1e-3)
    assert found.t63_s == pytest.approx(0.8, abs=0.02)
    assert found.t90_s == pytest.approx(0.8 * np.log(10), abs=0.02)
    assert found.coast_deg == pytest.approx(np.degrees(0.25), rel=0.03)


def test_features_of_the_traces(known):
    """The published table: speed, t5, t63, t90, coast at 400 t m2 and full joystick."""
    pair = [known["step_100_I400"], known["step_100_I400_neg"]]
    found = features.mean([features.of_trace(t) for t in pair])
    assert list(vars(found).values()) == pytest.approx([47.9, 0.5, 2.75, 4.85, 92.0], abs=0.06)


def test_misses_name_the_feature():
    wanted = Features(20.0, 0.5, 2.0, 4.0, 30.0)
    assert features.misses(replace(wanted, speed_deg_s=22.9, t90_s=4.6), wanted) == []
    assert features.misses(replace(wanted, coast_deg=36.0), wanted) == ["coast_deg 36.00, traces 30.00"]
    assert features.misses(replace(wanted, t5_s=float("nan")), wanted)


def test_shipped_parameters_are_accepted(shipped):
    assert shipped["velocity_mae_deg_s"] <= 2.0
    assert shipped["angle_mae_deg"] <= 8.0
    assert shipped["pressure_sign"] >= 0.95
    assert shipped["accepted"]
    assert len(shipped["traces"]) == 26
    assert len(shipped["I700"]["traces"]) == 10


def test_whole_run_angles_are_out_of_reach_of_any_symmetric_model(shipped):
    """Why the angle is scored over windows: the traces' own asymmetry exceeds the limit over whole runs."""
    floor = shipped["mirror_difference"]["held_out"]
    assert floor["angle_mae_whole_run_deg"] > assessment.LIMITS["angle_mae_deg"]
    assert floor["angle_mae_deg"] < shipped["angle_mae_deg"]
    assert shipped["angle_mae_whole_run_deg"] < 1.3 * floor["angle_mae_whole_run_deg"]


@pytest.mark.parametrize("delay", [0.0, ENCODER_DELAY])
def test_steps_at_400_have_the_features_of_the_traces(known, delay):
    """Also as an encoder shows them, whose speed is late."""
    joysticks = ("035", "050", "070", "100")
    pairs = [[known[f"step_{u}_I400{side}"] for side in ("", "_neg")] for u in joysticks]
    runs = fit.simulate(t for pair in pairs for t in pair)
    late = round(delay / traces.PERIOD)
    for pair in pairs:
        found = []
        for t in pair:
            speed = np.concatenate([np.zeros(late), runs[t.name].qd])[: len(runs[t.name].qd)]
            found.append(features.features(t.time[t.first :], speed, runs[t.name].q))
        wanted = features.mean([features.of_trace(t) for t in pair])
        assert features.misses(features.mean(found), wanted) == []


def test_parameters_called_identified_are(known):
    found = evidence.identifiability(evidence.shipped())
    status = {n: p.status for n, p in parameter_specs.load("slew").items()}
    for name, resolution in zip(found.names, found.resolution, strict=True):
        assert (status[name] == "identified") == (resolution >= 0.5), (name, resolution)
    others = [n for n, s in status.items() if n not in found.names]
    assert all(status[n] in ("assumed", "measured") for n in others)


def test_traces_show_no_lag_of_the_speed(known):
    by_lag = evidence.speed_lag(traces.fit_set(known))
    assert max(by_lag, key=by_lag.__getitem__) <= 0.0
    assert by_lag[0.0] - by_lag[0.2] > 0.02


def test_residuals_cover_every_moving_sample(known):
    chosen = traces.held_out(known)
    rows = evidence.residuals(chosen)
    assert sum(r["samples"] for r in rows) == sum(len(t.time) - t.first - 1 for t in chosen)
    assert {r["regime"] for r in rows} == set(evidence.REGIMES)
    assert {r["direction"] for r in rows} == {1, -1}


def test_regimes_of_a_step(known):
    names = [evidence.REGIMES[k] for k in evidence.regime(known["step_100_I400"])]
    assert names[5] == "rest"
    assert names[30] == "accelerating"
    assert names[90] == "coasting"
    assert names[-1] == "rest"


@pytest.mark.long
def test_fit_finds_the_shipped_parameters_again(known):
    """From the start file, and from a start moved by half a spread in every parameter."""
    file = {n: p.value for n, p in parameter_specs.load("slew").items()}
    spreads = fit.starts()
    moved = {n: s + 0.5 * d * (-1) ** k for k, (n, (s, d)) in enumerate(spreads.items())}
    first, second = fit.fit(), fit.fit(start=moved)
    assert second.cost == pytest.approx(first.cost, rel=5e-3)
    for found in (first, second):
        for name, (_, spread) in spreads.items():
            assert abs(found.values[name] - file[name]) < 0.5 * spread, name
        assert assessment.accepted(score.mean(fit.scores(traces.held_out(known), found.values).values()))


def turning(late: float) -> traces.Trace:
    """A drive of known balance, moved by changing pressures, whose speed is recorded `late` seconds late."""
    fine = np.arange(0.0, 40.0, 1e-3)
    pressure = 4e6 * np.sin(0.9 * fine) * np.cos(0.23 * fine) + 3e6 * np.sin(2.3 * fine)
    speed = np.zeros_like(fine)
    for k in range(len(fine) - 1):
        torque = 1e-2 * pressure[k] - 4e4 * speed[k] - 5e3 * np.tanh(speed[k] / 1e-3)
        speed[k + 1] = speed[k] + 1e-3 * torque / 300e3
    time = np.arange(0.1, 39.0, traces.PERIOD)
    p_a, qd = np.interp(time, fine, pressure), np.interp(time - late, fine, speed)
    zero = np.zeros_like(time)
    return traces.Trace("drawn", time, zero, 300e3, p_a, zero, qd, zero)


@pytest.mark.parametrize("late", [0.0, 0.2])
def test_a_late_speed_is_seen_in_the_torque_balance(late):
    found = lateness.lateness([turning(late)])
    assert max(found, key=lambda shift: found[shift]) == late
    assert lateness.balance([turning(late)], late)[1] == pytest.approx([1e-2, 4e4, 5e3], rel=0.15)


def test_the_traces_show_no_late_speed(known):
    found = lateness.lateness(traces.held_out(known))
    assert max(found, key=lambda shift: found[shift]) <= 0.0
