"""report.json: the contract's form, scores on the held-out part, floors, regimes; the page that shows it."""

import copy
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from reconcile import words
from reconcile.errors import replicates
from reconcile.judging import verdict as verdicts
from reconcile.page import plots
from reconcile.page.drawn import Course, Shown, Stretch
from reconcile.page.equation import equation, spelt
from reconcile.page.page import _facts, write_first, write_page
from reconcile.page.shown import missing, shown
from reconcile.recordings.data import Run, Signal
from reconcile.reporting import report as reports, target
from reconcile.reporting.contract import Report, check
from reconcile.reporting.findings import Findings, above
from reconcile.workflow import _plain
from tests.reconcile.answers import REFUSED, answered, recorded
from tests.reconcile.truth import Truth, coulomb

DATED = {"seed": 0, "versions": {"slewright": "0"}, "elapsed_s": 1.5}


@pytest.fixture(scope="module")
def friction() -> Findings:
    return answered(recorded(Truth(mass=2.3, **coulomb(1.0)), seconds=30.0, seed=3), ["coulomb_friction@v"])


@pytest.fixture(scope="module")
def figures(friction: Findings) -> dict:
    verdict = verdicts.judge(friction.answer)
    return json.loads(json.dumps(_plain(reports.figures(friction, verdict)) | DATED, allow_nan=False))


@pytest.fixture(scope="module")
def page(friction: Findings, figures: dict, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("page") / "report.html"
    return write_page(path, figures, shown(friction), "rig").read_text("utf-8")


def test_the_report_has_the_contracts_form(figures):
    assert check(figures) == []


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda r: r.pop("iso18571"), "iso18571"),
        (lambda r: r["effects"][0].pop("port"), "effects.0.port"),
        (lambda r: r.update(verdict="certain"), "verdict"),
        (lambda r: r.update(verdict="agrees"), "verdict: agrees with effects"),
        (lambda r: r.update(alternatives=[["viscous_friction"]]), "alternatives: the answer itself"),
        (lambda r: r.update(verdict="ambiguous"), "ambiguous needs 2 to 4"),
        (lambda r: r["effects"][0]["parameters"]["Fc"].update(ci95=[2.0, 3.0]), "is not in its interval"),
        (lambda r: r["gap"]["position"].update(after=float("nan")), "gap.position.after"),
        (lambda r: r["where"][0].update(share=1.2), "where.0.share"),
        (lambda r: r["effects"][0].update(probability=1.2), "effects.0.probability"),
        (lambda r: r["probability"].update(coulomb_friction=float("nan")), "probability.coulomb_friction"),
        (lambda r: r["kinds"].update(friction=-0.1), "kinds.friction"),
        (lambda r: r["where"][0].update(signal="pressure"), "where: pressure has no gap"),
    ],
)
def test_what_is_not_in_the_contracts_form_is_found(figures, spoil, said):
    report = copy.deepcopy(figures)
    spoil(report)
    assert any(said in line for line in check(report)), check(report)


def test_regimes_take_of_every_stage_the_samples_that_it_predicts(friction: Findings, figures: dict):
    """A later sensor has other samples in a stretch: here one less, of a stage that knows of no delay."""
    first, *others = friction.traces["nominal"] or []
    shorter = {n: x[:-1] for n, x in first.predicted.items()}
    left = {
        part: {n: x[:-1] for n, x in getattr(first.window, part).items()}
        for part in ("times", "samples", "recorded")
    }
    trace = replace(first, predicted=shorter, window=replace(first.window, **left))
    late = replace(friction, traces={**friction.traces, "nominal": [trace, *others]})
    found = reports.figures(late, verdicts.judge(late.answer))["gap_by_regime"]
    assert [r["regime"] for r in found] == [r["regime"] for r in figures["gap_by_regime"]] != []
    for row, before in zip(found, figures["gap_by_regime"], strict=True):
        assert row["gap"]["position"]["after"] == before["gap"]["position"]["after"]
        assert row["gap"]["position"]["nominal"] == pytest.approx(
            before["gap"]["position"]["nominal"], rel=0.1
        )


def test_a_report_of_a_closed_fmu_has_no_probabilities(figures):
    report = copy.deepcopy(figures)
    for key in ("probability", "kinds", "tolerances"):
        report.pop(key)
    report["effects"][0].pop("probability")
    assert check(report) == []


def test_the_gap_is_the_held_out_error_above_the_floor(figures, friction):
    for name, gap in figures["gap"].items():
        errors = np.concatenate([t.error(name) for t in friction.traces["after"] or []])
        rms = float(np.sqrt(np.mean(errors**2)))
        assert gap["after"] == pytest.approx(np.sqrt(max(0.0, rms**2 - gap["floor"] ** 2)))
        assert figures["scores"][name]["rmse"]["after"] == pytest.approx(rms)
        assert gap["after"] < 0.05 * gap["reestimated"] < 0.05 * gap["nominal"]


