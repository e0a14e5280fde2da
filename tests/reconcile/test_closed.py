"""An FMU as a closed box: what is put in front of it, behind it and onto its disturbance input is named."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.paths import BUILD
from fmus.toolchain.build import build_fmu
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from reconcile.closed.box import Box, answer
from reconcile.closed.problem import ClosedProblem
from reconcile.closed.report import examine
from reconcile.recordings.data import runs_of, split
from reconcile.workflow import reconcile
from records.measurement import Channel, Measurement
from slewright.__main__ import run as command
from specs.errors import InputError
from tests.reconcile import truth as rig
from tests.reconcile.conftest import RIG
from tests.reconcile.effects import dead_zone, delay
from tests.reconcile.test_bad_input import csv
from tests.reconcile.truth import Truth, coulomb, record

SECONDS = 14.0
SLOW = [pytest.mark.slow, pytest.mark.long]
PUSHED = (
    ('inputs=(Variable("force"', 'inputs=(Variable("load", "N", "Load"), Variable("force"'),
    ("(u.force - p.drag", "(u.force + u.load - p.drag"),
)


@pytest.fixture(scope="module")
def fmu() -> Path:
    """The rig as somebody else's FMU."""
    return build_fmu(RIG, 2, out=BUILD / "tests" / "closed")


@pytest.fixture(scope="module")
def pushed(tmp_path_factory) -> Path:
    """The same with an input that takes a load."""
    folder = tmp_path_factory.mktemp("pushed") / "pushed"
    folder.mkdir()
    text = (RIG / "model.py").read_text(encoding="utf-8")
    for old, new in PUSHED:
        assert old in text
        text = text.replace(old, new)
    (folder / "model.py").write_text(text.replace('name="rig"', 'name="pushed"'), encoding="utf-8")
    return build_fmu(folder, 3, out=BUILD / "tests" / "closed")


def table(truth: Truth, path: Path, seed: int = 4) -> Path:
    """A recording of a truth as a file."""
    measured = record(truth, SECONDS, seed)
    columns = {n: c.values for n, c in measured.channels.items()}
    units = {n: c.unit for n, c in measured.channels.items()}
    return csv(path, columns, units, measured["force"].time)


def rms(path: Path, measured: Measurement) -> dict[str, float]:
    """Errors of a system, or of a bare FMU, against a recording from its first sample on."""
    system = load_system(path)
    per = round(rig.PERIOD / system.step_s)
    force = measured["force"].values
    stimuli = Stimuli({per * k: {"force": float(v)} for k, v in enumerate(force)})
    found = simulate(system, per * (len(force) - 1), stimuli)
    return {
        n: float(np.sqrt(np.mean((found.column(n)[::per] - measured[n].values) ** 2)))
        for n in ("position", "velocity")
    }


@pytest.mark.long
@pytest.mark.parametrize(
    ("truth", "named", "parameter", "value"),
    [
        (Truth(inputs=dead_zone(1.0)), "input_dead_zone", "half_width", 1.0),
        pytest.param(Truth(inputs=delay(0.06)), "input_delay", "delay", 0.06, marks=SLOW),
        pytest.param(Truth(velocity=lambda v: 1.08 * v), "sensor_scale", "error", 0.08, marks=SLOW),
    ],
)
def test_an_effect_at_a_port_is_named_and_the_wrapped_fmu_has_it(
    fmu, tmp_path, truth, named, parameter, value
):
    run = table(truth, tmp_path / "a.csv")
    figures = reconcile([run], str(fmu), tmp_path / "out")
    assert figures["verdict"] == "named"
    assert [e["name"] for e in figures["effects"]] == [named]
    found = figures["effects"][0]["parameters"][parameter]
    assert found["value"] == pytest.approx(value, rel=0.02)
    assert found["ci95"][0] < found["value"] < found["ci95"][1]
    for gap in figures["gap"].values():
        assert gap["after"] < 0.1 * gap["nominal"] + gap["floor"]
    assert json.loads((tmp_path / "out" / "report.json").read_text())["model"] == figures["model"]
    measured = record(truth, SECONDS, 4)
    bare = rms(fmu, measured)
    wrapped = rms(tmp_path / "out" / figures["model"]["ssp"], measured)
    noise = {"position": 2e-4, "velocity": 2e-3}
    assert all(wrapped[n] < 1.5 * noise[n] for n in noise), wrapped
    assert any(bare[n] > 10.0 * noise[n] for n in noise), bare


def test_nothing_is_named_where_nothing_is_missing_and_wrong_parameters_are_reestimated(fmu):
    box = Box(fmu)
    figures = examine(box, runs_of(record(Truth(), SECONDS, 1), box, "a"))[0]
    assert figures["verdict"] == "agrees"
    other = record(Truth(mass=2.4, drag=1.1), SECONDS, 2)
    figures = examine(box, runs_of(other, box, "a"))[0]
    assert figures["verdict"] == "reestimated"
    assert figures["effects"] == []
    assert figures["reestimated"]["mass"]["new"] == pytest.approx(2.4, rel=0.01)
    assert figures["reestimated"]["drag"]["new"] == pytest.approx(1.1, rel=0.01)


