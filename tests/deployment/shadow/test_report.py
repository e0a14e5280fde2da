"""What a run in shadow mode tells: on a simulated machine, in lock-step, an operator model driving."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deployment.shadow import agreement, closeness, handover, ranges
from deployment.shadow.recorded import Shadowed, read
from deployment.shadow.report import Request, run
from reconcile.equations.model import read_folder
from reconcile.recordings.data import read_run
from records.formats import read_measurement, write_measurement
from runtime.control import AXES
from runtime.image import OUTPUT
from runtime.recorder.reader import Recording
from runtime.recorder.replay import replay
from specs.errors import InputError
from tests.conftest import ROOT
from tests.deployment.shadow.runs import TICKS, recorded, repeated
from tests.runtime.bench import HOLD
from tests.runtime.bundles import built, core


def test_the_runtime_says_nothing_and_computes_all_the_time():
    _, spoken = recorded()
    found = repeated()
    assert spoken == []
    assert len(found) == TICKS
    assert agreement.modes(found)["automatic"] > 0.99 * TICKS * 0.02
    assert np.abs(found.passed).max(axis=0).min() > 0.1  # every axis would have been commanded


def test_a_recording_of_shadow_mode_replays_bit_for_bit():
    result = replay(Recording(recorded()[0]), core("pd"))
    assert (result.ticks, result.first) == (TICKS, None)


def test_the_operators_commands_come_from_joystick_or_valves():
    by_hand, by_valves = repeated(), repeated(valves=True)
    assert (by_hand.source, by_valves.source) == ("joystick", "valves")
    good = np.isfinite(by_valves.operator).all(axis=1)
    assert good.mean() > 0.99
    apart = np.abs(by_hand.operator - by_valves.operator)[good]
    assert apart.max() < 1e-3  # of the fields' steps; the machine moves the same


def test_what_is_compared_is_what_the_definition_says():
    found = repeated()
    automatic = agreement.in_mode(found, "automatic")
    ours, theirs = found.passed[automatic, 0], found.operator[automatic, 0]
    told = agreement.commands(found)["u_slew"]
    assert told["rms_difference"] == pytest.approx(np.sqrt(np.mean((ours - theirs) ** 2)))
    moving = (abs(ours) > agreement.NEUTRAL) & (abs(theirs) > agreement.NEUTRAL)
    assert told["same_sign_share"] == pytest.approx(np.mean(np.sign(ours[moving]) == np.sign(theirs[moving])))
    assert told["same_sign_share"] > 0.6  # both go for the same targets


def test_the_gates_reasons_add_up():
    found = repeated()
    told = agreement.gate(found)
    assert 0.0 < told["share"] < 0.2
    for i, name in enumerate(AXES):
        changed = found.wanted[:, i] != found.passed[:, i]
        assert told["axes"][name]["share"] == pytest.approx(
            np.mean(changed[agreement.in_mode(found, "automatic")])
        )
        assert bool(told["axes"][name]["reasons"]) == bool(changed.any())


def test_the_reference_machine_is_closer_to_itself_than_to_another():
    """The nominal machine with other noise, against one that is drawn: the figure must tell them apart."""
    near, _ = closeness.compare(repeated())
    far, _ = closeness.compare(repeated("tuning:3"))
    assert near["pieces"] >= 1
    assert near["fit_percent"] > far["fit_percent"] + 5.0
    assert near["signals"]["qd_slew"]["fit_percent"] > 90.0
    assert far["signals"]["qd_slew"]["rmse"] > 2.0 * near["signals"]["qd_slew"]["rmse"]


def test_ranges_are_told_with_their_source():
    rows = {r["name"]: r for r in ranges.compare(repeated(), built("pd"))}
    assert rows["q_boom"]["inside"] is True
    assert "geometry.toml" in rows["q_boom"]["source"]
    found = repeated()
    moved = Shadowed(**{**found.__dict__, "inputs": found.inputs + 3.0})
    assert {r["name"]: r["inside"] for r in ranges.compare(moved, built("pd"))}["q_boom"] is False


def test_ranges_of_the_machine_are_told_without_a_target():
    found = repeated()
    outputs = found.outputs.copy()
    outputs[:, OUTPUT.at("control_mode")] = HOLD
    held = replace(found, outputs=outputs)
    assert not agreement.in_mode(held, "automatic").any()
    assert ranges.compare(held, built("pd")) == ranges.compare(found, built("pd"))


def test_a_policys_trained_ranges_go_before_the_stated_ones(tmp_path: Path):
    shutil.copy(ROOT / "learning" / "policies" / "full.onnx", tmp_path / "policy.onnx")
    rows = ranges.compare(repeated(), replace(built("pd"), folder=tmp_path))
    assert {r["source"] for r in rows} == {ranges.TRAINED}
    by_name = {r["name"]: r for r in rows}
    assert by_name["inertia"]["inside_share"] is not None
    assert by_name["slew_dead_band"]["inside"] is None  # a recording does not tell it


def test_reconcile_reads_what_is_handed_over(tmp_path: Path):
    path = tmp_path / "operator.parquet"
    write_measurement(handover.measurement(repeated(), Path("rec"), 120.0), path)
    back = read_measurement(path)
    assert back["u_slew"].unit == "1"
    assert back["p_slew_a"].unit == "Pa"
    assert back.meta["label"] == "simulated reference machine"
    assert np.abs(back["u_slew"].values - repeated().operator[:, 0]).max() < 1e-12
    runs = read_run(path, read_folder("slew"))
    assert "u_slew" in runs[0].inputs
    assert "qd_slew" in runs[0].outputs


def test_the_report_is_written_whole(tmp_path: Path):
    asked = Request(recorded()[0], built("pd"), tmp_path / "out")
    figures = run(asked, lambda *_: None)
    assert sorted(p.name for p in asked.out.iterdir()) == ["operator.parquet", "report.html", "report.json"]
    told = json.loads((asked.out / "report.json").read_text())
    assert told["closeness"]["pieces"] == figures["closeness"]["pieces"]
    page = (asked.out / "report.html").read_text()
    assert "simulated reference machine" in page
    assert "://" not in page.split("<script>")[0]
    starts = ("slewright reconcile ", "slewright reconcile ", "python -m benchmarks dossier ")
    assert all(command.startswith(start) for command, start in zip(figures["next"], starts, strict=True))


def test_what_is_no_recording_of_shadow_mode_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="no recording"):
        read(tmp_path, built("pd"))
    with pytest.raises(InputError, match="operator 'hands'"):
        read(recorded()[0], built("pd"), "hands")
    with pytest.raises(InputError, match="control core"):
        read(recorded()[0], built("pi"))
    with pytest.raises(InputError, match="--machine"):
        run(Request(recorded()[0], built("pd"), tmp_path / "out", machine="mine"), lambda *_: None)


def test_the_dossier_takes_its_figures(tmp_path: Path):
    from verification.dossier import recorded as chapter

    near, _ = closeness.compare(repeated())
    file = tmp_path / "report.json"
    file.write_text(
        json.dumps({"recording": "rec", "label": "simulated reference machine", "closeness": near})
    )
    text = chapter.section(chapter.read(file)).text
    assert "| qd_slew | rad/s |" in text
    assert "simulated reference machine" in text
    file.write_text("{}")
    with pytest.raises(InputError, match="--recorded"):
        chapter.read(file)
