"""The score against the contract, on made-up truths and answers."""

import json

import pytest

from blindtest.score import Truth, read_truth, score
from specs.errors import InputError

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
