"""`slewright bundle`: what goes in, what is refused."""

import json
from pathlib import Path

import pytest

from baselines.load.calibration import uncalibrated
from baselines.load.calibration_file import as_dict
from deployment.bundling import build
from deployment.bundling.blocks import Block
from fmus.toolchain.loader import load_model
from runtime import bundle as form
from slewright import __main__ as entry
from specs import parameters
from specs.errors import InputError
from tests.runtime.bundles import built


def test_manifest_names_every_file_by_its_hash() -> None:
    made = built()
    content = json.loads((made.folder / form.MANIFEST).read_text())
    assert content["files"] == form.hashes(made.folder)
    assert made.library().name in content["files"]
    assert {"sources/core/gate.c", "sources/blocks/controller/model.c", "parameters.json"} <= set(
        content["files"]
    )


def test_parameters_are_those_of_the_specs() -> None:
    found = json.loads((built().folder / "parameters.json").read_text())
    known = parameters.check()
    assert {"pi_slew_gain", "gate_rise", "lut_boom_00", "boom_length", "load_estimate_window"} <= set(found)
    assert {n: e["value"] for n, e in found.items()} == {n: known[n].value for n in found}


def test_the_sources_make_the_same_identity_again() -> None:
    """Nothing of the place or the moment goes into a bundle's code."""
    assert build.identity_of("pi") == built().identity
    assert build.identity_of("pd") != built().identity


def test_what_a_core_cannot_run_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no controller 'pie'.*pi"):
        build.bundle("pie", tmp_path / "b")
    with pytest.raises(InputError, match="no controller 'outsid'; did you mean outside"):
        build.bundle("outsid", tmp_path / "b")
    with pytest.raises(InputError, match="model machine is continuous"):
        Block(load_model("machine"), "machine")
    with pytest.raises(InputError, match="model slew_nn reads inertia, inertia_rate"):
        Block(load_model("slew_nn"), "slew_nn")
    with pytest.raises(InputError, match=r"no parameter 'gate_raise'; did you mean gate_rise"):
        build.bundle("pi", tmp_path / "b", changes={"gate_raise": 1.0})
    with pytest.raises(InputError, match="parameter gate_rise = 1000"):
        build.bundle("pi", tmp_path / "b", changes={"gate_rise": 1000.0})
    assert not any(tmp_path.iterdir())


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="holds something that is no bundle"):
        build.bundle("pi", tmp_path)
    with pytest.raises(InputError, match="there is no folder"):
        build.bundle("pi", tmp_path / "not" / "there")
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]


def test_a_calibration_of_the_load_estimate_goes_into_the_code(tmp_path: Path) -> None:
    told = as_dict(uncalibrated())
    told["unknowns"]["tool_mass"] *= 1.2
    path = tmp_path / "machine.json"
    path.write_text(json.dumps(told))
    own = build.bundle("pi", tmp_path / "own", calibration=path)
    assert (own.folder / "load-calibration.json").read_bytes() == path.read_bytes()
    assert own.identity != built("pi").identity
    cores = [next(b.folder.rglob("*.so")).read_bytes() for b in (own, built("pi"))]
    assert cores[0] != cores[1]
    path.write_text("{}")
    with pytest.raises(InputError, match="not a load calibration"):
        build.bundle("pi", tmp_path / "b", calibration=path)


def test_command_says_what_it_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = tmp_path / "f.json"
    assert entry.run(["bundle", "pi", "--out", str(tmp_path / "b"), "--json", str(figures)]) == 0
    assert "pi for x86_64-linux" in capsys.readouterr().out or form.host() != "x86_64-linux"
    assert json.loads(figures.read_text())["identity"] == built().identity
    assert entry.run(["bundle", "pi", "--out", str(tmp_path / "b"), "--platform", "vax"]) == 2
    assert "no build target 'vax'" in capsys.readouterr().err
