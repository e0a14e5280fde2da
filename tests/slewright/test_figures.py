"""`--json` files are complete, plain JSON, or not there."""

import json
import stat

import numpy as np
import pytest

from records import figures_file


def test_figures_carry_seed_and_versions(tmp_path):
    path = tmp_path / "figures.json"
    figures_file.write(
        path, {"speed": np.float64(21.5), "missed": np.int64(0), "trace": np.array([1.0, 2.0])}, seed=7
    )
    read = json.loads(path.read_text())
    assert read["speed"] == 21.5
    assert read["missed"] == 0
    assert read["trace"] == [1.0, 2.0]
    assert read["seed"] == 7
    assert {"slewright", "python", "casadi", "numpy", "platform"} <= set(read["versions"])


def test_what_json_does_not_know_becomes_null(tmp_path):
    path = tmp_path / "figures.json"
    figures_file.write(path, {"a": float("nan"), "b": [np.inf, 1.0], "c": {"d": np.array([np.nan])}})
    assert json.loads(path.read_text()) | {"versions": 0} == {
        "a": None,
        "b": [None, 1.0],
        "c": {"d": [None]},
        "seed": None,
        "versions": 0,
    }


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "figures.json"
    figures_file.write(path, {"speed": 1.0})
    before = path.read_bytes()
    with pytest.raises(UnicodeEncodeError):
        figures_file.write_text(path, "half of it \udcff")
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_written_file_has_the_permissions_of_any_new_file(tmp_path):
    figures_file.write(tmp_path / "figures.json", {})
    (tmp_path / "other").touch()
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("figures.json", "other")}
    assert len(modes) == 1


def test_no_file_is_asked_for_none_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    figures_file.write(None, {"speed": 1.0})
    assert list(tmp_path.iterdir()) == []
