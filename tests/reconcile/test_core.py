"""Fit, scores, sets and their probabilities on the new core: laws that hold whatever the numbers are."""

from dataclasses import replace

import numpy as np
import pytest

from fmus.definition import Variable
from reconcile.catalogue import ALL
from reconcile.equations.model import Folder
from reconcile.filter.kalman import CREEP, NOISES, TAU
from reconcile.filter.point import Free, standard_errors
from reconcile.judging import judge as judges, mistaken
from reconcile.judging.judge import UNTRIED, Judge
from reconcile.judging.readings import multiplied
from reconcile.recordings.data import Run, Signal, split
from reconcile.search import quiet, sets
from reconcile.search.beam import Beam
from reconcile.search.core import FITTED_MEMORY, Core
from reconcile.search.free import FreeParameters, stated
from reconcile.search.screen import Screen
from reconcile.tolerances import SURE, WORTH
from tests.reconcile import models
from tests.reconcile.answers import cored, fitted, recorded, rig
from tests.reconcile.truth import PERIOD, Truth, coulomb, excitation

FRICTION = "coulomb_friction@v"
FEW = (FRICTION, "quadratic_drag@v", "stiffness@v", "sensor_scale@velocity", "constant_load@v")


@pytest.fixture(scope="module")
def friction() -> Beam:
    """A carriage with dry friction, and a search among a few effects."""
    beam = Beam(cored(recorded(Truth(**coulomb(1.0)), seconds=20.0, seed=4), *FEW))
    beam.run()
    return beam


def test_a_search_ends_where_the_filter_has_gone_enough_steps_and_is_not_sure_then(friction, monkeypatch):
    assert not friction.cut
    monkeypatch.setattr(sets, "MOST_STEPS", 0.1 * friction.core.kalman.done)
    short = Beam(cored(recorded(Truth(**coulomb(1.0)), seconds=20.0, seed=4), *FEW))
    short.run()
    assert short.cut
    assert short.core.kalman.done < friction.core.kalman.done
    probable = Judge(short).decide().probability
    assert max(probable.values(), default=0.0) <= UNTRIED < SURE
    assert Judge(friction).decide().probability["coulomb_friction"] >= SURE


def test_the_disturbance_does_not_remember_so_long_that_it_takes_over_a_constant_load():
    key = "constant_load@v"
    beam = Beam(cored(recorded(Truth(force=lambda x, v, t: 0.3), seconds=40.0, seed=4), key))
    found = fitted(beam, [key])
    assert beam.core.base.values[TAU + "v"] <= FITTED_MEMORY * beam.core.memory_s * (1.0 + 1e-9)
    assert (
        beam.evidence(found) - beam.evidence(frozenset()) > 120.0
    )  # 73 where it may remember 30 times as long


def test_friction_that_gives_way_at_standstill_is_the_same_friction():
    """As simulations round it; where it had to stop, others of its kind made up for how it creeps."""
    keys = FRICTION, "asymmetric_coulomb_friction@v", "stribeck_friction@v", "load_dependent_friction@v"
    truth = Truth(kinetic=lambda v: 2.0 * np.tanh(v / 0.05))
    beam = Beam(cored(recorded(truth, seconds=20.0, seed=4), *keys))
    (best, *_) = beam.run()
    assert {a.key for a in best} == {FRICTION}
    assert beam.points[best].values[FRICTION + ".Fc"] == pytest.approx(2.0, rel=0.02)
    assert beam.points[best].values[CREEP + "v"] == pytest.approx(0.05, rel=0.1)


