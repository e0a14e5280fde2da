"""What is said of a closed FMU beside the name: where it begins, where it disagrees, what cannot be told."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.paths import BUILD
from fmus.toolchain.build import build_fmu
from reconcile.closed import unidentifiable, where
from reconcile.closed.box import Box, answer
from reconcile.closed.problem import ClosedProblem
from reconcile.closed.report import examine
from reconcile.recordings.data import runs_of, split
from reconcile.workflow import reconcile
from records.measurement import Channel, Measurement
from tests.reconcile.conftest import RIG
from tests.reconcile.effects import dead_zone, lag
from tests.reconcile.test_closed import table
from tests.reconcile.truth import PERIOD, Truth, coulomb, excitation, record, record_driven

SHORT = 10.0
ARM = ("qd_boom_ref", "qd_stick_ref")
CHANGE = "change of force in 0.2 s"
WITHIN = "the FMU is closed: it would have to change within"
HELD = (
    ("- p.drag * x.v", "- p.drag * x.v - p.spring * x.x"),
    ("parameters=(", 'parameters=(Variable("spring", "N/m", "Spring", start=3.0, min=0.0, max=20.0),'),
)
BARE = (("p.drag", "1.5"), ("p.mass", "2.0"))


def built(folder: Path, changes=(), bare: bool = False) -> Path:
    """The rig with changes of its text as somebody else's FMU; `bare`: without parameters."""
    text = (RIG / "model.py").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    if bare:
        text = re.sub(r"    parameters=\(.*?\n    \),", "    parameters=(),", text, flags=re.DOTALL)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.py").write_text(text, encoding="utf-8")
    return build_fmu(folder, 2, out=folder)


@pytest.fixture(scope="module")
def fmu() -> Path:
    """The rig as somebody else's FMU."""
    return build_fmu(RIG, 2, out=BUILD / "tests" / "closed_report")


def later(measured: Measurement, start_s: float) -> Measurement:
    """A recording that begins while the machine moves."""
    channels = measured.channels.items()
    kept = {n: c.time >= start_s for n, c in channels}
    return Measurement({n: replace(c, time=c.time[kept[n]], values=c.values[kept[n]]) for n, c in channels})


def located(fmu: Path, measured: Measurement) -> list[dict]:
    """The report's `where`, without a search."""
    box = Box(fmu)
    problem = ClosedProblem(box, split(runs_of(measured, box, "a"), (), (), least_s=2.0))
    base = problem.fit((), {})
    assert base is not None
    return where.rows(problem, base)


@pytest.mark.parametrize(
    ("recorded", "verdict", "named"),
    [
        (record_driven(Truth(), excitation(SHORT, 4), 4, start=1.0), "agrees", []),
        (later(record(Truth(), SHORT + 3.0, 4), 3.0), "agrees", []),
        (later(record(Truth(mass=2.4, drag=1.1), SHORT + 3.0, 4), 3.0), "reestimated", []),
        pytest.param(
            record_driven(Truth(inputs=dead_zone(1.0)), excitation(SHORT, 4), 4, start=1.0),
            "named",
            ["input_dead_zone"],
            marks=pytest.mark.long,
        ),
        (record(Truth(velocity=lambda v: v + 0.05), SHORT, 4), "named", ["sensor_bias"]),
    ],
    ids=["elsewhere", "moving", "moving, other parameters", "elsewhere, dead zone", "bias of the speed"],
)
def test_where_a_free_axis_begins_is_no_bias_and_one_of_the_speed_is(fmu, recorded, verdict, named):
    box = Box(fmu)
    figures, problem, _ = examine(box, runs_of(recorded, box, "a"))
    assert (figures["verdict"], [e["name"] for e in figures["effects"]]) == (verdict, named), figures[
        "sentence"
    ]
    assert [e["port"] for e in figures["effects"] if e["name"] == "sensor_bias"] in ([], ["velocity"])
    assert problem.free == ["position"]
    hidden = {r["effect"]: r["because"] for r in figures["untold"]}
    assert hidden["sensor_bias"] == "where output position begins is free, and a bias of it looks the same"


