"""Where the likelihood names nothing: effects that the model by itself asks for."""

from dataclasses import replace

import numpy as np
import pytest

from reconcile import words
from reconcile.filter.point import Point
from reconcile.judging import by_itself
from reconcile.judging.answer import Answer
from reconcile.judging.by_itself import ByItself
from reconcile.judging.verdict import judge
from reconcile.reporting.findings import gather
from reconcile.search.alone import alone, fit
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.tolerances import ALONE
from tests.reconcile.answers import cored, judged, recorded
from tests.reconcile.truth import Truth

FRICTION = "coulomb_friction@v"


@pytest.fixture(scope="module")
def unnamed() -> Answer:
    """The rig with dry friction of 1.2 N that its model has not; nothing is named."""
    truth = Truth(static=(1.2, 1.2), kinetic=lambda v: 1.2 * np.sign(v))
    core = cored(recorded(truth, seconds=12.0), FRICTION, "stiffness@v", "constant_load@v")
    return answering(core, frozenset())


def answering(core: Core, key: frozenset) -> Answer:
    """An answer, whatever the recordings say."""
    beam = Beam(core)
    beam.points = {frozenset(): core.base, key: core.base}
    return Answer(core, beam, judged(beam, key))


def unchanged(given: Answer) -> bool:
    """Whether an answer stays what it is, and nothing is said of it."""
    found = ByItself(given)
    return found.answer is given and not found.said


def test_the_effect_that_takes_most_of_the_error_of_the_model_by_itself_is_the_answer(unnamed: Answer):
    found = ByItself(unnamed)
    (friction,) = found.answer.present
    assert friction.key == FRICTION
    assert found.answer.judged.probability == {"coulomb_friction": ALONE}
    assert found.answer.judged.kinds == {"friction": ALONE}
    assert found.answer.point.values[friction.name("Fc")] == pytest.approx(1.2, rel=0.05)
    low, high = found.answer.interval(friction.name("Fc"))
    assert low < 1.2 < high
    assert judge(found.answer).name == "named"
    assert found.said.startswith("That rests on the model by itself, without any disturbance: it errs by ")


def test_its_gap_is_that_of_the_model_by_itself(unnamed: Answer):
    answer = ByItself(unnamed).answer
    assert answer.base is alone(unnamed.core)[0]
    gaps = gather(answer)
    assert gaps.gap("after", "position") < 0.3 * gaps.gap("reestimated", "position")
    assert gaps.gap("reestimated", "position") <= 1.01 * gaps.gap("nominal", "position")


def test_effects_that_explain_as_much_share_its_probability(unnamed: Answer, monkeypatch):
    monkeypatch.setattr(by_itself, "ALIKE", 10.0)
    monkeypatch.setattr(by_itself, "TOLD", {1: -10.0})
    monkeypatch.setattr(by_itself, "LESS", -10.0)
    answer = ByItself(unnamed).answer
    own = answer.judged.probability
    assert set(own) == {"coulomb_friction", "stiffness", "constant_load"}
    assert sum(own.values()) == pytest.approx(ALONE)
    assert [a.key for a in answer.present] == [FRICTION]
    assert judge(answer).name == "ambiguous"
    assert all(answer.beam.points[k].present for k in answer.alternatives)


@pytest.mark.parametrize("kinds", [{}, {"friction": 0.95}])
def test_what_explains_less_or_less_than_the_likelihood_knows_is_a_hint(unnamed: Answer, monkeypatch, kinds):
    unnamed = replace(unnamed, judged=replace(unnamed.judged, kinds=kinds))
    if not kinds:
        monkeypatch.setattr(by_itself, "TOLD", {})
    found = ByItself(unnamed)
    assert found.answer is unnamed
    assert found.said.startswith("A hint: by itself, without any disturbance, it errs by ")
    assert found.said.endswith(" with coulomb_friction (v).")


def test_a_kind_that_explains_less_by_itself_is_not_sure(unnamed: Answer):
    unnamed = replace(unnamed, judged=replace(unnamed.judged, kinds={"stiffness": 0.95}))
    found = ByItself(unnamed).answer
    assert found.judged.sure_kind is None
    assert [a.key for a in found.present] == [FRICTION]


def test_where_the_likelihood_sees_nothing_the_model_by_itself_is_asked_too(unnamed: Answer, monkeypatch):
    monkeypatch.setattr(ByItself, "_left", False)
    assert [a.key for a in ByItself(unnamed).answer.present] == [FRICTION]
    monkeypatch.setattr(by_itself, "fit", lambda *a: alone(unnamed.core)[0])  # none helps
    found = ByItself(unnamed)
    assert found.answer is unnamed
    assert found.said.startswith("By itself, from the beginning of a recording on, the model errs")


@pytest.mark.parametrize("far_off", ["ERRS", "NEAR"])
def test_a_model_that_is_near_by_itself_is_not_asked(unnamed: Answer, monkeypatch, far_off):
    monkeypatch.setattr(ByItself, "_left", False)
    monkeypatch.setattr(by_itself, far_off, 1e6)
    assert unchanged(unnamed)


def test_an_effect_has_to_show_in_each_part(unnamed: Answer, monkeypatch):
    plain, error = alone(unnamed.core)[0], ByItself._error

    def partly(self: ByItself, point: Point, parts=by_itself.PARTS) -> float:
        return error(self, plain if parts == ["confirm"] else point, parts)

    monkeypatch.setattr(ByItself, "_error", partly)
    assert ByItself(unnamed).answer is unnamed


