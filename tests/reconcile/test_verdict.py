"""Which verdict comes first, and how well what agrees agrees."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reconcile.catalogue import Scales, freeform
from reconcile.equations.model import Attached, candidates
from reconcile.errors import ahead as errors
from reconcile.filter.point import Free, standard_errors
from reconcile.judging import answer as answers, judge as judges, mistaken, verdict as verdicts
from reconcile.judging.judge import Judged
from reconcile.judging.refused import Refused, no_shaft
from reconcile.search.free import LATEST, FreeParameters


@pytest.mark.parametrize(
    ("still", "beyond", "known", "name", "said"),
    [
        (["input u is constant"], 9.0, 0.9, "insufficient_excitation", "input u is constant"),
        (["input u is constant"], 9.0, 0.1, "unexplained", "errs by 5"),
        (["input u is constant"], 0.4, 0.1, "agrees", "within the noise, 0.5 s ahead"),
        ([], 9.0, 0.9, "unexplained", "errs by 5"),
        ([], 2.4, 0.9, "insufficient_excitation", "nothing tells drag"),
        ([], 2.4, 0.1, "agrees", "within 2.4 times the noise"),
        ([], 0.4, 0.1, "agrees", "within the noise, 0.5 s ahead"),
    ],
)
def test_an_error_left_is_said_before_too_little_excitation(
    monkeypatch, still: list[str], beyond: float, known: float, name: str, said: str
):
    monkeypatch.setattr(verdicts, "still_outputs", lambda core: [])
    monkeypatch.setattr(verdicts, "still_inputs", lambda core: still)
    monkeypatch.setattr(verdicts, "beyond_noise", lambda core, point: beyond)
    monkeypatch.setattr(verdicts, "beyond_sensors", lambda core, point: 0.05)
    monkeypatch.setattr(verdicts, "moved_parameters", lambda answer: {})
    monkeypatch.setattr(verdicts, "combined", lambda core: [])
    core: Any = SimpleNamespace(
        known=lambda point: {"drag": known}, disturbances=lambda values: {"v": 0.1}, memory_s=0.5, period=0.01
    )
    answer: Any = SimpleNamespace(
        core=core,
        point=SimpleNamespace(values={}),
        present=(),
        judged=Judged(frozenset(), (), {}, {}, [], {}, []),
    )
    answer.beam = SimpleNamespace(points={frozenset(): answer.point})
    found = verdicts.judge(answer)
    assert found.name == name
    assert said in found.sentence


@pytest.mark.parametrize(("moves", "still"), [(0.0, ["position", "speed"]), (1.0, [])])
def test_one_output_that_moves_is_excitation(moves: float, still: list[str]):
    """A noisy sensor beside one that tells of the motion is no lack of it."""
    noise = np.random.default_rng(1).standard_normal(50)
    outputs = {"position": noise + moves * np.arange(50.0), "speed": noise}
    run = SimpleNamespace(outputs={n: SimpleNamespace(values=v) for n, v in outputs.items()})
    core: Any = SimpleNamespace(
        outputs=list(outputs),
        floors=dict.fromkeys(outputs, SimpleNamespace(level=1.0)),
        parts=SimpleNamespace(fit=[SimpleNamespace(run=run)]),
    )
    found = verdicts.still_outputs(core)
    assert [text.split()[1] for text in found] == still


def test_what_a_fit_takes_for_noise_beyond_the_sensors_own_is_error(monkeypatch):
    core: Any = SimpleNamespace(outputs=["y"], floors={"y": SimpleNamespace(level=0.1)}, spread={"y": 1.0})
    core.noise = lambda values, output: values[f"noise of {output}"]
    monkeypatch.setattr(errors, "squares", lambda core, point: (0.17, 0.16))  # as the fitted noise says
    swallowed: Any = SimpleNamespace(values={"noise of y": 0.4})
    assert errors.beyond_noise(core, swallowed) == pytest.approx(4.0)
    monkeypatch.setattr(errors, "squares", lambda core, point: (0.009, 0.01))
    quiet: Any = SimpleNamespace(values={"noise of y": 0.1})
    assert errors.beyond_noise(core, quiet) == 0.0


def test_no_delay_is_as_long_as_the_recording(rig):
    late = [a for a in candidates(rig, [*rig.ports.controls, *rig.ports.outputs]) if a.effect.delays]
    assert late
    scales = {a.port: Scales(period_s=0.1, memory_s=1.0) for a in late}
    for a in late:
        for f in FreeParameters(rig, duration_s=40.0, memory_s=1.0).of_effect(a, scales):
            assert f.high <= LATEST * 40.0 or not f.name.endswith("delay")


@pytest.mark.parametrize(
    ("nats", "errors", "alike"),
    [
        (3.0, (0.01, 0.02), True),  # both below the noise: nothing ahead tells them apart
        (30.0, (0.01, 0.02), False),  # but the samples do
        (3.0, (0.10, 0.20), False),
        (30.0, (0.10, 0.101), True),
    ],
)
def test_one_lag_in_two_places_is_told_by_what_is_above_the_noise(
    rig, monkeypatch, nats: float, errors: tuple[float, float], alike: bool
):
    every = candidates(rig, [*rig.ports.controls, *rig.ports.outputs])
    here, there = (
        next(frozenset({a}) for a in every if a.effect.name == n) for n in ("sensor_lag", "input_lag")
    )
    beam: Any = SimpleNamespace(core=None, points={here: None, there: None}, ranked=lambda: [here, there])
    beam.joint = {here: 0.0, there: -nats}.__getitem__
    monkeypatch.setattr(judges, "noise", lambda core, point: 0.03)
    judge = judges.Judge(beam)
    monkeypatch.setattr(judge, "ahead", dict(zip((here, there), errors, strict=True)).__getitem__)
    assert judge._alike(here) == ([there] if alike else [])


def test_what_lies_at_its_limit_has_an_interval_too():
    free = tuple(Free(n, 0.0, 2.0, False, low=0.0) for n in ("steep", "flat", "inside"))
    point: Any = SimpleNamespace(
        free=free,
        values={"steep": 0.0, "flat": 0.0, "inside": 1.0},
        held=np.array([True, True, False]),
        gradient=np.array([30.0, 0.0, 0.0]),
        information=np.diag([0.0, 3.0, 3.0]),
        covariance=lambda: np.diag([0.0, 0.0, 0.25]),
    )
    found = standard_errors(point)
    assert 1.96 * found["steep"] == pytest.approx(2.0 * 0.1)  # three nats
    assert found["flat"] == found["inside"] == pytest.approx(1.0)


def test_an_interval_holds_the_values_of_other_sets_that_may_be_true(monkeypatch):
    own, other, without = (
        SimpleNamespace(values={"k": v, "a": 1.0}, errors=e)
        for v, e in ((26.0, {"k": 0.2, "a": 0.1}), (30.0, {"k": 0.3, "a": 0.05}), (99.0, {"b": 1.0}))
    )
    monkeypatch.setattr(answers, "standard_errors", lambda point: point.errors)
    core = SimpleNamespace(base=None)
    beam: Any = SimpleNamespace(core=core, points={1: own, 2: other, 3: without})

    def interval(name: str, posterior: dict[int, float]):
        judged: Any = SimpleNamespace(answer=1, posterior=posterior, point=None, alone=False)
        return answers.Answer(beam.core, beam, judged).interval(name)

    either = {1: 0.3, 2: 0.3, 3: 0.4}
    assert interval("k", either) == pytest.approx((26.0 - 0.392, 30.0 + 1.645 * 0.3), abs=0.01)
    assert interval("a", either) == pytest.approx((1.0 - 0.196, 1.0 + 0.196))  # at least its own fit's
    assert interval("k", {1: 1.0}) == pytest.approx((26.0 - 0.392, 26.0 + 0.392), abs=1e-3)
    rare = interval("k", {1: 0.99, 2: 0.01})
    assert rare == pytest.approx((26.0 - 0.392, 26.0 + 0.45), abs=0.02)  # what is unlikely hardly counts


def test_what_was_turned_down_is_said_where_nothing_is_named():
    refused = [
        Refused(n, "v", f"takes {k} %")
        for k, n in enumerate(("stiffness", "viscous_friction", "coulomb_friction", "viscous_friction"))
    ]
    assert verdicts._turned_down(refused) == (
        " Likeliest, but turned down: viscous_friction (takes 3 %) and coulomb_friction (takes 2 %)."
    )
    alike = [replace(r, because="takes nothing") for r in refused[:2]]
    said = " Beside it: stiffness and viscous_friction (each: takes nothing)."
    assert verdicts._turned_down(alike, " Beside it") == said
    said = " Likeliest, but turned down: a force over the speed (axis w) (takes nothing)."
    assert verdicts._turned_down([Refused("speed_curve", "w", "takes nothing")]) == said
    assert verdicts._turned_down([]) == ""


def test_a_parameter_of_an_effect_at_its_limit_is_said(rig):
    (shaft,) = (
        a
        for a in candidates(rig, [*rig.ports.controls, *rig.ports.outputs])
        if a.key == "structural_compliance@v"
    )
    values = {shaft.name(n): v for n, v in (("k", 3.0), ("c", 0.1), ("share", 0.98))}
    point = SimpleNamespace(limited={shaft.name("share")}, values=values)
    answer: Any = SimpleNamespace(point=point, named=(shaft,))
    said = "share of structural_compliance lies at its limit, 0.98: it may stand for something else."
    assert mistaken.bounded_effects(answer) == said
    point.limited = set()
    assert mistaken.bounded_effects(answer) == ""


@pytest.mark.parametrize(
    ("gained", "value", "idle"), [(8.0, 0.9, True), (25.0, 0.9, False), (8.0, 2.1, False)]
)
def test_what_gains_much_is_there_whatever_its_interval_holds(
    rig, monkeypatch, gained: float, value: float, idle: bool
):
    friction = next(a for a in candidates(rig, [*rig.ports.outputs]) if a.key == "coulomb_friction@v")
    name, key = friction.name("Fc"), frozenset({friction})
    point = SimpleNamespace(values={name: value}, limited=set(), loss=0.0)
    monkeypatch.setattr(judges, "standard_errors", lambda point: {name: 1.0})
    beam: Any = SimpleNamespace(core=None, points={key: point, frozenset(): SimpleNamespace(loss=gained)})
    refused = judges.Judge(beam)._unfit(key, friction)
    assert (refused.because if refused else "") == ("its interval holds nothing at all" if idle else "")


@pytest.mark.parametrize("held", [True, False])
def test_a_shaft_with_hardly_any_inertia_on_one_end_is_none(rig, held: bool):
    shaft = next(a for a in candidates(rig, [*rig.ports.controls, *rig.ports.outputs]) if a.effect.shaft)
    name, key = shaft.name("share"), frozenset({shaft})
    point = SimpleNamespace(values={name: 0.98}, limited={name} if held else set(), loss=0.0)
    beam: Any = SimpleNamespace(core=None, points={key: point, frozenset(): SimpleNamespace(loss=500.0)})
    assert judges.Judge(beam)._unfit(key, shaft) == (no_shaft(shaft) if held else None)


@pytest.mark.parametrize(
    ("probability", "kinds", "said"),
    [
        ({"input_dead_zone": 0.88}, {}, "no effect is sure to explain it"),
        ({"input_dead_zone": 0.3}, {}, "no effect explains it"),
        ({"input_delay": 0.4, "sensor_lag": 0.4}, {"delay": 0.95}, "no effect is sure to explain it"),
    ],
)
def test_what_is_likely_is_not_said_to_explain_nothing(monkeypatch, probability, kinds, said: str):
    monkeypatch.setattr(verdicts, "beyond_sensors", lambda core, point: 0.2)
    core: Any = SimpleNamespace(disturbances=lambda values: {"v": 0.1})
    judged = Judged(frozenset(), (), probability, kinds, [], {}, [])
    beam = SimpleNamespace(points={frozenset(): SimpleNamespace(values={})})
    answer: Any = SimpleNamespace(core=core, point=None, judged=judged, beam=beam)
    sentence = verdicts._unexplained(answer)
    assert f"over its own time, and {said};" in sentence
    assert ("; its kind is sure: delay." in sentence) == bool(kinds)


@pytest.mark.parametrize(
    ("beyond", "left", "share"),
    [(9.0, 0.3, 0.6), (9.0, 0.1, 0.2), (2.0, 0.3, 0.0)],
    ids=["most of it", "little of it", "noise"],
)
def test_how_much_of_the_gap_an_answer_leaves(monkeypatch, beyond: float, left: float, share: float):
    monkeypatch.setattr(judges, "beyond_noise", lambda core, point: beyond)
    judge = judges.Judge(SimpleNamespace(core=None, points={frozenset({1}): None}))  # type: ignore[arg-type]
    monkeypatch.setattr(judge, "ahead", {frozenset({1}): left, frozenset(): 0.5}.__getitem__)
    assert judge._left(frozenset({1})) == pytest.approx(share)  # type: ignore[arg-type]


@pytest.mark.parametrize(("behind", "kept"), [(-3.0, True), (5.0, False)])
def test_effects_that_are_as_likely_as_a_curve_take_its_place(rig, behind: float, kept: bool):
    friction = next(a for a in candidates(rig, [*rig.ports.outputs]) if a.key == "coulomb_friction@v")
    form = next(e for e in freeform.FORMS if e.name == "friction_curve")
    curve, effect = frozenset({Attached(form, "v")}), frozenset({friction})
    beam: Any = SimpleNamespace(core=None, nearest=lambda key: (effect, behind))
    posterior = {curve: 0.96, effect: 0.03, frozenset(): 0.01}
    found, refused = judges.Judge(beam)._by_effects(posterior)
    assert found == ({effect: pytest.approx(1.0)} if kept else posterior)
    assert [r.effect for r in refused] == (["friction_curve"] if kept else [])


@pytest.mark.parametrize(
    ("value", "tolerance", "said"),
    [(1.12, 0.05, True), (0.8, 0.05, False), (14.0, 2.0, False), (22.0, 2.0, True)],
)
def test_a_parameter_far_beyond_its_tolerance_is_said(
    monkeypatch, value: float, tolerance: float, said: bool
):
    monkeypatch.setattr(mistaken, "standard_errors", lambda point: {"gain": 0.01})
    model = SimpleNamespace(parameters=[SimpleNamespace(name="gain", start=0.7, tolerance=tolerance)])
    answer: Any = SimpleNamespace(
        point=SimpleNamespace(values={"gain": value}), core=SimpleNamespace(model=model)
    )
    known = " with a tolerance of 0.05" if tolerance < 1.0 else ""
    text = f"gain comes out at {value:g} instead of 0.7{known}: are its unit and"
    assert mistaken.far_parameters(answer).startswith(text) is said


@pytest.mark.parametrize(("value", "said"), [(78.7, True), (40000.0, True), (400.0, False)])
def test_a_parameter_that_comes_out_ten_times_off_is_said(monkeypatch, value: float, said: bool):
    monkeypatch.setattr(mistaken, "standard_errors", lambda point: {"tau": 1.0, "loose": 1e5})
    parameters = [
        SimpleNamespace(name=n, start=s, tolerance=None) for n, s in (("tau", 3000.0), ("loose", 1.0))
    ]
    point = SimpleNamespace(values={"tau": value, "loose": 1e5})
    answer: Any = SimpleNamespace(
        point=point, core=SimpleNamespace(model=SimpleNamespace(parameters=parameters))
    )
    found = mistaken.far_parameters(answer)
    assert found == (
        f"tau comes out at {value:.4g} instead of 3000: are its unit and those of the columns right?"
        if said
        else ""
    )