@pytest.mark.slow
@pytest.mark.long
def test_a_late_input_and_late_sensors_are_alike_where_the_recording_begins_at_rest(fmu):
    command = np.concatenate([np.zeros(25), rig.excitation(SECONDS, 4)])
    measured = record(Truth(), SECONDS + 0.5, 4)
    late = Truth(inputs=delay(0.06))
    x, v = rig.simulate(late, command)
    every = round(rig.PERIOD / rig.DT)
    rng = np.random.default_rng(1)
    values = {"force": command, "position": x[::every], "velocity": v[::every]}
    noise = {"force": 0.0, "position": 2e-4, "velocity": 2e-3}
    channels = {
        n: replace(c, values=values[n] + noise[n] * rng.standard_normal(len(values[n])))
        for n, c in measured.channels.items()
    }
    box = Box(fmu)
    figures = examine(box, runs_of(Measurement(channels), box, "a"))[0]
    assert figures["verdict"] == "ambiguous"
    assert sorted(map(tuple, figures["alternatives"])) == [("input_delay",), ("sensor_delay",)]


@pytest.mark.slow
@pytest.mark.long
def test_a_force_on_a_named_disturbance_input_is_named_and_fed_back(pushed, tmp_path):
    truth = Truth(**coulomb(1.5))
    run = table(truth, tmp_path / "a.csv")
    names = tmp_path / "map.toml"
    names.write_text('[disturbances]\nload = { velocity = "velocity" }\n', encoding="utf-8")
    figures = reconcile([run], str(pushed), tmp_path / "out", names=names)
    assert "coulomb_friction" in [e["name"] for e in figures["effects"]], figures["sentence"]
    friction = next(e for e in figures["effects"] if e["name"] == "coulomb_friction")
    assert friction["port"] == "load"
    assert friction["parameters"]["Fc"]["value"] == pytest.approx(1.5, rel=0.05)
    measured = record(truth, SECONDS, 4)
    wrapped, bare = rms(tmp_path / "out" / figures["model"]["ssp"], measured), rms(pushed, measured)
    assert wrapped["velocity"] < 0.1 * bare["velocity"]


def test_what_a_closed_fmu_cannot_tell_is_said(fmu):
    box = Box(fmu)
    channels = record(Truth(), SECONDS, 1).channels
    measured = Measurement({n: c for n, c in channels.items() if n != "velocity"})
    figures = examine(box, runs_of(measured, box, "a"))[0]
    found = {r["effect"]: r["because"] for r in figures["untold"]}
    assert "closed" in found["coulomb_friction"]
    assert found["sensor_scale"] == "output velocity is not recorded"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[disturbances]\nlod = {}", "no input 'lod'; did you mean load"),
        ("[disturbances]\nload = { speed = 'velocity' }", "unknown role 'speed'; valid: velocity, position"),
        ("[disturbances]\nload = { velocity = 'velo' }", "no output 'velo'; did you mean velocity"),
        ("[disturbances]\nload = 3", "write it as load = {"),
        ("[names]\nF = 'forc'", "no input or output 'forc'; did you mean force"),
        ("[other]\nload = 3", "'other' is no table of it"),
    ],
)
def test_a_wrong_map_of_a_closed_fmu_is_said(pushed, tmp_path, text, said, capfd):
    names = tmp_path / "map.toml"
    names.write_text(text, encoding="utf-8")
    run = table(Truth(), tmp_path / "a.csv")
    arguments = ["reconcile", str(run), "--model", str(pushed), "--out", str(tmp_path / "out")]
    assert command([*arguments, "--map", str(names)]) == 2
    assert said in capfd.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_fmu_that_is_none_or_missing_is_refused(tmp_path):
    for path, text in ((tmp_path / "a.fmu", "no zip"), (tmp_path / "b.fmu", None)):
        if text:
            path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=path.name):
            Box(path)


def test_an_fmu_of_fixed_inner_steps_goes_in_its_own_and_its_delays_are_felt():
    """The project's arm as FMI 2, which cannot declare its 20 ms; its delays are whole steps of that."""
    box = Box(build_fmu("arm", 2))
    assert box.at_step(0.01).step_s == 0.02
    time = 0.02 * np.arange(500)
    told = {"qd_boom_ref": 0.1 * np.sign(np.sin(time)), "qd_stick_ref": np.zeros(500)}
    y = answer(box.at_step(0.02), told, {"arm.boom_delay": 0.36}, 499)
    units = {v.name: v.unit for v in (*box.model.inputs, *box.model.outputs)}
    recorded = told | {n: y[n] for n in ("q_boom", "qd_boom")}
    channels = {n: Channel(n, units[n], time, v) for n, v in recorded.items()}
    problem = ClosedProblem(box, split(runs_of(Measurement(channels), box, "arm"), (), (), least_s=2.0))
    assert "boom_delay" in {f.name for f in problem.base}
    fitted = problem.fit((), {})
    assert fitted is not None
    assert fitted.values["boom_delay"] == pytest.approx(0.36, abs=0.025)  # a stair of 20 ms