def geared(gap: float, seconds: float = 20.0) -> list[Run]:
    """A carriage whose drive, 0.8 of its 2 kg, moves the rest through a gear with play."""
    motor, load, stiffness, damping, step = 0.8, 1.2, 4000.0, 30.0, 1e-4
    command = np.repeat(excitation(seconds, 5), round(PERIOD / step))
    x = np.zeros(4)  # place and speed of the drive, of the rest
    shown = np.empty((len(command), 2))
    for k, force in enumerate(command):
        shown[k] = x[2:]
        twist = x[0] - x[2]
        pressed = twist - min(max(twist, -0.5 * gap), 0.5 * gap)
        torque = stiffness * pressed + (damping * (x[1] - x[3]) if pressed else 0.0)
        before = x[1], x[3]
        x[1] += step * (force - torque) / motor
        x[3] += step * (torque - 1.5 * x[3]) / load
        x[0] += 0.5 * step * (before[0] + x[1])
        x[2] += 0.5 * step * (before[1] + x[3])
    seen = shown[:: round(PERIOD / step)]
    seen = seen + [2e-4, 2e-3] * np.random.default_rng(1).standard_normal(seen.shape)
    time = PERIOD * np.arange(len(seen))
    outputs = {n: (time, seen[:, i]) for i, n in enumerate(("position", "velocity"))}
    return [models.run({"force": (time, command[:: round(PERIOD / step)])}, outputs)]


def test_the_play_of_a_gear_is_told_from_a_shaft_that_gives():
    beam = Beam(cored(geared(6e-4), "gear_backlash@v", "structural_compliance@v"))
    (best, *_) = beam.run()
    assert {a.key for a in best} == {"gear_backlash@v"}
    values = beam.points[best].values
    assert values["gear_backlash@v.gap"] == pytest.approx(6e-4, rel=0.1)
    assert values["gear_backlash@v.share"] == pytest.approx(0.4, abs=0.05)


def test_an_end_stop_that_is_touched_once_is_worth_a_fit():
    """It shows in a few samples, far off: as outliers they would count for next to nothing."""
    reached = recorded(Truth(), seconds=20.0, seed=4)[0].outputs["position"].values
    stop = float(reached.max()) - 0.003
    truth = Truth(force=lambda x, v, t: -800.0 * (x - stop) - 10.0 * v if x > stop else 0.0)
    core = cored(recorded(truth, seconds=20.0, seed=4), "end_stop@v", "end_stop.upper@v")
    scores = Screen(core, core.base, Beam(core).shapes).all(core.candidates, {})
    assert max(s.gain for s in scores) > WORTH


def late(u: np.ndarray) -> np.ndarray:
    """A command 0.09 s late, at the step of the truth."""
    return np.concatenate([np.zeros(900), u[:-900]])


def test_two_effects_that_are_needed_together_are_found_where_the_disturbance_is_quiet():
    truth = Truth(**coulomb(2.0), inputs=late)
    keys = FRICTION, "input_delay@force", "quadratic_drag@v", "sensor_scale@velocity"
    beam = Beam(cored(recorded(truth, seconds=20.0, seed=4), *keys))
    assert beam.core.slow is not None
    singles = Screen(beam.core, beam.core.slow, beam.shapes).all(beam.core.candidates, {})
    first = next(quiet.grown(beam, beam.core.slow, singles))
    assert {a.key for a in first.present} == {FRICTION, "input_delay@force"}
    assert first.values["input_delay@force.delay"] == pytest.approx(0.09, abs=2e-3)


# ---------------------------------------------------------------- fit


def test_the_gradient_is_that_of_the_loss(friction: Beam):
    core = friction.core
    free = [*core.base_free, *core.noise_free]
    values = core.base.values | {"mass": 2.2}
    found = core.fitter.innovations(values, (), own=True)
    assert found is not None
    slopes = core.fitter.columns(values, (), free, *found, own=True)
    assert slopes is not None
    gradient, information = core.fitter.score(*found, *slopes)
    assert np.all(np.linalg.eigvalsh(information) > -1e-6)
    for j, f in enumerate(free):
        around = [f.value(f.coordinate(values[f.name]) + d) for d in (-1e-4, 1e-4)]
        if values[f.name] in around:
            continue  # at its limit
        sides = []
        for sign in (1.0, -1.0):
            there = values | {f.name: f.value(f.coordinate(values[f.name]) + sign * 1e-4)}
            other = core.fitter.innovations(there, (), own=True)
            assert other is not None
            sides.append(core.fitter.loss(*other).sum())
        by_differences = (sides[0] - sides[1]) / 2e-4
        assert gradient[j] == pytest.approx(by_differences, rel=0.02, abs=0.05), f.name


