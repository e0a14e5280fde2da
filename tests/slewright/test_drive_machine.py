"""The loop closed on the simulated reference machine: recordings that tell too little, driven on, a name."""

import json

import pytest

from slewright import __main__ as entry


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """What docs/reconcile.md begins with."""
    folder = tmp_path_factory.mktemp("machine") / "recordings"
    assert entry.run(["collect", "slow_boom", "--out", str(folder)]) == 0
    return folder


def driven(run, out, capsys) -> tuple[dict, str]:
    """Figures and console of a recording of the arm, reconciled and driven."""
    figures = out.with_suffix(".json")
    command = ["reconcile", str(run), "--model", "arm", "--out", str(out), "--drive", "machine"]
    assert entry.run([*command, "--json", str(figures)]) == 0
    assert "The experiment that was driven" in (out / "report.html").read_text()
    return json.loads(figures.read_text()), capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_an_arm_that_stood_still_is_driven_and_its_late_encoder_named(recordings, tmp_path, capsys):
    found, said = driven(recordings / "001_still.parquet", tmp_path / "still", capsys)
    done = found["experiment"]
    assert (done["before"], found["verdict"]) == ("insufficient_excitation", "named")
    assert {e["name"] for e in found["effects"]} == {"sensor_delay"}
    delay = found["effects"][0]["parameters"]["delay"]["value"]
    assert 0.1 < delay < 0.3  # the machine's encoders are 0.2 s late
    responses = [p for p in done["parameters"] if p["name"].endswith("_response")]
    assert len(responses) == 2
    assert all(min(p["predicted_margin"], p["achieved_margin"]) > 10.0 for p in responses)
    assert "before: insufficient_excitation: " in said
    assert "after: named: The model lacks sensor_delay" in said


@pytest.mark.slow
@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_a_late_encoder_of_unknown_kind_is_promised_an_experiment_that_tells_it(recordings, tmp_path, capsys):
    found, said = driven(recordings / "000_slow.parquet", tmp_path / "slow", capsys)
    done = found["experiment"]
    assert done["before"] == "ambiguous"
    (pair,) = done["pairs"]
    assert {*pair["one"], *pair["other"]} == {"sensor_delay", "sensor_lag"}
    assert pair["predicted_margin"] > 10.0
    assert pair["achieved_margin"] > 10.0
    assert pair["one"] == ["sensor_delay"]
    assert "before: ambiguous: " in said
