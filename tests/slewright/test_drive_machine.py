"""The loop closed on the simulated reference machine: recordings that tell too little, driven on."""

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
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("name", ["000_slow", "001_still"])
def test_what_recordings_did_not_show_is_driven_and_seen(recordings, tmp_path, capsys, name):
    found, said = driven(recordings / f"{name}.parquet", tmp_path / name, capsys)
    done = found["experiment"]
    assert done["before"] in ("ambiguous", "insufficient_excitation")
    assert found["verdict"] == done["after"] != "insufficient_excitation"
    promised = [p for p in (*done["pairs"], *done["parameters"]) if p["promised"]]
    assert promised
    assert all(p["achieved_margin"] is None or p["achieved_margin"] > 10.0 for p in promised)
    assert f"before: {done['before']}: " in said
    assert f"after: {done['after']}: " in said