@pytest.mark.parametrize(
    ("tolerance", "ratio", "known"), [(None, 0.7, False), (10.0, np.log(11.0), False), (0.02, None, True)]
)
def test_how_far_off_a_start_may_be_is_its_tolerance(tolerance, ratio, known):
    v = Variable("damping", "1/s", "", start=3.0, min=0.0, max=300.0, tolerance=tolerance)
    free = FreeParameters._base(v)
    assert free is not None
    assert stated(v) is known
    assert free.value(1.0) == pytest.approx(3.0 * np.exp(ratio) if ratio else 3.06)


def test_a_fit_far_off_its_noise_arrives_in_a_few_steps(friction: Beam):
    core = friction.core
    quiet = {n: 0.01 * v for n, v in core.base.values.items() if n.startswith(NOISES) and "tau" not in n}
    start = core.base.values | quiet | {"mass": 4.0}
    few, many = (core.fitter.fit(start, (), core.base_free, n, own=True) for n in (4, 60))
    assert few is not None
    assert many is not None
    begun = core.fitter.at(start, (), core.base_free, True)
    assert begun is not None
    assert begun.total - few.total > 0.9 * (begun.total - many.total) > 100.0


def test_a_parameter_at_its_limit_leaves_the_fit_and_what_is_projected_out(friction: Beam):
    core = friction.core
    tight = [replace(f, high=1.9) if f.name == "mass" else f for f in core.base_free]  # the data ask for 2
    start = core.base.values | {"mass": 1.9}
    point = core.fitter.fit(start, (), [*tight, *core.noise_free], own=True)
    assert point is not None
    at = [f.name for f in point.free].index("mass")
    assert point.values["mass"] == pytest.approx(1.9)
    assert point.held[at]
    assert not point.covariance()[at].any()
    screen = Screen(core, point, friction.shapes)
    assert screen.de.shape[1] == len(point.free) - int(point.held.sum())


def test_a_known_parameter_stays_within_its_tolerance_where_the_data_say_little():
    folder = rig()
    known = [replace(v, tolerance=0.001) if v.name == "mass" else v for v in folder.model.parameters]
    tight = replace(folder, model=replace(folder.model, parameters=tuple(known)))
    core = Core(tight, split(recorded(Truth(mass=2.3), seconds=12.0), (), ()), ())
    assert core.base.values["mass"] == pytest.approx(2.0, abs=0.06)
    assert Core(folder, core.parts, ()).base.values["mass"] == pytest.approx(2.3, abs=2e-3)


def test_what_a_stated_parameter_cannot_be_is_named_though_it_moves_nothing_of_its_own():
    folder = rig()
    known = [replace(v, tolerance=0.02) if v.name == "mass" else v for v in folder.model.parameters]
    stated = replace(folder, model=replace(folder.model, parameters=tuple(known)))
    catalogue = [e for e in ALL if e.name in ("payload_mass", "coulomb_friction")]
    beam = Beam(Core(stated, split(recorded(Truth(mass=2.8), seconds=12.0), (), ()), catalogue))
    beam.run()
    judged = Judge(beam).decide()
    (payload,) = judged.answer
    assert payload.effect.name == "payload_mass"
    assert beam.points[judged.answer].values[payload.name("inertia")] == pytest.approx(0.8, abs=0.1)


def test_coordinates_and_limits_of_a_parameter():
    for f in (Free("a", 2.0, 0.7, True, 1.0, 5.0), Free("b", 2.0, 0.7, False, 1.0, 5.0)):
        assert f.value(f.coordinate(3.3)) == pytest.approx(3.3)
        assert (f.value(-9.0), f.value(9.0)) == (1.0, 5.0)
        assert f.slope(3.3) == pytest.approx((f.value(f.coordinate(3.3) + 1e-6) - 3.3) / 1e-6, rel=1e-4)


# ---------------------------------------------------------------- sets and probabilities


def test_what_was_put_in_has_the_best_score_and_is_the_answer(friction: Beam):
    best = friction.scores(frozenset())[0]
    assert best.attached.key == FRICTION
    judged = Judge(friction).decide()
    assert [a.key for a in judged.answer] == [FRICTION]
    point = friction.points[judged.answer]
    error = standard_errors(point)[f"{FRICTION}.Fc"]
    assert point.values[f"{FRICTION}.Fc"] == pytest.approx(1.0, abs=max(5.0 * error, 0.03))


