"""The loop closed on the simulated reference machine: recordings that tell too little, driven on."""

import json

import pytest

from slewright import __main__ as entry
from specs import parameters

pytestmark = [pytest.mark.slow, pytest.mark.soak, pytest.mark.timeout(7200)]


def driven(name: str, model: str, folder, capsys) -> tuple[dict, str]:
    """Figures and console of the recording of a collection, reconciled and driven."""
    recordings, out, figures = folder / "recordings", folder / "out", folder / "out.json"
    assert entry.run(["collect", name, "--out", str(recordings)]) == 0
    (run,) = recordings.glob("*.parquet")
    command = ["reconcile", str(run), "--model", model, "--out", str(out), "--drive", "machine"]
    assert entry.run([*command, "--json", str(figures)]) == 0
    assert "The experiment that was driven" in (out / "report.html").read_text()
    assert (out / "before" / "report.json").is_file()
    found = json.loads(figures.read_text())
    done, said = found["experiment"], capsys.readouterr().out
    assert f"before: {done['before']}: " in said
    assert f"after: {done['after']}: " in said
    return found, said


def test_a_late_encoder_is_named_in_a_recording_of_one_gentle_move(tmp_path):
    recordings, figures = tmp_path / "recordings", tmp_path / "out.json"
    assert entry.run(["collect", "slow_slew", "--out", str(recordings)]) == 0
    (run,) = recordings.glob("*.parquet")
    command = ["reconcile", str(run), "--model", "slew", "--out", str(tmp_path / "out")]
    assert entry.run([*command, "--json", str(figures)]) == 0
    found = json.loads(figures.read_text())
    # the machine has more that the model lacks, of which some may stay open
    assert all("sensor_delay" in names for names in found["alternatives"])
    (late,) = [e for e in found["effects"] if e["name"] in ("sensor_delay", "sensor_lag")]
    true = parameters.load("machine")["encoder_velocity_delay"].value
    assert late["name"] == "sensor_delay"
    assert late["parameters"]["delay"]["value"] == pytest.approx(true, rel=0.05)


def test_what_a_machine_that_stood_still_did_not_show_is_driven_and_seen(tmp_path, capsys):
    found, _ = driven("still", "arm", tmp_path, capsys)
    done = found["experiment"]
    assert done["before"] == "insufficient_excitation"
    assert found["verdict"] == done["after"] != "insufficient_excitation"
    promised = [p for p in (*done["pairs"], *done["parameters"]) if p["promised"]]
    assert promised
    assert all(p["achieved_margin"] is None or p["achieved_margin"] > 10.0 for p in promised)