def test_a_late_sensors_predictions_are_compared_sample_by_sample():
    """With its delay fitted, samples lie in other steps of the motion: they are the same samples."""
    late = Truth(position=lambda y: np.concatenate([np.full(1000, y[0]), y[:-1000]]))  # 0.1 s
    found = answered(recorded(late, seconds=30.0, seed=4), ["sensor_delay@position"])
    after, before = found.traces["after"], found.traces["reestimated"]
    assert after is not None
    assert before is not None
    assert found.answer.point.values["sensor_delay@position.delay"] == pytest.approx(0.1, abs=0.01)
    squares, drawn = [], shown(found).stretches
    for a, b in zip(after, before, strict=True):
        signal, times = a.window.run.outputs["position"], a.window.recorded["position"]
        assert np.array_equal(
            signal.values[np.searchsorted(signal.time, times)], a.window.samples["position"]
        )
        both, of_a, of_b = np.intersect1d(times, b.window.recorded["position"], return_indices=True)
        assert len(both) > 0.7 * len(times)
        squares.append((a.predicted["position"][of_a] - b.predicted["position"][of_b]) ** 2)
    apart = reports._apart(found, frozenset())["differs"]["position"] * found.floors["position"].level
    assert apart == pytest.approx(float(np.sqrt(np.mean(np.concatenate(squares)))), rel=0.1)
    course = next(c for c in drawn[0].outputs if c.name == "position")
    errors = course.measured - course.predicted["after"]
    assert np.isfinite(errors).mean() > 0.7
    assert np.nanmax(np.abs(errors)) < 6.0 * course.floor


def test_scores_improve_with_what_was_found(figures):
    assert figures["iso18571"]["before"] < 0.9 < figures["iso18571"]["after"] <= 1.0
    for scores in figures["scores"].values():
        fit = scores["fit_percent"]
        assert fit["nominal"] < fit["reestimated"] < fit["after"] <= 100.0


def test_only_held_out_blocks_are_scored(figures, friction):
    held = [(b["start_s"], b["end_s"]) for b in figures["data"]["holdout"]]
    other = [(b["start_s"], b["end_s"]) for part in ("fit", "confirm") for b in figures["data"][part]]
    for trace in friction.traces["after"] or []:
        times = trace.window.times["position"]
        assert any(a - 1e-6 <= times[0] and times[-1] <= b + 1e-6 for a, b in held)
        assert not any(a < times[-1] and times[0] < b for a, b in other)


def test_regimes_and_the_rest_make_up_the_whole(figures):
    shares = [row["gap"]["position"]["time"] for row in figures["gap_by_regime"]]
    assert figures["gap_by_regime"][-1]["regime"] == "elsewhere"
    assert sum(shares) == pytest.approx(1.0, abs=1e-3) if len(shares) == 2 else sum(shares) > 0.99


def test_what_was_turned_down_is_there_with_its_reason(figures):
    reasons = {tuple(c["effects"]): c["because"] for c in figures["considered"]}
    assert reasons["coulomb_friction@v",] == "the answer"
    assert "nats of evidence less" in reasons[()]
    assert reasons["sensor_lag@position",] == REFUSED.because


# -------------------------------------------------------------------------------- the page


@pytest.mark.parametrize(
    ("start", "end", "said"),
    [
        (12.68, 13.04, "12.68 to 13.04 s"),
        (0.79, 0.84, "0.790 to 0.840 s"),
        (9e3, 12e3, "9000.0 to 12000.0 s"),
    ],
)
def test_a_stretch_has_its_times_with_digits_that_tell_them_apart(start, end, said):
    time = np.linspace(start, end, 9)
    course = Course("position", "m", 1e-3, time, np.sin(time), {"after": np.sin(time)})
    assert plots.overlay(0, Stretch("run", start, end, start, [course], [])).title == f"run, {said}"


def test_the_page_loads_nothing(page):
    own = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)  # plotly's source names addresses
    assert "http" not in own.replace("http-equiv", "")
    assert not re.search(r"<(link|img|iframe)\b|\bsrc=|@import|url\(", own)
    assert "default-src 'none'" in own


def test_the_page_says_sentence_equation_signals_and_parameters(page, figures):
    assert figures["sentence"] in page
    assert equation("F = −Fc sgn(v)", ["Fc"]) in page
    for name in figures["gap"]:
        assert f"<th scope='row'>{name}</th>" in page
    assert figures["where"][0]["regime"].replace("<", "&lt;") in page
    assert "mass" in page
    assert "sensor_lag@position" in page