def test_probabilities_are_probabilities_and_the_same_twice(friction: Beam):
    first = friction.posterior()
    assert sum(first.values()) == pytest.approx(1.0)
    assert min(first.values()) >= 0.0
    assert friction.posterior() == first
    judged = Judge(friction).decide()
    assert judged == Judge(friction).decide()
    assert sum(p for _, p in judged.sets) <= 1.0 + 1e-9
    assert all(0.0 <= p <= 1.0 for p in [*judged.probability.values(), *judged.kinds.values()])
    assert judged.probability["coulomb_friction"] > 0.9


def test_sets_lose_what_is_turned_down_and_a_kind_stays_sure_where_nothing_is_left(friction, monkeypatch):
    key, own = fitted(friction, [FRICTION, "stiffness@v"]), fitted(friction, [FRICTION])
    monkeypatch.setattr(judges, "_simplest", lambda beam: {key: 1.0})
    monkeypatch.setattr(Judge, "_earning", lambda self, key, kinds: (own, []))
    judged = Judge(friction).decide()
    assert (judged.answer, judged.sets, judged.kinds) == (
        own,
        [(("coulomb_friction",), 1.0)],
        {"friction": 1.0},
    )
    monkeypatch.setattr(Judge, "_earning", lambda self, key, kinds: (frozenset(), []))
    judged = Judge(friction).decide()
    assert (judged.answer, judged.kinds["friction"]) == (frozenset(), 1.0)


def test_no_kind_is_sure_where_its_likeliest_set_leaves_most_of_the_error(friction: Beam, monkeypatch):
    own = fitted(friction, [FRICTION])
    monkeypatch.setattr(judges, "_simplest", lambda beam: {own: 1.0})
    monkeypatch.setattr(Judge, "_earning", lambda self, key, kinds: (frozenset(), []))
    monkeypatch.setattr(Judge, "_left", lambda self, key: 0.8)
    judged = Judge(friction).decide()
    assert judged.kinds == {"friction": judges.DOUBTED}
    assert judged.sure_kind is None


@pytest.mark.parametrize(
    ("wide", "because"), [(True, "its interval holds nothing at all"), (False, "it was not fitted to")]
)
def test_what_may_be_nothing_or_does_not_shorten_the_error_ahead_is_refused(
    friction: Beam, monkeypatch, wide: bool, because: str
):
    key = fitted(friction, [FRICTION, "constant_load@v"])
    if not wide:  # as if the interval were narrow
        monkeypatch.setattr(Judge, "_unfit", lambda self, key, a: None)
    kept, refused = Judge(friction)._earning(key, {"friction": 1.0, "load": 0.5})
    assert [a.key for a in kept] == [FRICTION]
    assert [(r.effect, r.port) for r in refused] == [("constant_load", "v")]
    assert because in refused[0].because


# ---------------------------------------------------------------- any pace, any model


def paced(folder: Folder, factor: float) -> Folder:
    """The rig with its time scaled: mass by the square, drag by the factor, so that forces stay."""
    by = {"mass": factor**2, "drag": factor}

    def scaled(v: Variable) -> Variable:
        f = by[v.name]
        return replace(v, start=f * v.start, min=f * (v.min or 0.0), max=f * (v.max or 0.0))

    model = folder.model
    parameters = tuple(scaled(v) for v in model.parameters)
    return replace(folder, model=replace(model, parameters=parameters, step=factor * model.step))


def slowed(run: Run, factor: float) -> Run:
    """A run of the same motion, `factor` times as long."""
    inputs = {n: Signal(factor * s.time, s.values) for n, s in run.inputs.items()}
    outputs = {
        n: Signal(factor * s.time, s.values / (factor if n == "velocity" else 1.0))
        for n, s in run.outputs.items()
    }
    return Run(run.name, factor * run.start_s, factor * run.end_s, inputs, outputs)


