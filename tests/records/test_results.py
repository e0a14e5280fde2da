"""The figures for JSON and the table for the terminal."""

import io
import json

import pytest
from rich.console import Console

from records import results
from records.metrics import check_limits, compute
from records.report.tables import readable
from specs import limits as limits_spec
from tests.records.runs import CONTEXT, runs, verdicts
from tests.records.synthetic import constant, slew_run


@pytest.fixture(scope="module")
def evaluated():
    return results.evaluate(runs())


def test_figures_have_the_promised_shape(evaluated, tmp_path):
    content = results.figures(evaluated, verdicts(), CONTEXT.realtime_factor, seed=1)
    results.write_figures(tmp_path / "metrics.json", content)
    read = json.loads((tmp_path / "metrics.json").read_text())
    assert set(read) >= {"scenarios", "accepted", "realtime_factor", "seed"}
    assert read["accepted"] is False
    assert read["realtime_factor"] == {"nominal": 312.4, "reference": 31.7}
    assert set(read["scenarios"]) == {"four_targets_empty", "four_targets_2t"}
    for pair in read["scenarios"].values():
        assert set(pair) == {"nominal", "reference"}
        for metrics in pair.values():
            assert set(metrics) >= {"speed", "overshoot", "error", "tool", "missed"}
            assert metrics["overshoot"] <= metrics["overshoot_max"]
            assert len(metrics["per_target"]) == metrics["targets"] == 4
    assert [p.name for p in tmp_path.iterdir()] == ["metrics.json"]


def test_figures_that_are_not_numbers_are_null():
    record = slew_run([constant(0, 3)], [90])
    pair = {"short": {"nominal": compute(record)}}
    checked = check_limits(pair["short"]["nominal"], {"speed": {"min": 1.0}}, "short", "nominal")
    content = results.figures(pair, checked, {})
    assert json.loads(json.dumps(content, allow_nan=False))["limits"][0]["value"] is None


def printed(evaluated, checked, width=140):
    out = io.StringIO()
    results.print_table(evaluated, checked, CONTEXT.realtime_factor, Console(file=out, width=width))
    return out.getvalue()


def test_the_table_shows_figures_misses_and_verdict(evaluated):
    text = printed(evaluated, verdicts())
    speed = evaluated["four_targets_empty"]["reference"].speed
    assert f"✗ {speed:.2f}" in text
    assert f"four_targets_empty on reference: speed {speed:.4g} °/s, limit ≥ 9 (slower is no use" in text
    assert "nominal 312 ×, reference 32 ×" in text
    assert "Not accepted: 10 of 12 limits met" in text


def test_a_log_file_gets_the_whole_table(evaluated):
    assert printed(evaluated, verdicts(), width=60) == printed(evaluated, verdicts(), width=140)


def test_all_limits_met_is_accepted(evaluated):
    good = [v for v in verdicts() if v.passed]
    assert results.accepted(good)
    assert "Accepted: 10 of 10 limits met" in printed(evaluated, good)


def test_every_metric_that_specs_may_limit_exists(evaluated):
    metrics = evaluated["four_targets_empty"]["nominal"]
    found = check_limits(metrics, {name: {"max": 1e9} for name in limits_spec.METRICS})
    assert len(found) == len(limits_spec.METRICS)
    assert set(limits_spec.METRICS) <= set(results.METRIC_NAMES)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("four_targets_empty", "Four targets, empty"),
        ("five_targets_2t", "Five targets, 2 t"),
        ("five_targets_unknown", "Five targets, unknown load"),
        ("slalom", "Slalom"),
        ("empty", "Empty"),
    ],
)
def test_scenario_names_are_readable(name, said):
    assert readable(name) == said
