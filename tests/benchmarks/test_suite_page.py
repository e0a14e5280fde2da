"""The page of a suite's figures."""

import pytest

from benchmarks.commands.reconcile_suite import reconcile_suite
from benchmarks.suite import page
from benchmarks.suite.summary import summarise
from specs.errors import InputError


def result(**other) -> dict:
    """Of one case: friction, and friction was named."""
    found = {"system": "servo", "result": "exact", "visible": ["coulomb_friction"], "verdict": "named"}
    found |= {"named": [["coulomb_friction"]], "unambiguous": True, "equivalents": [["coulomb_friction"]]}
    found |= {
        "redrawn": 0,
        "workflow_failed": "",
        "false_positive": False,
        "parameters": [],
        "port_right": [],
    }
    found |= {"gap_shrink": {"q": 0.99}, "seconds": 12.0, "draw_seconds": 1.0, "equivalents_added": 0}
    return found | {"experiment": None, "baselines": {}} | other


def figures(*results: dict) -> dict:
    return {"noise": "low", "visible": "drawn", "asked": 2, **summarise(results)}


def test_the_page_says_what_was_asked_and_reached_and_what_was_taken_for_what():
    wrong = result(result="wrong", visible=["input_dead_zone"], named=[["input_backlash"]])
    text = page.page(figures(result(), wrong), 7)
    assert "python -m benchmarks reconcile-suite --cases 2 --noise low --seed 7" in text
    assert "| `share_wrong` | ≤ 0.02 | 0.5 | **no** |" in text
    assert "| `gap_shrink_median` | ≥ 0.9 | 0.99 | yes |" in text
    assert "| `share_settled` | ≥ 0.7 | – | not measured |" in text
    assert "| input_dead_zone | input_backlash 1 |" in text
    assert "| coulomb_friction | coulomb_friction 1 |" in text
    assert "| all | 2 | 1 | 1 | 12 |" in text


def test_truths_that_are_not_the_simplest_are_counted_apart():
    stribeck = ["stribeck_friction"]
    simpler = {"equivalents": [stribeck, ["coulomb_friction"]], "unambiguous": False}
    found = figures(result(), result(result="abstained", visible=stribeck, **simpler))
    assert found["share_met"] == 0.5
    assert found["simplest"] == 1
    assert found["share_met_of_simplest"] == 1.0
    assert "In 1 of the cases" in page.page(found, 7)
    as_many = {"visible": ["input_lag"], "equivalents": [["input_lag"], ["sensor_delay"]]}
    assert figures(result(**as_many))["simplest"] == 1


def test_a_suite_that_was_stopped_says_after_how_many():
    assert "stopped after 1 cases" in page.page(figures(result()), 7)
    assert "stopped after 0 cases" in page.page(figures(), 7)


def test_a_page_without_a_place_for_the_results_is_refused_before_anything_is_drawn(tmp_path):
    (tmp_path / "page.md").write_text("# Nothing here")
    for path, said in (
        (tmp_path / "page.md", "suite-low-drawn:begin"),
        (tmp_path / "no.md", "cannot be read"),
    ):
        with pytest.raises(InputError, match=said):
            reconcile_suite(cases=1, out=tmp_path / "out", markdown=path, baselines=False)
    assert not (tmp_path / "out" / "cases").exists()
