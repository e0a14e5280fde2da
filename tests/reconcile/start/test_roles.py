"""Which columns `--init` takes for inputs and outputs, and what it says of the others."""

from pathlib import Path

import numpy as np
import pytest

from reconcile.recordings.checks import open_folder
from reconcile.start.columns import read_columns
from reconcile.start.write import start
from specs.errors import InputError
from tests.reconcile.start.test_init import filling, opened, rig, table, value

SMOOTH = np.random.default_rng(7).standard_normal(400).cumsum()  # moves with every sample


def filled(tmp_path: Path, pump: str, level: str, **others: np.ndarray) -> Path:
    """A recording of a vessel under a drive that never keeps a value."""
    r, level_is = filling(1.0), np.zeros(400)
    for k in range(399):
        level_is[k + 1] = level_is[k] + (SMOOTH[k] - level_is[k]) / 20.0
    return table(tmp_path / "r.csv", {"time [s]": r["t"], pump: SMOOTH, level: level_is, **others})


def taken(file: Path, out: Path, template: str | None = None) -> tuple[list[str], list[str], list[str]]:
    """Inputs and outputs of the model that is written, and what is said."""
    said = start(file, out, template)
    _, (only, *_) = opened(file, out)
    return list(only.inputs), list(only.outputs), said


@pytest.mark.parametrize(
    ("pump", "level"),
    [
        ("pump [V]", "level [V]"), ("pump [%]", "tank level [%]"), ("heater [V]", "temperature [V]"),
        ("pump [V]", "float [V]"), ("u [V]", "ch2 [V]"), ("pump level [%]", "height of water [V]"),
        ("voltage [V]", "current [A]"), ("u [V]", "coil [A]"), ("u", "i [A]"),
        ("feed [V]", "flow_out [V]"),
        ("feed_in [degC]", "boiler [degC]"), ("feed_in [N.m]", "pull_out [N.m]"),
        ("target [degC]", "oven [degC]"), ("valve [V]", "probe"),
    ],
)  # fmt: skip
def test_of_two_columns_that_names_tell_one_is_the_input_and_the_other_the_output(tmp_path, pump, level):
    file = filled(tmp_path, pump, level)
    for number, template in enumerate((None, "first-order")):
        inputs, outputs, _ = taken(file, tmp_path / f"first{number}", template)
        assert (len(inputs), len(outputs)) == (1, 1)
        assert inputs[0].split("_")[0] == pump.split()[0].split("_")[0]
        assert outputs[0].split("_")[0] == level.split()[0].split("_")[0]


def test_a_current_is_the_output_of_first_order_beside_a_gap_and_is_told_of_else(tmp_path: Path):
    file = filled(tmp_path, "u [V]", "current [A]", **{"gap [mm]": 20.0 + np.cos(np.arange(400.0))})
    assert taken(file, tmp_path / "first", "first-order")[:2] == (["u"], ["current"])
    assert taken(file, tmp_path / "free", "free")[:2] == (["u"], ["current", "gap"])
    *_, said = taken(file, tmp_path / "alone")
    assert any("a current, driven by u, so it may be an output" in line for line in said), said


def test_a_cells_current_is_switched_and_drives_its_voltage(tmp_path: Path):
    noise = 0.005 * np.random.default_rng(3).standard_normal(400)
    current = np.repeat([0.0, -6.0, 0.0, -3.0], 100) + noise
    drop = np.zeros(400)
    for k in range(399):
        drop[k + 1] = drop[k] + (0.02 * current[k] - drop[k]) / 30.0
    columns = {"time [s]": np.arange(400.0), "current [A]": current, "voltage [V]": 4.1 + drop}
    assert taken(table(tmp_path / "cell.csv", columns), tmp_path / "cell")[:2] == (["current"], ["voltage"])


def test_a_drives_current_may_be_its_input(tmp_path: Path):
    r = rig()
    columns = {"time [s]": r["t"], "current [A]": r["torque"], "voltage [V]": r["v"] + r["torque"]}
    file = table(tmp_path / "r.csv", columns | {"speed [rad/s]": r["v"]})
    *_, said = taken(file, tmp_path / "first")
    assert "command: column current (its unit is A)" in said
    assert any("voltage' is not used: its unit is V, so it may be an input" in line for line in said), said


def test_a_number_is_no_motion(tmp_path: Path):
    """Its `v` is a voltage; a model of a speed in m/s could not read it."""
    r = rig()
    angle = np.degrees(r["q"] + 5.0 * r["t"])
    file = table(tmp_path / "r.csv", {"time [s]": r["t"], "v [1]": r["torque"], "theta [deg]": angle})
    inputs, outputs, said = taken(file, tmp_path / "first")
    assert said[0].startswith("template rotary")
    assert (inputs, outputs) == (["command"], ["position"])


def test_a_wanted_position_drives_by_how_far_the_position_is_off(tmp_path: Path):
    t = 0.01 * np.arange(1500)
    wanted, q, v = np.repeat(np.sin(np.arange(15)), 100), np.zeros(1500), np.zeros(1500)
    for k in range(1499):
        v[k + 1] = v[k] + 0.01 * (100.0 * (wanted[k] - q[k]) - 12.0 * v[k])
        q[k + 1] = q[k] + 0.005 * (v[k] + v[k + 1])
    file = table(
        tmp_path / "r.csv", {"time [s]": t, "ref [deg]": np.degrees(wanted), "q [deg]": np.degrees(q)}
    )
    assert taken(file, tmp_path / "first")[:2] == (["command"], ["position"])
    folder = open_folder(str(tmp_path / "first"))
    assert value(folder, "gain") == pytest.approx(100.0, rel=0.2)
    assert value(folder, "damping") == pytest.approx(12.0, rel=0.2)


@pytest.mark.parametrize(
    ("heading", "said"),
    [
        ("heater [%]", "record from before it changes, and it is the input"),
        ("air [bar]", "it keeps one value"),
    ],
)
def test_of_an_input_that_keeps_one_value_it_is_said_how_to_record_it(tmp_path: Path, heading, said):
    warm = {"time [s]": np.arange(400.0), heading: np.full(400, 30.0), "temp [degC]": SMOOTH}
    inputs, _, lines = taken(table(tmp_path / "r.csv", warm), tmp_path / "first")
    assert inputs == []
    assert lines[-1].endswith(said)


@pytest.mark.parametrize("template", [None, "first-order"])
def test_a_refusal_says_how_a_heading_tells_the_role(tmp_path: Path, template):
    both = {"time [s]": np.arange(400.0), "u1 [V]": SMOOTH, "u2 [V]": SMOOTH**2}
    with pytest.raises(InputError, match=r"ends with _out is an output, one that ends with _in an input"):
        start(table(tmp_path / "r.csv", both), tmp_path / "first", template)


def test_a_level_that_is_read_in_coarse_steps_is_no_input(tmp_path: Path):
    columns = {"time [s]": np.arange(400.0), "pump [V]": SMOOTH, "level [V]": np.round(SMOOTH / 5.0)}
    assert [c.role for c in read_columns(table(tmp_path / "r.csv", columns))] == ["input", "other"]


@pytest.mark.parametrize(
    ("heading", "moved"), [("speed [V]", True), ("wheel rpm [1]", True), ("level [V]", False)]
)
def test_a_speed_in_any_unit_is_moved_by_forces(tmp_path: Path, heading: str, moved: bool):
    file = filled(tmp_path, "duty [%]", heading)
    start(file, tmp_path / "first", "first-order")
    assert bool(open_folder(str(tmp_path / "first")).ports.axes) is moved
