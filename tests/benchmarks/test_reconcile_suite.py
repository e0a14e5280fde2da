"""The hidden-effect suite: which cases it draws, what an answer is given, resuming, scores and figures."""

import json
import secrets
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.suite import child, measures, work
from benchmarks.suite.membership import completed
from benchmarks.suite.parameters import TABLE, expected
from benchmarks.suite.plan import BLOCK, Settings, settle
from benchmarks.suite.run import run_suite, there
from benchmarks.suite.summary import AMBIGUOUS, NOTHING, confusion, reliability, summarise
from blindtest import case, folder
from blindtest.score import Truth, score
from blindtest.systems.kit import KITS
from specs.errors import InputError
from tests.benchmarks.command import benchmarks
from verification.campaign import pool

KEYS = {
    *("cases", "exact", "ambiguous_ok", "wrong", "abstained", "redrawn", "false_positive", "confusion"),
    *("gap_shrink_median", "parameter_error_median", "coverage95", "seconds_median", "baselines"),
}
SEEN = {"exact", "ambiguous_ok", "right", "wrong", "abstained"}


def command(*arguments: object) -> int:
    return benchmarks("reconcile-suite", *arguments)


# ---------------------------------------------------------------- which cases


def test_twenty_cases_hold_every_system_at_least_three_times_and_follow_from_the_seed():
    settings = Settings(seed=5)
    kinds = [settings.case(n).system for n in range(40)]
    for block in (kinds[:20], kinds[20:]):
        assert {k: block.count(k) for k in BLOCK} == BLOCK
        assert min(block.count(k) for k in BLOCK) >= 0.15 * len(block)
    assert kinds[:20] != kinds[20:]
    assert settings.case(7) == Settings(seed=5).case(7)
    assert len({settings.case(n).seed for n in range(40)} | {Settings(seed=6).case(0).seed}) == 41


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"noise": "loud"}, "no noise 'loud'"),
        ({"system": "boat"}, "no system 'boat'"),
        ({"visible": "some"}, "no set of visible effects 'some'"),
        ({"seed": -1}, "seed -1 is negative"),
    ],
)
def test_settings_that_there_are_not_are_named(wrong, said):
    with pytest.raises(InputError, match=said):
        Settings(**({"seed": 1} | wrong))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--cases", "0"], "--cases 0"),
        (["--cases", "2", "--workers", "0"], "--workers 0"),
        (["--cases", "2", "--summary"], "--summary needs --out"),
        (["--cases", "2", "--noise", "loud", "--out", "new"], "no noise 'loud'; did you mean low"),
        (["--cases", "2", "--system", "servos", "--out", "new"], "did you mean servo"),
    ],
)
def test_wrong_input_is_said_and_nothing_is_written(arguments, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert command(*arguments) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_folder_of_another_suite_or_of_something_else_is_refused(tmp_path):
    out = tmp_path / "suite"
    assert settle(out, 3, 99, noise="low", system="servo", visible="none").seed == 3
    assert settle(out, None, 99, noise="low", system="servo", visible="none").seed == 3
    for seed, wanted, said in (
        (4, {"noise": "low"}, "seed 3, not 4"),
        (None, {"noise": "high"}, "noise low, not high"),
    ):
        with pytest.raises(InputError, match=said):
            settle(out, seed, 99, **({"system": "servo", "visible": "none"} | wanted))
    (tmp_path / "else").mkdir()
    (tmp_path / "else" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="something else"):
        settle(tmp_path / "else", 1, 1, noise="low")


# ---------------------------------------------------------------- what an answer is given


@pytest.fixture
def answers(monkeypatch):
    """A workflow that names nothing at once; what it was started with is kept, `stop` interrupts a call."""
    calls: list[dict] = []

    def run(arguments, folder, limit_s=0.0):
        calls.append({"arguments": list(arguments), "files": sorted(p.name for p in folder.iterdir())})
        if len(calls) == run.stop:
            raise KeyboardInterrupt
        (folder.parent / "out").mkdir()
        report = {"verdict": "agrees", "effects": [], "alternatives": [], "gap": {}}
        (folder.parent / "out" / "report.json").write_text(json.dumps(report))
        return child.Ended(0, 1.5, "")

    run.stop = 0
    run.calls = calls
    monkeypatch.setattr(child, "run", run)
    return run


QUIET = ("--system", "servo", "--visible", "none", "--no-baselines", "--workers", "1")


def test_an_answer_is_given_recordings_and_model_only_and_the_truth_is_what_was_sealed(answers, tmp_path):
    out = tmp_path / "suite"
    assert command("--cases", 1, "--seed", 11, "--out", out, *QUIET) == 0
    place = out / "cases" / "0000"
    told = json.loads((place / "given" / "case.json").read_text())
    (call,) = answers.calls
    assert call["files"] == sorted(["case.json", "model", *told["runs"]])
    assert str(tmp_path) not in " ".join(call["arguments"])
    assert not any("11" in a for a in call["arguments"])  # no seed
    result = json.loads((place / "result.json").read_text())
    assert result["result"] == "exact"
    assert result["truth_sha256"] == told["truth_sha256"]
    (place / "sealed" / "truth.json").write_text('{"visible": [], "equivalents": [[]], "outside": false}')
    with pytest.raises(InputError, match="not the truth"):
        run_suite(Settings(11, "low", "servo", "none"), 1, out, again=True)


@pytest.mark.long
def test_an_interrupted_suite_keeps_what_it_has_and_goes_on(answers, tmp_path, capsys):
    out, figures = tmp_path / "suite", tmp_path / "figures.json"
    answers.stop = 2
    assert command("--cases", 3, "--seed", 12, "--out", out, "--json", figures, *QUIET) == 130
    assert json.loads(figures.read_text())["cases"] == 1
    kept = (out / "cases" / "0000" / "result.json").stat().st_mtime_ns
    answers.stop = 0
    assert command("--cases", 3, "--out", out, "--json", figures, *QUIET) == 0
    found = json.loads(figures.read_text())
    assert (found["cases"], found["exact"], found["seed"]) == (3, 3, 12)
    assert (out / "cases" / "0000" / "result.json").stat().st_mtime_ns == kept
    assert len(answers.calls) == 4  # one, one interrupted, two more
    command("--cases", 3, "--out", out, "--summary", *QUIET)
    assert len(answers.calls) == 4
    assert "By system" in capsys.readouterr().out


def test_results_that_were_kept_count_as_done_where_their_folders_are_not(answers, tmp_path, capsys):
    kept, figures = tmp_path / "low.jsonl", tmp_path / "figures.json"
    first = ("--seed", 14, "--out", tmp_path / "first", "--results", kept)
    assert command("--cases", 2, *first, *QUIET) == 0
    settings, *rows = (json.loads(line) for line in kept.read_text().splitlines())
    assert (settings["suite"]["seed"], [r["key"] for r in rows]) == (14, ["0000", "0001"])
    assert len({r["code"] for r in rows} - {""}) == 1  # which reconcile it was
    more = ("--results", kept, "--json", figures)
    assert command("--cases", 3, "--out", tmp_path / "second", *more, *QUIET) == 0  # of the same seed
    assert len(answers.calls) == 3
    assert [p.name for p in (tmp_path / "second" / "cases").iterdir()] == ["0002"]
    assert json.loads(figures.read_text())["cases"] == 3
    capsys.readouterr()
    assert command("--cases", 3, "--summary", *more, *QUIET) == 0
    assert "By system" in capsys.readouterr().out
    assert len(kept.read_text().splitlines()) == 4


@pytest.mark.parametrize(
    ("content", "options", "said"),
    [
        ('{"suite":{"seed":15,"visible":"none","system":"servo"}}', ("--seed", 16), "another suite (seed 15"),
        ('{"suite":{"seed":15,"visible":"outside"}}', (), "visible outside"),
        ("my notes", (), "holds no results of a suite"),
        ('{"suite":{"sed":15}}', (), "holds no results of a suite"),
    ],
)
def test_a_file_of_other_results_is_refused_and_left_as_it_is(content, options, said, tmp_path, capsys):
    kept = tmp_path / "kept.jsonl"
    kept.write_text(content)
    assert command("--cases", 1, "--out", tmp_path / "new", "--results", kept, *options, *QUIET) == 2
    assert said in capsys.readouterr().err
    assert kept.read_text() == content
    assert not (tmp_path / "new").exists()


def test_a_workflow_that_fails_abstains_and_is_tried_again(answers, monkeypatch, tmp_path):
    monkeypatch.setattr(child, "run", lambda *a, **k: child.Ended(3, 0.5, "slewright: it broke"))
    settings = settle(tmp_path / "suite", 13, 0, noise="low", system="servo", visible="none")
    (result,) = run_suite(settings, 1, tmp_path / "suite", baselines=False)
    assert (result["result"], result["workflow_failed"]) == ("abstained", "slewright: it broke")
    assert summarise([result])["failed"] == 1
    monkeypatch.setattr(child, "run", answers)
    (result,) = run_suite(settings, 1, tmp_path / "suite", baselines=False)
    assert (result["result"], result["workflow_failed"]) == ("exact", "")


@pytest.mark.long
def test_a_child_is_timed_sees_little_of_the_environment_and_is_ended_when_it_hangs(tmp_path, monkeypatch):
    monkeypatch.setenv("SECRET_PLACE", "here")
    text = "import os, sys; sum(range(10**6)); sys.exit(7 if 'SECRET_PLACE' in os.environ else 5)"
    ended = child.run(["-c", text], tmp_path)
    assert ended.code == 5
    assert 0.0 < ended.seconds < 10.0
    hung = child.run(["-c", "import time; print('slow', flush=True); time.sleep(60)"], tmp_path, limit_s=2.0)
    assert hung.code != 0


# ---------------------------------------------------------------- measures


def placed(name, parameters, place="force", port="", subsystem=""):
    return {"name": name, "parameters": parameters, "place": place, "port": port, "subsystem": subsystem}


def truth(*effects, **more):
    base = {"tool_length_x": 2.0, "tool_length_y": 1.5, "slew_relief_pressure": 3e7}
    return {
        "placed": list(effects),
        "visible": [e["name"] for e in effects],
        "base": base,
        "scale": {"inertia": 4.0},
    } | more


def reported(name, port="", **values):
    parameters = {
        n: {"value": v, "unit": u, "ci95": [v - half, v + half]} for n, (v, u, half) in values.items()
    }
    return {"name": name, "port": port, "parameters": parameters, "verdict": "named"}


@pytest.mark.parametrize(
    ("effect", "answer", "wanted"),
    [
        (
            placed("asymmetric_coulomb_friction", {"Fc_plus": 3.0, "Fc_minus": 1.0}),
            reported("asymmetric_coulomb_friction", Fc_positive=(3.0, "N.m", 1), Fc_negative=(1.0, "N.m", 1)),
            {"Fc_positive": 3.0, "Fc_negative": 1.0},
        ),
        (  # a torque in the truth, an acceleration in a model without inertia
            placed("coulomb_friction", {"Fc": 2.0}),
            reported("coulomb_friction", Fc=(0.5, "rad/s2", 0.1)),
            {"Fc": 0.5},
        ),
        (
            placed("presliding_hysteresis", {"Fc": 2.0, "sigma": 40.0}),
            reported("presliding_hysteresis", Fc=(2.0, "N.m", 1), distance=(0.05, "rad", 0.01)),
            {"Fc": 2.0, "distance": 0.05},
        ),
        (
            placed("gravity_load", {"G": 5.0}, subsystem="boom"),
            reported("gravity_load", torque_sin=(5.0, "N.m", 1), torque_cos=(0.1, "N.m", 1)),
            {"torque_sin": 5.0},
        ),
        (
            placed("end_stop", {"position": 0.8, "k": 100.0}),
            reported("end_stop", position=(-0.8, "rad", 0.1), k=(1.0, "N.m/rad", 1)),
            {"position": -0.8},
        ),
        (
            placed("relief_limit", {"below": 1e7}, place="hydraulic"),
            reported("relief_limit", limit=(2e7, "Pa", 1e5)),
            {"limit": 2e7},
        ),
        (
            placed("sensor_lag", {"lag": 0.1}, "output", "q"),
            reported("sensor_lag", "q", time=(0.1, "s", 0)),
            {"time": 0.1},
        ),
    ],
)
def test_true_parameters_come_in_the_names_and_units_of_a_report(effect, answer, wanted):
    assert expected(effect, answer, truth(effect)) == pytest.approx(wanted)


def test_a_force_on_the_tool_is_an_acceleration_in_the_truth_and_a_moment_in_a_report():
    from specs import parameters

    geometry = parameters.load("geometry")
    moment = 0.2 * (geometry["tool_mass"].value + geometry["load_mass"].value) * 1.5**2
    effect = placed("constant_load", {"F0": 0.2}, subsystem="pitch")
    answer = reported("constant_load", "pitch", load=(1.0, "N.m", 1))
    assert expected(effect, answer, truth(effect)) == pytest.approx({"load": moment})


def test_every_effect_that_both_sides_know_has_a_parameter_to_judge():
    from reconcile.catalogue import ALL

    drawn: set[str] = set()
    for name, kit in KITS.items():
        assert name in BLOCK
        drawn |= {e.name for e in kit.effects(kit.draw(np.random.default_rng(1)))}
    for name in drawn & {e.name for e in ALL}:
        known = {p.name for e in ALL if e.name == name for p in e.parameters}
        assert any(set(key.split(" - ")) <= known for key in TABLE.get(name, {})), name


def test_error_interval_and_shrinking_are_measured_against_the_truth():
    effect = placed("coulomb_friction", {"Fc": 2.0})
    report = {
        "verdict": "named",
        "effects": [reported("coulomb_friction", Fc=(2.2, "N.m", 0.1))],
        "gap": {
            "q": {"floor": 0.1, "nominal": 1.0, "after": 0.05},
            "qd": {"floor": 0.1, "nominal": 0.01, "after": 0.05},  # no gap to begin with
        },
    }
    found = measures.of_report(truth(effect), report)
    (row,) = found["parameters"]
    assert row["error_percent"] == pytest.approx(10.0)
    assert row["covered"] is False
    assert row["best_fit_covered"] is None  # a truth of older suites does not have it
    assert found["gap_shrink"] == {"q": pytest.approx(0.95)}
    assert measures.of_report(truth(effect), report | {"verdict": "unexplained"})["parameters"] == []


def test_probabilities_are_held_against_every_set_that_explains_the_case():
    report = {"probability": {"input_lag": 0.95, "stiffness": 0.2}, "kinds": {"delay": 0.97}}
    rows = measures.claims([["input_delay"], ["input_lag"]], report)
    assert [(r["of"], r["name"], r["true"]) for r in rows] == [
        ("effect", "input_lag", True),
        ("effect", "stiffness", False),
        ("kind", "delay", True),
    ]
    bands = reliability([{"claims": rows}, {}], "effect")
    assert [(b["claims"], b["true"]) for b in bands if b["claims"]] == [(1, 0.0), (1, 1.0)]


def test_intervals_are_held_against_what_visible_effects_alone_come_to_as_well():
    # a distractor, a little dry friction, is taken for a wider dead zone
    effect = placed("input_dead_zone", {"half_width": 2.00}) | {"best_fit": {"half_width": 2.05}}
    report = {
        "verdict": "named",
        "effects": [reported("input_dead_zone", half_width=(2.06, "rad/s", 0.02))],
        "gap": {},
    }
    (row,) = measures.of_report(truth(effect), report)["parameters"]
    assert (row["covered"], row["best_fit_covered"]) == (False, True)
    assert row["best_fit"] == pytest.approx(2.05)


@pytest.mark.parametrize(
    ("effect", "port", "right"),
    [
        (placed("sensor_delay", {}, "output", "q"), "q", True),
        (placed("sensor_delay", {}, "output", "q"), "qd", False),
        (placed("sensor_delay", {}, "output", "all"), "all outputs", True),
        (placed("sensor_delay", {}, "output", "all"), "qd", False),
        (placed("sensor_bias", {}, "output", "qd", "roll"), "qd_tool_x", True),
        (placed("sensor_bias", {}, "output", "qd", "roll"), "qd_tool_y", False),
        (placed("coulomb_friction", {}, "force", "", "stick"), "boom", False),
        (placed("input_offset", {}, "input", "u", "boom"), "qd_boom_ref", True),
    ],
)
def test_the_port_is_judged_by_axis_and_kind(effect, port, right):
    assert measures.port_is_right(effect, port) is right


# ---------------------------------------------------------------- declared sets


@pytest.fixture(scope="module")
def loaded():
    """A servo whose one visible effect is a constant load, which an input offset equals exactly."""
    kit = KITS["servo"]
    by_name = {e.name: e for e in kit.effects(None)}
    few = tuple(by_name[n] for n in ("constant_load", "input_offset", "input_saturation"))
    for seed in range(20):
        drawn = case.draw(seed, "low", visible=1, kit=replace(kit, effects=lambda _: few[:1]))
        if drawn.visible:
            return replace(drawn, kit=replace(kit, effects=lambda _: few))
    raise AssertionError("no such case in twenty")


def sealed_of(drawn, **more):
    content = {
        "placed": [
            {"name": p.effect.name, "parameters": p.parameters(drawn.scale)} | more for p in drawn.placed
        ]
    }
    visible = frozenset(e.name for e in drawn.visible)
    return Truth(visible, (visible,), False, content)


LOAD, OFFSET, LIMIT = ["constant_load"], ["input_offset"], ["input_saturation"]


@pytest.mark.parametrize(("other", "outcome"), [(OFFSET, "ambiguous_ok"), (LIMIT, "abstained")])
def test_a_declared_set_that_the_search_did_not_try_is_fitted(loaded, other, outcome, tmp_path):
    answer = {"verdict": "ambiguous", "effects": [{"name": LOAD[0]}], "alternatives": [LOAD, other]}
    whole = completed(sealed_of(loaded), answer, tmp_path, lambda: loaded)
    assert score(whole, answer).result == outcome
    again = completed(sealed_of(loaded), answer, tmp_path, lambda: pytest.fail("it is known by now"))
    assert again == whole


def test_a_case_that_is_drawn_otherwise_than_it_was_sealed_is_left_alone(loaded, tmp_path):
    answer = {"verdict": "ambiguous", "effects": [{"name": LOAD[0]}], "alternatives": [LOAD, OFFSET]}
    truth_ = sealed_of(loaded, parameters={"F0": 1e3})
    assert completed(truth_, answer, tmp_path, lambda: loaded) == truth_


def test_sets_that_nothing_hangs_on_are_not_fitted(loaded, tmp_path):
    for answer in (
        {"verdict": "named", "effects": [{"name": "constant_load"}]},
        {"verdict": "unexplained", "effects": []},
    ):
        truth_ = sealed_of(loaded)
        assert completed(truth_, answer, tmp_path, lambda: pytest.fail("not asked for")) == truth_


# ---------------------------------------------------------------- figures


def result(outcome, visible, named, verdict="named", sizes=1, **more):
    return {
        "result": outcome,
        "visible": visible,
        "named": named,
        "verdict": verdict,
        "unambiguous": sizes == 1,
        "equivalents": [visible] * sizes,
        "equivalents_added": 0,
        "false_positive": not visible and bool(named),
        "redrawn": 1,
        "seconds": 2.0,
        "draw_seconds": 1.0,
        "workflow_failed": "",
        "system": "servo",
        "parameters": [],
        "gap_shrink": {},
        "port_right": [],
        "baselines": {},
    } | more


def test_confusion_counts_what_was_named_instead():
    found = confusion(
        [
            result("exact", ["a"], [["a"]]),
            result("wrong", ["a"], [["b"]]),
            result("abstained", ["a", "c"], [["a"]]),
            result("abstained", ["c"], []),
            result("ambiguous_ok", ["c"], [["c"], ["d"]], "ambiguous", 2),
            result("wrong", ["a"], [["a", "e"]]),
            result("wrong", [], [["f"]]),
            result("exact", [], [], "agrees"),
        ]
    )
    assert found == {
        "a": {"a": 3, "b": 1},
        "c": {NOTHING: 2, AMBIGUOUS: 1},
        NOTHING: {"e": 1, "f": 1, NOTHING: 1},
    }


def test_figures_are_medians_and_shares_over_the_right_cases():
    exact = {"error_percent": 4.0, "covered": True, "best_fit_covered": False}
    older = {"error_percent": 4.0, "covered": True}
    found = summarise(
        [
            result("exact", ["a"], [["a"]], parameters=[exact, older], gap_shrink={"q": 0.9, "v": 0.8}),
            result("wrong", ["a"], [["b"]], parameters=[{"error_percent": 90.0, "covered": False}]),
            result("ambiguous_ok", ["a"], [["a"], ["c"]], "ambiguous", 2, gap_shrink={"q": 0.1}),
            result("abstained", ["a", "b"], [], "unexplained"),
        ]
    )
    assert (found["cases"], found["exact"], found["ambiguous_ok"], found["wrong"], found["abstained"]) == (
        4,
        1,
        1,
        1,
        1,
    )
    assert found["exact_single_unambiguous"] == 0.5
    assert found["parameter_error_median"] == 4.0
    assert found["coverage95"] == 1.0
    assert found["coverage95_best_fit"] == 0.0
    assert found["gap_shrink_median"] == pytest.approx(0.85)
    assert (found["share_ambiguous"], found["share_equivalent"], found["redrawn"]) == (0.25, 0.25, 4)
    assert found["equivalence_sizes"] == {"1": 3, "2": 1}


def test_figures_over_nothing_are_there():
    assert summarise([])["cases"] == 0


# ---------------------------------------------------------------- the real workflow


def test_a_plain_way_answers_a_case(loaded, tmp_path):
    from reconcile.plain.__main__ import main

    folder.write(replace(loaded, kit=KITS["servo"]), tmp_path / "given", tmp_path / "sealed")
    runs = sorted(str(p) for p in (tmp_path / "given").glob("*.parquet"))
    main(["sindy", str(tmp_path / "given" / "model"), str(tmp_path / "out"), *runs])
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    assert found["verdict"] in ("named", "agrees")
    assert work.scored(sealed_of(loaded), found | {"core_seconds": 1.0})["result"] in SEEN


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(
    ("system", "seed", "hidden"),
    [
        ("arm", 502, ["sensor_bias"]),
        ("tool", 503, ["cubic_stiffness"]),
        ("servo", 501, ["input_rate_limit", "torque_ripple"]),
    ],
)
def test_a_fixed_case_is_named_exactly(system, seed, hidden, tmp_path):
    out = tmp_path / "suite"
    command("--cases", 1, "--seed", seed, "--system", system, "--workers", 1, "--no-baselines", "--out", out)
    (done,) = there(out)
    assert done["visible"] == hidden
    assert (done["result"], done["named"]) == ("exact", [hidden])
    assert all(done["port_right"])


def test_cases_on_a_dask_cluster_give_results_in_order(answers, tmp_path):
    distributed = pytest.importorskip("distributed")
    settings = settle(tmp_path / "suite", 17, 0, noise="low", system="servo", visible="none")
    # in this process, where the workflow is stood in for
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address=None,
    ) as cluster:
        results = run_suite(
            settings, 2, tmp_path / "suite", scheduler=cluster.scheduler_address, baselines=False
        )
    assert [r["key"] for r in results] == ["0000", "0001"]
    assert len(answers.calls) == 2