def test_what_the_model_reaches_without_an_effect_is_not_the_effects(monkeypatch):
    """The fit without effects ended too early: those with one find the mass, which is all that was wrong."""
    core = cored(recorded(Truth(mass=2.3, drag=1.9), seconds=12.0), FRICTION, "stiffness@v")
    early = core.fitter.fit(core.base.values | {"mass": 1.2}, (), core.base_free, 0, own=True)
    monkeypatch.setattr(ByItself, "_plain", lambda self: early)
    given = answering(core, frozenset())
    found = ByItself(given)
    assert found.plain is early
    assert found.answer is given
    assert found.plain is not early
    assert found.plain is not None
    assert found.plain.values["mass"] == pytest.approx(2.3, rel=0.02)
    assert not found.said
    monkeypatch.setattr(ByItself, "_refitted_from", lambda self, key: False)
    assert ByItself(given).answer is not given


def test_nothing_is_asked_where_nothing_errs(unnamed: Answer, monkeypatch):
    monkeypatch.setattr(by_itself, "beyond_noise", lambda core, point: 1.0)
    assert unchanged(unnamed)
    monkeypatch.setattr(by_itself, "beyond_noise", lambda core, point: 9.0)
    monkeypatch.setattr(by_itself, "fit", lambda *a: alone(unnamed.core)[0])  # none helps
    assert unchanged(unnamed)


def test_beside_a_named_effect_there_are_hints_alone(unnamed: Answer):
    (friction,) = ByItself(unnamed).answer.present
    (stiffness,) = (a for a in unnamed.core.candidates if a.key == "stiffness@v")
    for own, hint in ((friction, False), (stiffness, True)):
        key = frozenset({own})
        named = answering(unnamed.core, key)
        named.beam.points[key] = ByItself(unnamed).points[key]
        found = ByItself(named)
        assert found.answer is named
        assert found.said.endswith(" with coulomb_friction (v) beside that.") is hint


def test_two_simple_effects_are_told_beside_one_that_is_as_simple(monkeypatch):
    """Dry friction and a load are friction that differs by direction: all have two parameters."""
    truth = Truth(static=(1.5, 0.1), kinetic=lambda v: 0.8 * np.sign(v) + 0.7)
    lacks = "asymmetric_coulomb_friction", "coulomb_friction", "constant_load"
    monkeypatch.setattr(by_itself, "TOLD", {1: 0.95, 2: 0.95})  # the load alone takes more than two thirds
    given = answering(cored(recorded(truth, seconds=12.0), *(f"{n}@v" for n in lacks)), frozenset())
    answer = ByItself(given).answer
    sets = {tuple(sorted(a.effect.name for a in k)) for k in (answer.judged.answer, *answer.alternatives)}
    assert sets == {lacks[:1], ("constant_load", "coulomb_friction")}
    assert answer.judged.probability == pytest.approx(dict.fromkeys(lacks, ALONE / 2.0))
    assert answer.judged.kinds == pytest.approx({"friction": ALONE, "load": ALONE / 2.0})
    assert dict(answer.judged.sets) == pytest.approx(dict.fromkeys(sets, ALONE / 2.0))
    assert all(gained > 0.0 and less > 0.5 for gained, less in answer.judged.gains.values())


def test_what_the_likelihood_prefers_is_told_where_nothing_else_would_be_left(unnamed: Answer, monkeypatch):
    core = unnamed.core
    pair = [a for a in core.candidates if a.key in (FRICTION, "stiffness@v")]
    both = fit(core, [core.base.values], pair)
    assert both is not None
    key = frozenset(pair)
    given = answering(core, frozenset())
    given.beam.points[key] = both
    given = replace(given, judged=replace(given.judged, kinds={"friction": 0.95}, posterior={key: 0.9}))
    monkeypatch.setattr(by_itself, "TOLD", {})
    assert ByItself(given).answer is given  # it is said that something is left
    monkeypatch.setattr(ByItself, "_left", False)
    assert ByItself(given).answer.judged.answer == key
    other = replace(given, judged=replace(given.judged, kinds={"delay": 0.95}))
    assert ByItself(other).answer is other


@pytest.mark.parametrize(("chance", "told"), [(0.2, False), (0.05, True)])
def test_nothing_is_told_where_it_may_well_be_a_curve(unnamed: Answer, chance: float, told: bool):
    curve = frozenset({unnamed.core.curves[0]})
    posterior = {curve: chance, frozenset(): 1.0 - chance}
    given = replace(unnamed, judged=replace(unnamed.judged, posterior=posterior))
    assert bool(ByItself(given).answer.present) is told


def test_no_more_effects_are_tried_than_there_is_time_for(unnamed: Answer, monkeypatch):
    monkeypatch.setattr(by_itself, "STEPS", 0.0)
    assert ByItself(unnamed).points == {}


def test_one_effect_in_two_places_is_said_with_its_places():
    sets = [[("viscous_friction", "a")], [("viscous_friction", "b")], [("stiffness", "a")]]
    lacks = "The model lacks viscous_friction (a), or viscous_friction (b), or stiffness"
    assert words.either(sets) == f"{lacks}: the recordings do not tell which."