@pytest.mark.long
def test_an_output_that_the_fmu_holds_is_not_free_and_its_bias_is_named(tmp_path):
    box = Box(built(tmp_path / "rig", HELD))
    runs = runs_of(
        record(Truth(force=lambda x, v, t: -3.0 * x, position=lambda x: x + 0.05), SHORT, 4), box, "a"
    )
    figures, problem, _ = examine(box, runs)
    assert problem.free == []
    assert [(e["name"], e["port"]) for e in figures["effects"]] == [("sensor_bias", "position")]


def test_a_run_held_out_is_scored_after_the_part_that_tells_where_it_begins(fmu):
    box = Box(fmu)
    fit, confirm = (runs_of(record(Truth(), SHORT, seed), box, f"run{seed}") for seed in (1, 2))
    late = runs_of(record_driven(Truth(), excitation(SHORT, 3), 3, start=1.0), box, "run3")
    problem = ClosedProblem(box, split(fit, confirm, late))
    errors = problem.errors((), problem.prior())["holdout"]
    assert {run for run, _ in errors} == {"run3"}
    for e in errors.values():
        assert len(e) == pytest.approx(0.6 * SHORT / PERIOD, abs=3)
        assert np.sqrt(np.mean(e**2)) < 1.5


@pytest.mark.long
def test_recordings_of_an_fmu_with_delays_that_begin_while_it_moves_agree_with_it():
    """The project's arm: two free axes that turn, commands late by 0.3 s that came before the recording."""
    box = Box(build_fmu("arm", 2))
    rng, ticks, units = np.random.default_rng(0), 700, {v.name: v.unit for v in box.model.inputs}
    told = {n: 0.15 * np.repeat(rng.uniform(-1, 1, ticks // 35), 35) for n in ARM}
    y = answer(box.at_step(0.02), told, {}, ticks - 1)
    noise = {v.name: 1e-3 if v.unit == "rad/s" else 1e-4 for v in box.model.outputs if "q" in v.name}
    seen = {n: y[n] + s * rng.standard_normal(ticks) for n, s in noise.items()}
    units |= {v.name: v.unit for v in box.model.outputs}
    time = 0.02 * np.arange(ticks)
    whole = Measurement({n: Channel(n, units[n], time, v) for n, v in (told | seen).items()})
    figures, problem, _ = examine(box, runs_of(later(whole, 4.0), box, "arm"))
    assert figures["verdict"] == "agrees", figures["sentence"]
    assert problem.free == ["q_boom", "q_stick"]


@pytest.mark.parametrize(
    ("truth", "goes_with", "begins", "says"),
    [
        (Truth(**coulomb(1.0)), "velocity", "|velocity| < ", "reversals"),
        (Truth(inputs=dead_zone(1.0)), "force", "|force| < ", "small commands"),
        (
            Truth(inputs=lag(0.12)),
            "change of force in 0.2 s",
            "|change of force in 0.2 s| > ",
            "large changes",
        ),
        (Truth(force=lambda x, v, t: -3.0 * np.sin(2.0 * x)), "position", "position > ", "end"),
    ],
    ids=["friction", "dead zone", "lag", "gravity"],
)
def test_a_closed_fmu_disagrees_in_a_regime_of_its_channels(fmu, truth, goes_with, begins, says):
    first = located(fmu, record(truth, 24.0, 3))[0]
    assert (first["signal"], first["subsystem"], first["goes_with"]) == ("velocity", "rig", goes_with)
    assert first["regime"].startswith(begins)
    assert says in first["regime"]
    assert first["share"] > 1.3 * first["time"]


def test_without_its_speed_a_position_is_looked_at_by_its_differences(fmu):
    channels = record(Truth(**coulomb(1.0)), 24.0, 3).channels
    measured = Measurement({n: c for n, c in channels.items() if n != "velocity"})
    first = located(fmu, measured)[0]
    assert (first["signal"], first["goes_with"]) == ("position", "dposition/dt")
    assert first["regime"].startswith("|dposition/dt| < ")


def test_nothing_is_located_where_nothing_disagrees(fmu):
    assert located(fmu, record(Truth(), SHORT, 4)) == []


def test_parameters_that_were_fitted_are_said_with_their_intervals_and_the_page_has_their_gap(fmu, tmp_path):
    run = table(Truth(mass=2.4, drag=1.1), tmp_path / "a.csv")
    figures = reconcile([run], str(fmu), tmp_path / "out")
    assert figures["fitted"] == ["drag", "mass"]
    for name, value in (("mass", 2.4), ("drag", 1.1)):
        low, high = figures["reestimated"][name]["ci95"]
        assert low < value < high
    assert all(g["reestimated"] < 0.1 * g["nominal"] for g in figures["gap"].values())
    assert "re-estimated</th>" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_where_no_parameter_was_fitted_nothing_is_said_to_be_reestimated(tmp_path):
    fmu = built(tmp_path / "rig", BARE, bare=True)
    run = table(Truth(inputs=dead_zone(1.0)), tmp_path / "a.csv")
    figures = reconcile([run], str(fmu), tmp_path / "out")
    assert [e["name"] for e in figures["effects"]] == ["input_dead_zone"]
    assert (figures["fitted"], figures["reestimated"], figures["unseen"]) == ([], {}, [])
    assert [g["reestimated"] for g in figures["gap"].values()] == [None, None]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    text = page[page.index("<header>") :]
    assert "re-estimated" not in text.replace("Re-estimated parameters", "")
    assert "None was fitted: no parameter of the model shows in the recorded outputs." in text
    assert figures["where"][0]["regime"].split(",")[0].replace("<", "&lt;") in text


@pytest.mark.long
def test_what_was_considered_is_in_the_form_of_an_open_report(fmu):
    box = Box(fmu)
    figures = examine(box, runs_of(record(Truth(inputs=dead_zone(1.0)), SHORT, 4), box, "a"))[0]
    fitted = [c for c in figures["considered"] if "nats_below_answer" in c]
    refused = [c for c in figures["considered"] if c not in fitted]
    keys = {"effects", "nats_below_answer", "because"}
    assert all(set(c) == keys for c in fitted)
    assert all(set(c) == {"effects", "because"} for c in refused)
    by_set = {tuple(c["effects"]): c for c in fitted}
    own = by_set["input_dead_zone@force",]
    assert (own["nats_below_answer"], own["because"]) == (0.0, "the answer")
    assert by_set[()]["because"].endswith("nats of evidence less than the answer")
    assert {b["run"] for part in figures["data"].values() for b in part} == {"a"}


def test_parameters_that_do_not_show_are_said_with_the_inputs_that_rest(tmp_path):
    more = '"spring", "N/m", "Spring", start=0.0), Variable("paint", "kg", "Of no consequence", start=1.0),'
    box = Box(built(tmp_path / "rig", (HELD[0], ("parameters=(", f"parameters=(Variable({more}"))))
    resting = record_driven(Truth(), np.full(round(SHORT / PERIOD), 3.0), 4)
    figures = examine(box, runs_of(resting, box, "a"))[0]
    assert figures["verdict"] == "insufficient_excitation"
    assert {r["parameter"]: (r["because"], r["drive"]) for r in figures["unseen"]} == {
        "spring": ("it is 0 in the FMU, so nobody knows how large it may be", []),
        "paint": ("it hardly shows in the recorded outputs", ["force"]),
    }
    assert "paint (it hardly shows in the recorded outputs; drive force)" in figures["sentence"]


def test_effects_that_a_closed_fmu_cannot_carry_are_said(fmu):
    box = Box(fmu)
    problem = ClosedProblem(box, split(runs_of(record(Truth(), SHORT, 4), box, "a"), (), ()))
    found = {r["effect"]: r["because"] for r in unidentifiable.effects(problem)}
    assert "only a disturbance input" in found["coulomb_friction"]
    assert found["payload_mass"] == found["internal_leakage"] == WITHIN
    assert found["input_crosstalk"] == "there is no second signal of the same unit"
    assert "clock" in found["clock_drift"]
    assert not {"input_delay", "sensor_scale"} & set(found)
