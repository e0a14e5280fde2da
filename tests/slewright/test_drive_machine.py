"""The loop closed on the simulated reference machine: what was ambiguous is named after one experiment."""

import json

import pytest

from slewright import __main__ as entry


@pytest.mark.slow
@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_a_late_encoder_of_unknown_kind_is_named_after_the_experiment_that_was_proposed(tmp_path, capsys):
    recordings, out, figures = tmp_path / "recordings", tmp_path / "doubt", tmp_path / "figures.json"
    assert entry.run(["collect", "slow_boom", "--out", str(recordings)]) == 0
    run = recordings / "000_slow.parquet"
    command = ["reconcile", str(run), "--model", "arm", "--out", str(out), "--drive", "machine"]
    assert entry.run([*command, "--json", str(figures)]) == 0
    found = json.loads(figures.read_text())
    done = found["experiment"]
    assert done["before"] == "ambiguous"
    assert found["verdict"] == "named"
    assert ("sensor_delay", "qd_boom") in {(e["name"], e["port"]) for e in found["effects"]}
    (pair,) = done["pairs"]
    assert pair["one"] == ["sensor_delay"]
    assert pair["other"] == ["sensor_lag"]
    assert min(pair["predicted_margin"], pair["achieved_margin"]) > 10.0
    said = capsys.readouterr().out
    assert "before: ambiguous: " in said
    assert "after: named: The model lacks" in said
    assert "The experiment that was driven" in (out / "report.html").read_text()