@pytest.mark.parametrize("factor", [200.0, 5e-4], ids=["a sample every 4 s", "every 10 us"])
def test_an_answer_does_not_depend_on_the_unit_of_time(friction: Beam, factor: float):
    (run,) = friction.core.runs
    catalogue = [e for e in ALL if e.key in {k.partition("@")[0] for k in FEW}]
    parts = split([slowed(run, factor)], (), ())
    core = Core(paced(friction.core.folder, factor), parts, catalogue)
    beam = Beam(core)
    beam.run()
    here, there = Judge(friction).decide(), Judge(beam).decide()
    assert {a.key for a in there.answer} == {a.key for a in here.answer}
    mine, other = friction.points[here.answer], beam.points[there.answer]
    assert other.values[f"{FRICTION}.Fc"] == pytest.approx(mine.values[f"{FRICTION}.Fc"], rel=0.01)
    assert other.values["mass"] == pytest.approx(factor**2 * mine.values["mass"], rel=0.01)
    assert there.probability["coulomb_friction"] == pytest.approx(
        here.probability["coulomb_friction"], abs=0.1
    )


def cooled(heat: bool, seed: int = 1, period: float = 0.5) -> Run:
    """A body whose time constant is 40 s instead of 30 s, sampled at a pace of its own."""
    rng, time = np.random.default_rng(seed), period * np.arange(400)
    u = 20.0 * (np.sin(0.05 * time) > 0.3) if heat else np.zeros(len(time))
    y = np.empty(len(time))
    y[0] = 20.0
    for k in range(len(time) - 1):
        y[k + 1] = 0.5 * u[k] + (y[k] - 0.5 * u[k]) * np.exp(-period / 40.0)
    y += 0.02 * rng.standard_normal(len(time))
    return models.run({"heat": (time, u)} if heat else {}, {"temperature": (time, y)})


def test_a_tank_is_fitted_from_empty_on_where_its_outflow_has_a_slope_without_end():
    time, level = 0.2 * np.arange(300), np.zeros(300)
    flow = np.where(time < 30.0, 0.03, 0.01)
    for k in range(299):
        for _ in range(50):
            level[k + 1] = (level[k + 1] or level[k]) + 0.004 * (
                flow[k] - 0.08 * np.sqrt(level[k + 1] or level[k])
            )
    level += 1e-4 * np.random.default_rng(2).standard_normal(300)
    run = models.run({"flow": (time, flow)}, {"level": (time, level)})
    core = Core(models.tank(), split([run], (), ()), ())
    assert core.base.values["outflow"] == pytest.approx(0.08, rel=0.02)


@pytest.mark.parametrize("driven", [True, False], ids=["with a heater", "without inputs"])
def test_a_model_of_one_state_is_fitted_with_inputs_and_without(driven: bool):
    core = Core(models.cooling(driven), split([cooled(driven)], (), ()), ())
    assert core.base.values["time"] == pytest.approx(40.0, rel=0.02)
    error = standard_errors(core.base)["time"]
    assert abs(core.base.values["time"] - 40.0) < 5.0 * error


@pytest.mark.parametrize(("factor", "asked"), [(1.0, ""), (1e3, "0.001 times"), (1e-3, "1000 times")])
def test_the_unit_of_an_output_is_asked_for_without_axes_too(factor: float, asked: str):
    run = cooled(True)
    shown = {n: replace(x, values=factor * x.values) for n, x in run.outputs.items()}
    core = Core(models.cooling(), split([replace(run, outputs=shown)], (), ()), ())
    said = mistaken.evident(core, {})
    assert f"column temperature: {asked}" in said if asked else said == ""


def test_the_zero_of_a_temperature_is_asked_for():
    run = cooled(True)
    shown = {n: replace(x, values=x.values - 273.15) for n, x in run.outputs.items()}
    said = mistaken.evident(Core(models.cooling(), split([replace(run, outputs=shown)], (), ()), ()))
    assert "column temperature: with +273.15, the model errs by" in said


def test_what_falls_at_a_constant_speed_is_in_no_other_unit():
    time = np.arange(0.0, 17.0, 0.05)
    height = 80.0 - 4.7 * time + 0.1 * np.random.default_rng(2).standard_normal(len(time))
    run = models.run({}, {"height": (time, height)})
    assert mistaken.evident(Core(models.falling(), split([run], (), ()), ())) == ""


