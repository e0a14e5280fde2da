"""A bundle with what commissioning measured: zeros are taken off, refused where they are none."""

import json
from pathlib import Path
from typing import Any

import pytest

from deployment.bundling import commissioned
from deployment.bundling.build import bundle
from runtime.control import ControlCore
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


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"zeros": {}}, "step 'rest' of the commissioning has not passed"),
        ({"zeros": {"q_boom": 0.5}}, "zeros: q_boom = 0.5: at most 0.12 rad"),
        ({"zeros": {"q_bom": 0.01}}, "q_bom is no sensor"),
        ({"zeros": {"q_boom": None}}, "q_boom = None"),
        ({"commissioning": 7}, "no calibration.json"),
        ({"files": {"arm_tables": "gone.toml"}}, "gone.toml"),
    ],
)
def test_what_is_no_calibration_is_refused(tmp_path: Path, content: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        commissioned.read(written(tmp_path, **content))