def test_the_page_draws_what_was_held_out_and_the_residual(page, figures):
    text = re.search(r"id='figures'>(.*?)</script>", page, flags=re.DOTALL)
    assert text is not None
    drawn = {f["name"]: f for f in json.loads(text[1])}
    assert {"overlay-0", "gaps", "residual-0", "accounts-0"} <= set(drawn)
    overlay = drawn["overlay-0"]
    assert {"measured", "as it came", "re-estimated", "after"} <= {t["name"] for t in overlay["data"]}
    titles = [a["title"]["text"] for k, a in overlay["layout"].items() if k.startswith("yaxis")]
    assert {"position [m]", "velocity [m/s]", "force [N]"} <= set(titles)
    blocks = [(b["start_s"], b["end_s"]) for b in figures["data"]["holdout"]]
    first, last = overlay["layout"]["xaxis"]["range"]
    assert any(a <= first and last <= b for a, b in blocks)


def test_the_longest_recording_is_drawn_as_the_model_by_itself_has_it(friction: Findings, page: str):
    (drawn,) = shown(friction).whole
    longest = max(friction.core.records, key=lambda r: float(np.ptp(r.time)))
    assert (drawn.run, drawn.end_s) == (longest.run.name, float(longest.time[-1]))
    assert drawn.start_s - longest.time[0] < 0.11 * np.ptp(longest.time)
    assert [c.name for c in drawn.inputs] == ["force"]
    for c in drawn.outputs:
        errors = {s: float(np.std(c.measured - y)) for s, y in c.predicted.items()}
        assert errors["after"] < 0.2 * errors["reestimated"] < 0.21 * errors["nominal"]
    assert "The model by itself, fitted by its output error" in page


def test_the_named_effect_is_drawn_through_the_missing_force(friction):
    (force,) = missing(friction.core, friction.answer.base, friction.answer.point)
    assert force.after is not None and force.effect is not None  # noqa: PT018
    assert np.allclose(force.before, force.after + force.effect)
    assert np.std(force.after) < 0.2 * np.std(force.before)
    assert np.corrcoef(force.before, force.effect)[0, 1] > 0.9


def test_the_first_page_shows_what_the_model_lacks_and_goes_with_the_report(friction, tmp_path):
    with target.first_page(tmp_path / "rig") as page:
        text = write_first(page, friction.core, "rig").read_text("utf-8")
    assert "The missing force so far" in text
    assert "goes when rig/report.html is there" in text
    assert '"name":"missing-0-0"' in text
    assert "mean after" not in text
    assert not page.exists()


def test_names_are_escaped(friction, figures, tmp_path):
    spoiled = figures | {"sentence": "a <b>bold</b> claim"}
    text = write_page(tmp_path / "r.html", spoiled, shown(friction), "<rig>").read_text("utf-8")
    assert "<b>bold" not in text
    assert "&lt;rig&gt;" in text


def test_a_report_of_the_contracts_keys_alone_has_a_page(figures, tmp_path):
    wanted = {k: figures[k] for k in Report.model_fields}
    text = write_page(tmp_path / "r.html", wanted, Shown(), "rig").read_text("utf-8")
    assert figures["sentence"] in text


def test_a_model_that_runs_away_has_a_page(figures, tmp_path):
    spoiled = copy.deepcopy(figures)
    spoiled["gap"]["position"] |= {"nominal": None, "reestimated": None}
    text = write_page(tmp_path / "r.html", spoiled, Shown(), "rig").read_text("utf-8")
    assert "<th scope='row'>position</th><td>m</td>" in text


def test_equations_are_set_with_symbols():
    text = equation("F = −Fc_positive sgn(v) for v > 0", ["Fc_positive"])
    assert "<i>F</i><sub>c, positive</sub> sgn(<i>v</i>) for <i>v</i> &gt; 0" in text
    turned = equation("factor l_y θ_x' tan θ_x", ["factor"])
    assert "<i>l</i><sub>y</sub> <i>θ</i><sub>x</sub>&#x27; tan <i>θ</i><sub>x</sub>" in turned
    assert spelt("factor") == "<i>factor</i>"  # not said twice
    assert spelt("Fc") == "<i>F</i><sub>c</sub> <small>Fc</small>"
    assert "d<i>v</i>/d<i>t</i>" in equation("(J + m) dv/dt = F")


# -------------------------------------------------------------------------------- floors


def run(name: str, seed: int, level: float, shift_s: float = 0.0, drive: float = 1.0) -> Run:
    rng = np.random.default_rng(seed)
    t = shift_s + 0.02 * np.arange(1000)
    u = drive * np.sin(0.7 * (t - shift_s))
    y = 3.0 * np.sin(0.7 * (t - shift_s)) + 0.1 * seed + level * rng.standard_normal(len(t))
    return Run(name, float(t[0]), float(t[-1]), {"force": Signal(t, u)}, {"position": Signal(t, y)})


