"""The report as text: complete in itself, the same each time, safe whatever the names are."""

import json
import re

import numpy as np
import pytest

from records.metrics import compute
from records.record import Record
from records.report import Context, curves, render, views, write_report
from records.report.figures import thin
from records.report.response import at_rest
from specs.signals import signals
from tests.records.runs import CONTEXT, runs, verdicts
from tests.records.synthetic import constant, make, plausible, ramp, slew_run


@pytest.fixture(scope="module")
def page():
    return render(runs(), verdicts(), CONTEXT)


def figures(page: str) -> list[dict]:
    (block,) = re.findall(r"<script type='application/json' id='figures'>(.*?)</script>", page, re.DOTALL)
    return json.loads(block)


def without_scripts(page: str) -> str:
    return re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def test_the_page_loads_nothing_from_anywhere(page):
    text = without_scripts(page)
    assert not re.search(r"<(link|img|iframe|script)\b", text)
    assert not re.search(r"(src|href)='(?!#)", text)
    assert "url(" not in text
    assert "default-src 'none'" in text
    assert len(re.findall(r"<script src|<script [^>]*src=", page)) == 0


def test_plotly_is_in_it_once_and_it_stays_small(page, tmp_path):
    assert len(re.findall(r"plotly\.js v\d", page)) == 1
    path = write_report(tmp_path / "out" / "report.html", runs(), verdicts(), CONTEXT)
    assert path.read_text(encoding="utf-8") == page
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]
    # six scenarios: plotly.js once, and the figures of three times as many runs
    figures_size = len(json.dumps(figures(page)))
    assert len(page) + 2 * figures_size < 8_000_000


def test_the_verdict_stands_on_top_and_misses_are_named(page):
    text = without_scripts(page)
    assert "Not accepted: 2 of 12 limits missed" in text
    assert text.index("Not accepted") < text.index("<table")
    speed = compute(runs()["four_targets_2t"]["reference"]).speed
    assert f"Four targets, 2 t, simulated reference machine: speed {speed:.4g} °/s, limit ≥ 9" in text
    assert "312 × real time" in text
    good = [v for v in verdicts() if v.passed]
    assert "Accepted: all 10 limits met" in render(runs(), good, CONTEXT)


def test_every_figure_has_its_place(page):
    names = [f["name"] for f in figures(page)]
    assert len(names) == len(set(names)) == 2 + 2 * 8
    for name in names:
        assert page.count(f"id='{name}'") == 1


def test_figures_over_time_have_titles_with_units_and_both_systems(page):
    for figure in figures(page):
        titles = [a["title"]["text"] for k, a in figure["layout"].items() if re.match(r"[xy]axis", k)]
        assert titles
        assert all(re.search(r"\[.+\]$", t) for t in titles), titles
        shown = {t["name"] for t in figure["data"]}
        assert any("Nominal model" in n for n in shown)
        assert any("Simulated reference machine" in n for n in shown)


def test_plotted_values_are_the_record_s():
    record = plausible("reference")
    slew = curves.slew_angle("s", {"reference": record}).data[0]
    assert slew["dx"] == pytest.approx(0.1)
    assert slew["y"] == pytest.approx(np.degrees(record.column("true_q_slew"))[::5].tolist(), abs=0.006)
    above = views.from_above("s", {"reference": record}).data[0]
    assert above["x"] == pytest.approx(record.column("true_tool_x")[::5].tolist(), abs=0.006)


def test_a_short_stretch_is_drawn_row_by_row():
    assert thin(slew_run([ramp(0, 90, 15)], [90])) == slice(None)


def test_each_target_has_circles_of_one_and_two_metres():
    shapes = views.from_above("s", {"reference": plausible()}).layout["shapes"]
    circles = [s for s in shapes if s["type"] == "circle"]
    assert sorted({round(s["x1"] - s["x0"], 2) for s in circles}) == [2.0, 4.0]
    assert len(circles) == 8


def test_the_tool_response_begins_where_the_machine_rests():
    # slews for 5 s, then hangs still until the target changes at 15 s
    q = np.r_[ramp(0, 60, 5), constant(60, 10)]
    record = slew_run([q], [60])
    series = {name: record.column(name) for name in record.names}
    series["true_qd_slew"] = np.r_[constant(0.2, 5), constant(0.0, 10)]
    assert at_rest(make(series)) == slice(250, 750)
    series["true_qd_slew"] = constant(0.2, 15)
    assert at_rest(make(series)) is None


def test_an_incomplete_run_is_said():
    record = plausible()
    cut = Record(
        record.table.slice(0, 1000), {**record.meta, "complete": False, "reason": "tool: NaN at 20 s"}
    )
    text = without_scripts(render({"four_targets_empty": {"reference": cut}}, [], CONTEXT))
    assert "Incomplete run on the reference system: tool: NaN at 20 s" in text


def test_a_run_that_broke_off_at_once_is_said():
    record = plausible()
    nothing = Record(record.table.slice(0, 0), {**record.meta, "complete": False, "reason": "pi: no start"})
    whole = {"nominal": plausible("nominal"), "reference": nothing}
    text = without_scripts(render({"four_targets_empty": whole}, [], CONTEXT))
    assert "Incomplete run on the reference system: pi: no start" in text
    assert text.count("nominal model</td>") == 1 + 4, "the other system's targets are shown all the same"
    assert without_scripts(render({"s": {"reference": nothing}}, [], CONTEXT))


def test_one_system_or_an_empty_set_still_makes_a_page():
    text = without_scripts(render({"four_targets_empty": {"nominal": plausible("nominal")}}, [], Context()))
    assert "nominal model" in text
    assert "No limits were checked" in text
    assert "No limits were checked" in render({}, [], Context())


def test_names_cannot_break_out_of_the_page():
    evil = "</script><script>alert(1)</script>"
    text = render({evil: {evil: plausible()}}, [], Context(title=evil, controller=evil, notes=[evil]))
    assert "<script>alert" not in text


def test_every_plotted_column_is_a_signal():
    known = set(signals()) | {"time"}
    assert set(plausible("reference").names) <= known


def test_the_same_runs_give_the_same_page(page):
    assert render(runs(), verdicts(), CONTEXT) == page


@pytest.mark.long
def test_faults_and_changed_parameters_of_a_run_are_shown():
    fault = {"target": "pi.q_<slew>", "kind": "bias", "start_s": 10.0, "end_s": 20.0, "value": 0.05}
    changes = {"1500": {"machine.load_mass": 0.0}}
    broken = make(
        {name: plausible().column(name) for name in plausible().names}, faults=[fault], changes=changes
    )
    text = without_scripts(render({"four_targets_2t": {"reference": broken}}, [], Context()))
    assert "Fault: bias on pi.q_&lt;slew&gt;, 10 s to 20 s: value 0.05" in text
    assert "Parameter: machine.load_mass = 0.0 from 30 s on" in text
    assert "Fault:" not in without_scripts(
        render({"four_targets_2t": {"reference": plausible()}}, [], Context())
    )