@pytest.mark.parametrize(("shown", "asked"), [(np.abs, True), (lambda v: np.maximum(v, 0.0) + 5.0, False)])
def test_a_sensor_of_magnitudes_is_asked_where_its_output_turns_at_nothing(shown, asked: bool):
    core = cored(recorded(Truth(velocity=shown), seconds=10.0), "absolute_value_sensor@velocity")
    assert ("absolute_value_sensor@velocity" in {a.key for a in core.candidates}) == asked


def test_nats_of_turned_channels_are_those_of_the_model():
    core = Core(models.cooling(), split([cooled(True)], (), ()), ())
    same = mistaken._fit(core, multiplied(1.0, "heat"), core.fresh, (), np.inf)
    assert same is not None
    assert same[1].total == pytest.approx(core.base.total, abs=0.5)


@pytest.mark.parametrize(("lag", "named"), [(8.0, {"sensor_lag@temperature"}), (0.0, set())])
def test_a_sensors_lag_is_named_without_an_input_where_there_is_one(lag: float, named: set[str]):
    time = np.arange(0.0, 200.0, 1.25)
    values = 20.0 * np.exp(-time / 40.0)
    shown = 40.0 / (40.0 - lag) * values - 20.0 * lag / (40.0 - lag) * np.exp(-time / lag) if lag else values
    shown = shown + 0.02 * np.random.default_rng(3).standard_normal(len(time))
    run = models.run({}, {"temperature": (time, shown)})
    beam = Beam(Core(models.cooling(driven=False), split([run], (), ())))
    beam.run()
    assert {a.key for a in Judge(beam).decide().answer} == named


def test_missing_samples_move_a_fit_by_no_more_than_its_errors():
    run = cooled(True)
    s = run.outputs["temperature"]
    keep = np.random.default_rng(2).random(len(s.time)) > 0.3
    fewer = replace(run, outputs={"temperature": Signal(s.time[keep], s.values[keep])})
    whole, part = (Core(models.cooling(), split([r], (), ()), ()).base for r in (run, fewer))
    error = standard_errors(part)["time"]
    assert abs(whole.values["time"] - part.values["time"]) < 4.0 * error


def test_dry_friction_stands_in_a_loads_place_whatever_its_score():
    core = cored(
        recorded(Truth(static=(1.2, 1.2)), seconds=8.0),
        "constant_load@v",
        "coulomb_friction@v",
        "stiffness@v",
    )
    beam = Beam(core)
    key = fitted(beam, ["constant_load@v"])
    (load,) = key
    (twin,) = beam.swaps.twins(key, load)
    assert [a.key for a in twin] == ["coulomb_friction@v"]
    assert twin in beam.points


def test_what_an_effect_covers_is_not_asked_beside_it(friction: Beam):
    core = Core(friction.core.folder, friction.core.parts, ALL)
    beam = Beam(core)
    by_key = {a.key: a for a in core.candidates}
    for larger, smaller in (
        ("asymmetric_coulomb_friction@v", FRICTION),
        ("stribeck_friction@v", FRICTION),
        ("asymmetric_viscous_friction@v", "viscous_friction@v"),
    ):
        for one, other in ((larger, smaller), (smaller, larger)):
            assert by_key[other] not in beam.beside(frozenset({by_key[one]}))
        assert by_key["quadratic_drag@v"] in beam.beside(frozenset({by_key[larger]}))


def test_a_clock_that_gains_a_thousandth_is_the_first_to_be_asked():
    gains, runs = 1e-3, recorded(Truth(), seconds=20.0, seed=6)
    late = [
        replace(r, outputs={n: _gaining(s, gains * (s.time - r.began_s)) for n, s in r.outputs.items()})
        for r in runs
    ]
    beam = Beam(cored(late, "clock_drift@all outputs", *FEW))
    beam.points[frozenset()] = beam.core.base
    first = beam.scores(frozenset())[0]
    assert first.attached.key == "clock_drift@all outputs"
    key = fitted(beam, [first.attached.key])
    assert beam.points[key].values[first.attached.name("drift")] == pytest.approx(gains, rel=0.1)


def _gaining(signal: Signal, delay_s: np.ndarray) -> Signal:
    """A signal that comes ever later."""
    return replace(signal, values=np.interp(signal.time - delay_s, signal.time, signal.values))
