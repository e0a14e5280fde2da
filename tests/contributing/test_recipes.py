"""The recipes of CONTRIBUTING.md, followed to the letter: what was added is where the recipe says it is."""

import pytest

from tests.contributing.recipes import Copy, follow


def up_to_date(copy: Copy) -> bool:
    return "up to date" in copy.run("slewright generate --check")


@pytest.mark.long
def test_a_signal_is_on_every_bus_and_in_every_record(tmp_path):
    copy, edited = follow("Add a signal", tmp_path)
    assert edited == ["specs/signals.toml"]
    for name in ("slewright.dbc", "modbus_map.csv", "fmi_variables.toml"):
        assert "fuel_low" in (tmp_path / "specs" / "generated" / name).read_text()
    assert "fuel_low" in (tmp_path / "runtime" / "core" / "wire_layout.h").read_text()
    assert "fuel_low" in (tmp_path / "docs" / "reference" / "signals.md").read_text()
    recorded = "from runtime.recorder.message import fields; print([f.name for f in fields()])"
    assert "fuel_low" in copy.python(recorded)
    shown = 'from runtime.hmi.catalogue import catalogue; print([s["name"] for s in catalogue()["signals"]])'
    assert "fuel_low" in copy.python(shown)
    copy.run("python -m pytest -q -p no:cacheprovider tests/specs tests/runtime/can/test_bus.py")


@pytest.mark.long
def test_an_effect_is_searched_at_every_axis(tmp_path):
    copy, edited = follow("Add a physical effect", tmp_path)
    assert edited == []
    assert "eddy_current_brake" in copy.run("slewright effects")
    assert "eddy_current_brake" in (tmp_path / "docs" / "reference" / "effects.md").read_text()
    code = (
        "from reconcile.equations.model import candidates, read_folder; "
        'print([a.port for a in candidates(read_folder("tests/reconcile/rig"), ["speed"]) '
        'if a.effect.name == "eddy_current_brake"])'
    )
    assert copy.python(code) != "[]"
    assert up_to_date(copy)


@pytest.mark.long
def test_a_controller_is_known_to_every_command(tmp_path):
    copy, edited = follow("Add a controller", tmp_path)
    assert edited == []
    assert (tmp_path / "out" / "verify" / "report.html").is_file()
    assert (tmp_path / "out" / "creep.bundle" / "manifest.json").is_file()
    compared = "compare --controller creep --machines 1 --task slew --load empty --no-sweep"
    assert "│ creep " in copy.run(f"slewright {compared}")
    assert "0 machine-hours" in copy.run("slewright tune creep --hours 0 2>&1 || [ $? -eq 2 ]")
    assert "creep" in copy.python("from baselines import registry; print(registry.names())")
    assert up_to_date(copy)


@pytest.mark.long
def test_a_file_format_is_converted_to_and_from(tmp_path):
    copy, edited = follow("Add a file format", tmp_path)
    assert edited == []
    (tmp_path / "run.csv").write_text("time [s],q_slew [rad]\n0,0.5\n0.02,0.75\n0.04,1\n")
    copy.run("slewright convert run.csv run.npz && slewright convert run.npz again.csv")
    assert (tmp_path / "again.csv").read_text().splitlines()[-1] == "0.04,1"
    assert "`.npz`" in (tmp_path / "docs" / "reference" / "file-formats.md").read_text()
    assert up_to_date(copy)


@pytest.mark.long
def test_a_model_is_an_fmu_that_runs(tmp_path):
    copy, edited = follow("Add a model", tmp_path)
    assert edited == []
    assert (tmp_path / "out" / "winch.parquet").is_file()
    code = 'from fmus.toolchain.loader import model_folders; print("winch" in model_folders())'
    assert copy.python(code) == "True"
    assert up_to_date(copy)
