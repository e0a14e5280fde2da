"""MATLAB's files: vectors, rates, structures, Simulink's logs; what is refused."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from records.formats import read_measurement
from records.measurement import Measurement
from specs.errors import InputError

N = 50
T = 0.02 * np.arange(N)
Y = np.sin(T)


def read(path: Path, variables: dict, names: dict[str, str] | None = None, **options) -> Measurement:
    """What is read of a file with these variables."""
    savemat(path / "a.mat", variables, **options)
    return read_measurement(path / "a.mat", names=names)


@pytest.mark.parametrize("version", ["4", "5"])
def test_vectors_of_one_length_share_the_one_that_is_called_a_time(tmp_path: Path, version: str):
    found = read(tmp_path, {"time": T, "speed": Y, "gain": 3.0, "table": np.ones(7)}, format=version)
    assert set(found.channels) == {"speed"}
    np.testing.assert_allclose(found["speed"].time, T)
    np.testing.assert_allclose(found["speed"].values, Y)
    assert found.reading == ("time: time, its unit is not stated: taken as s",)
    assert any("left out table: not as long as the time, 50 samples" in text for text in found.repairs)


def test_a_unit_in_the_name_of_the_time_counts(tmp_path: Path):
    found = read(tmp_path, {"time_ms": 1000.0 * T, "speed": Y}, do_compression=True)
    np.testing.assert_allclose(found["speed"].time, T)


@pytest.mark.parametrize(("name", "value"), [("ActualRate", 50.0), ("fs", 50.0), ("Ts", 0.02), ("dt", 0.02)])
def test_without_a_time_a_rate_or_a_sample_time_counts_it(tmp_path: Path, name: str, value: float):
    found = read(tmp_path, {"data": Y, name: value, "trial": "first"})
    np.testing.assert_allclose(found["data"].time, T)
    assert f"time: counted, 50 samples a second by {name} = {value:g}" in found.reading


def test_structures_have_their_own_time_or_that_of_the_file(tmp_path: Path):
    own = {"t": T[:20] * 2.0, "y": Y[:20]}
    found = read(tmp_path, {"t": T, "u": Y, "y": -Y, "inner": {"x": 2.0 * Y}, "slow": own})
    assert set(found.channels) == {"u", "y", "x", "slow.y"}
    np.testing.assert_allclose(found["x"].time, T)
    np.testing.assert_allclose(found["slow.y"].time, T[:20] * 2.0)


def test_a_log_of_simulink_has_its_labels(tmp_path: Path):
    signals = np.zeros(2, dtype=[("values", object), ("label", object)])
    signals[0], signals[1] = (Y, "slew angle"), (np.stack([Y, -Y], axis=1), "")
    found = read(tmp_path, {"logged": {"time": T, "signals": signals, "blockName": "model/Scope"}})
    assert set(found.channels) == {"slew angle", "signal2_1", "signal2_2"}


def test_what_to_file_writes_has_its_time_in_the_first_row(tmp_path: Path):
    found = read(tmp_path, {"ans": np.stack([T, Y, -Y])})
    assert set(found.channels) == {"ans_2", "ans_3"}
    np.testing.assert_allclose(found["ans_3"].values, -Y)
    assert "first row of ans" in found.reading[0]


def test_a_map_names_the_time_and_its_unit(tmp_path: Path):
    found = read(tmp_path, {"x": 1e6 * T, "y": Y}, {"x": "time [us]", "y": "q_slew [deg]"})
    np.testing.assert_allclose(found["q_slew"].time, T)
    np.testing.assert_allclose(found["q_slew"].values, np.radians(Y))


@pytest.mark.parametrize(
    ("variables", "said"),
    [
        ({"speed": Y}, "no time column .* among speed"),
        ({"t": T, "time": T, "y": Y}, "2 columns may be the"),
        ({"note": "nothing"}, "holds no numbers"),
        ({"z": 1j * Y}, "holds no numbers: left out z: .* complex"),
    ],
)
def test_what_has_no_time_or_no_numbers_is_refused(tmp_path: Path, variables: dict, said: str):
    with pytest.raises(InputError, match=said):
        read(tmp_path, variables)


def test_version_7_3_and_damaged_files_are_refused(tmp_path: Path):
    path = tmp_path / "b.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512, b" ") + b"\x89HDF\r\n\x1a\n" + bytes(100))
    with pytest.raises(InputError, match=r"version 7.3, which is not read; save\('FILE', '-v7'"):
        read_measurement(path)
    savemat(path, {"t": T, "y": Y})
    whole = path.read_bytes()
    random = np.random.default_rng(1)
    for _ in range(4):
        damaged = bytearray(whole[: random.integers(130, len(whole))])
        for at in random.integers(128, len(damaged), 3):
            damaged[at] = random.integers(256)
        path.write_bytes(bytes(damaged))
        with pytest.raises(InputError, match=r"b\.mat"):
            read_measurement(path)
