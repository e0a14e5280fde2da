"""The score against the contract, on made-up truths and answers."""

import json
from dataclasses import replace

import pytest

from blindtest import case
from blindtest.equivalents import EQUIVALENT, equivalents
from blindtest.membership import least
from blindtest.score import Truth, read_truth, score
from blindtest.systems.kit import KITS
from specs.errors import InputError

OTHERS = ("asymmetric_coulomb_friction", "input_offset", "stribeck_friction", "stiffness")

A, B, AB = frozenset({"a"}), frozenset({"b"}), frozenset({"a", "b"})


def truth(visible, *others, outside=False):
    return Truth(frozenset(visible), (frozenset(visible), *others), outside, {})


def named(*names, verdict="named", alternatives=()):
    effects = [{"name": n, "verdict": verdict} for n in names]
    return {"verdict": verdict, "effects": effects, "alternatives": [list(a) for a in alternatives]}


@pytest.mark.parametrize(
    ("case", "answer", "expected"),
    [
        (truth({"a"}), named("a"), "exact"),
        (truth({"a"}), named("b"), "wrong"),
        (truth({"a"}, B), named("b"), "abstained"),
        (truth({"a"}, B), named("a", verdict="ambiguous", alternatives=[A, B]), "ambiguous_ok"),
        (truth({"a"}, B), named("b", verdict="ambiguous", alternatives=[A, B]), "ambiguous_ok"),
        (truth({"a"}), named("a", verdict="ambiguous", alternatives=[A, B]), "abstained"),
        (truth({"a"}), named("a", "c"), "wrong"),
        (truth({"a"}), named("c", verdict="ambiguous", alternatives=[{"c"}, {"a", "c"}]), "wrong"),
        (truth({"a", "b"}), named("a"), "abstained"),
        (truth({"a"}), {"verdict": "unexplained"}, "abstained"),
        (truth(()), {"verdict": "agrees"}, "exact"),
        (truth(()), named("a"), "wrong"),
        (truth({"x"}, outside=True), {"verdict": "unexplained"}, "right"),
        (truth({"x"}, outside=True), named("a"), "wrong"),
        (truth({"x"}, outside=True), {"verdict": "named", "free_form": [{"gap_closed": 0.85}]}, "right"),
    ],
)
def test_an_answer_gets_what_the_contract_says(case, answer, expected):
    assert score(case, answer).result == expected


def test_naming_something_where_nothing_is_visible_is_a_false_positive():
    assert score(truth(()), named("a")).false_positive
    assert not score(truth({"a"}), named("b")).false_positive


def test_more_than_four_declared_sets_are_no_answer():
    others = [frozenset({name}) for name in "bcde"]
    report = named("a", verdict="ambiguous", alternatives=[A, *others])
    assert score(truth({"a"}, *others), report).result == "abstained"


def test_a_truth_that_was_changed_is_refused(tmp_path):
    path = tmp_path / "truth.json"
    path.write_text(json.dumps({"visible": ["a"], "equivalents": [["a"]], "outside": False}))
    with pytest.raises(InputError, match="not the truth"):
        read_truth(path, "0" * 64)


@pytest.mark.long
def test_the_exact_identity_of_asymmetric_friction_is_found():
    drawn = _with_friction_and_load()
    sets = [set(names) for names in equivalents(drawn)]
    assert sets[0] == {"coulomb_friction", "constant_load"}
    assert {"asymmetric_coulomb_friction"} in sets
    assert {"coulomb_friction", "input_offset"} in sets


def _with_friction_and_load():
    """A case whose visible effects are Coulomb friction and a constant load, by the draft's own steps."""
    kit = KITS["servo"]
    by_name = {e.name: e for e in kit.effects(None)}
    wanted = (by_name["coulomb_friction"], by_name["constant_load"])
    only = replace(kit, effects=lambda _: (*wanted, *(by_name[n] for n in OTHERS)))
    for seed in range(20):
        drawn = case.draw(seed, "low", visible=2, kit=replace(only, effects=lambda _: wanted))
        if len(drawn.visible) == 2:
            return replace(drawn, kit=only)
    raise AssertionError("no such case in twenty")


def test_what_delays_all_outputs_of_a_tool_is_as_well_a_delay_of_its_motion():
    """A run begins in motion, with sensors that know of nothing before: that must not tell the two apart."""
    kit = KITS["tool"]
    (late,) = [e for e in kit.effects(None) if e.key == "tool/sensor_delay/all"]
    drawn = case.draw(3, "low", visible=1, kit=replace(kit, effects=lambda _: (late,)))
    assert [e.key for e in drawn.visible] == [late.key]
    assert least(replace(drawn, kit=kit), ["input_delay"]) < EQUIVALENT