def test_replicate_runs_give_the_floor_whatever_they_start_from():
    runs = [run("a", 1, 0.05), run("b", 2, 0.05, shift_s=4.0), run("c", 3, 0.05, drive=0.8)]
    found = replicates.pairs(runs, ["force"])
    assert [(a.name, b.name) for a, b in found] == [("a", "b")]
    assert replicates.levels(found, ["position"], 2.4)["position"] == pytest.approx(0.05, rel=0.1)


def test_runs_at_rest_are_no_replicates():
    assert replicates.pairs([run("a", 1, 0.05, drive=0.0), run("b", 2, 0.05, drive=0.0)], ["force"]) == []


def test_the_floor_of_the_report_rests_on_replicates_where_there_are_some():
    first = recorded(Truth(), seconds=12.0, seed=3)[0]
    rng = np.random.default_rng(0)
    noisy = {
        n: Signal(s.time, s.values + 0.01 * rng.standard_normal(len(s.values)))
        for n, s in first.outputs.items()
    }
    again = Run("again", first.start_s, first.end_s, first.inputs, noisy)
    found = answered([first, again])
    assert found.floors["position"].source == "replicate runs (again, run)"
    assert found.floors["position"].level == pytest.approx(0.01 / np.sqrt(2.0), rel=0.15)


def test_an_error_below_the_floor_leaves_no_gap(friction):
    floor = friction.floors["position"]
    assert above(0.5 * floor.level, floor) == 0.0
    assert np.isnan(above(float("nan"), floor))


def test_the_head_of_the_page_gives_what_the_worst_signal_closed_too(figures):
    report = copy.deepcopy(figures)
    (first, second) = report["gap"].values()
    first |= {"nominal": 1.0, "after": 0.4}
    second |= {"nominal": 1.0, "after": 0.01}
    assert dict(_facts(report))["Gap closed, held out"] == "60 % to 99 %, by signal"


def test_effects_are_listed_and_one_that_is_there_twice_with_its_ports():
    assert words.together([("b", "roll"), ("a", "roll")]) == "a and b"
    assert words.together([("a", "y"), ("b", "z"), ("a", "x")]) == "a (x), a (y) and b"


def test_a_doubt_says_what_is_certain():
    load, bias, lag = ("load", "axis"), ("bias", "angle"), ("lag", "u")
    which = "the recordings do not tell which."
    assert words.either([[load], [bias]]) == f"The model lacks load, or bias: {which}"
    assert words.either([[load, lag], [bias]]) == f"The model lacks lag and load, or bias: {which}"
    assert (
        words.either([[load, lag], [lag, bias]]) == f"The model lacks lag, and besides load, or bias: {which}"
    )
    assert words.either([[load, lag], [lag]]) == "The model lacks lag, and perhaps load."
    assert words.either([[lag], [("lag", "y")]]) == f"The model lacks lag (u), or lag (y): {which}"


@pytest.mark.parametrize(
    ("verdict", "after", "said"),
    [
        ("named", 0.02, ""),
        ("named", 0.13, reports.NOT_SHOWN),
        ("unexplained", 0.02, ""),
        ("unexplained", 0.032, ""),
        ("reestimated", 0.13, reports.BENT),
        ("agrees", 0.13, ""),
    ],
)
def test_what_the_held_out_part_says_against_an_answer_is_said(verdict: str, after: float, said: str):
    gaps = {
        "rate": {"floor": 0.002, "nominal": 0.03, "after": after},
        "angle": {"floor": 0.002, "nominal": 0.01, "after": 0.004},
    }
    assert reports._held_out(verdicts.Verdict(verdict, "", "at_floor"), gaps) == said


def test_the_page_says_first_what_a_named_effect_is(page, figures):
    first = page[: page.index("</header>")]
    assert "coulomb_friction" in first
    assert first.count("class='equation'") == len({e["name"] for e in figures["effects"]})


def test_what_the_effects_close_is_told_from_what_new_parameters_do(figures):
    gaps = {
        "y": {"nominal": 4.0, "reestimated": 2.0, "after": 1.5},
        "z": {"nominal": 1.0, "reestimated": 0.0, "after": 0.0},
    }
    facts = dict(_facts(figures | {"gap": gaps}))
    assert facts["Gap closed, held out"] == "62 % to 100 %, by signal"
    assert facts["By the effects beside new parameters"] == "25 %"
    assert "By the effects beside new parameters" not in dict(_facts(figures | {"gap": gaps, "effects": []}))
