"""A bundle with what commissioning measured: zeros are taken off, refused where they are none."""

import json
from pathlib import Path
from typing import Any

import pytest

from deployment.bundling import commissioned
from deployment.bundling.build import bundle
from runtime.bundle import load
from runtime.control import ControlCore
from slewright.__main__ import run
from specs.errors import InputError
from tests.runtime.bench import Bench


def written(folder: Path, **content: Any) -> Path:
    path = folder / "calibration.json"
    path.write_text(json.dumps({"commissioning": 1, "zeros": {"q_boom": 0.02}, "files": {}, **content}))
    return path


def test_the_core_takes_a_zero_off(tmp_path: Path) -> None:
    """At the same true angles, a core that knows the zero does what another does without one."""
    plain = Bench(ControlCore(bundle("pi", tmp_path / "plain"))).automatic()
    made = bundle("pi", tmp_path / "zero", commissioning=written(tmp_path))
    bench = Bench(ControlCore(made)).set(q_boom=1.2 + 0.02).automatic()
    assert bench.commands == pytest.approx(plain.commands, abs=1e-9)
    assert json.loads((made.folder / "parameters.json").read_text())["zero_q_boom"]["value"] == 0.02
    assert (made.folder / commissioned.NAME).is_file()


GEOMETRY = {
    "offset q_boom": 0.012, "interval q_boom": [0.009, 0.015],
    "offset q_stick": -0.004, "interval q_stick": [-0.02, 0.012],
}  # fmt: skip


def test_an_offset_by_touched_points_is_the_zero_where_it_is_known_well(tmp_path: Path) -> None:
    zeros = {"q_boom": 0.02, "q_stick": 0.001, "q_slew": -0.003, "imu_tool_pitch": 0.01}
    found = commissioned.read(written(tmp_path, zeros=zeros, geometry=GEOMETRY))
    assert found.zeros == zeros | {"q_boom": 0.012}
    assert found.touched == (
        "q_boom: zero 0.0120 ± 0.0030 rad by the points touched (at rest 0.0200 rad)",
        "q_stick: zero at rest 0.0010 rad: the points tell it to 0.0160 rad, needed are 0.005",
    )
    assert commissioned.read(written(tmp_path, zeros=zeros)).touched == ()


def test_the_core_takes_a_touched_offset_off_and_the_command_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = Bench(ControlCore(bundle("pi", tmp_path / "plain"))).automatic()
    path, out = written(tmp_path, geometry=GEOMETRY), tmp_path / "touched"
    assert run(["bundle", "pi", "--out", str(out), "--commissioning", str(path)]) == 0
    assert "q_boom: zero 0.0120 ± 0.0030 rad by the points touched" in capsys.readouterr().out
    bench = Bench(ControlCore(load(out))).set(q_boom=1.2 + 0.012).automatic()
    assert bench.commands == pytest.approx(plain.commands, abs=1e-9)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"zeros": {}}, "step 'rest' of the commissioning has not passed"),
        ({"zeros": {"q_boom": 0.5}}, "zeros: q_boom = 0.5: at most 0.12 rad"),
        ({"zeros": {"q_bom": 0.01}}, "q_bom is no sensor"),
        ({"zeros": {"q_boom": None}}, "q_boom = None"),
        ({"commissioning": 7}, "no calibration.json"),
        ({"geometry": {"offset q_boom": 0.01}}, "geometry: q_boom: no offset with its interval"),
        ({"geometry": GEOMETRY | {"offset q_boom": None}}, "geometry: q_boom: no offset"),
        ({"geometry": GEOMETRY | {"interval q_boom": [1, float("nan")]}}, "q_boom: no offset with its int"),
        ({"geometry": GEOMETRY | {"offset q_boom": 0.5}}, "offset of q_boom = 0.5: at most 0.12 rad"),
        ({"files": {"arm_tables": "gone.toml"}}, "gone.toml"),
    ],
)
def test_what_is_no_calibration_is_refused(tmp_path: Path, content: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        commissioned.read(written(tmp_path, **content))