def test_a_scheduler_that_is_not_there_is_said_before_anything_is_written(tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "SCHEDULER_S", 1.0)
    out, figures = tmp_path / "suite", tmp_path / "figures.json"
    wrong = ("--dask", "tcp://127.0.0.1:1", "--no-baselines")
    assert command("--cases", 1, *wrong, "--out", out, "--json", figures) == 2
    assert "no Dask scheduler answers at tcp://127.0.0.1:1" in capsys.readouterr().err
    assert not out.exists()
    assert not figures.exists()


@pytest.mark.slow
@pytest.mark.timeout(1200)  # seconds of core time, but on a machine that others use too
@pytest.mark.long
@pytest.mark.parametrize("visible", ["none", "drawn"])
def test_a_fresh_case_is_answered_and_scored_whatever_comes_out(visible, tmp_path):
    seed, out, figures = secrets.randbelow(2**31), tmp_path / "suite", tmp_path / "figures.json"
    quick = ("--system", "servo", "--visible", visible, "--workers", 1, "--no-baselines")
    code = command("--cases", 1, "--seed", seed, *quick, "--out", out, "--json", figures)
    assert code in (0, 1), seed
    found = json.loads(figures.read_text())
    assert set(found) >= KEYS, seed
    (done,) = there(out)
    assert done["result"] in SEEN, seed
    assert done["workflow_failed"] == "", seed
    told = json.loads((out / "cases" / "0000" / "given" / "case.json").read_text())
    assert done["truth_sha256"] == told["truth_sha256"]
    assert [p.name for p in (out / "cases").iterdir()] == ["0000"]
