"""`slewright reconcile RECORDING --init DIR` on recordings as other tools and other people write them."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fmus.toolchain.codegen import model_config_h
from reconcile.equations.model import Folder
from reconcile.extend import extend
from reconcile.recordings.checks import open_folder, read_names
from reconcile.recordings.data import read_run
from reconcile.start.columns import read_columns, unit_in_name
from reconcile.start.write import start
from slewright.__main__ import run
from specs.units import known

INERTIA, FRICTION = 0.2, 0.3


def rig(rows: int = 1500, step: float = 0.01) -> dict[str, np.ndarray]:
    """A flywheel on a bearing, driven by steps of torque."""
    t = step * np.arange(rows)
    torque = np.repeat(np.random.default_rng(3).uniform(-1, 1, rows // 50 + 1), 50)[:rows]
    q, v = np.zeros(rows), np.zeros(rows)
    for k in range(rows - 1):
        v[k + 1] = v[k] + step * (torque[k] - FRICTION * v[k]) / INERTIA
        q[k + 1] = q[k] + step * 0.5 * (v[k] + v[k + 1])
    return {"t": t, "q": q, "v": v, "torque": torque}


def table(path: Path, columns: dict[str, np.ndarray], mark: str = ",", decimal: str = ".") -> Path:
    rows = [
        mark.join(f"{x:.9g}".replace(".", decimal) for x in r) for r in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join([mark.join(columns), *rows]) + "\n", encoding="utf-8")
    return path


def opened(recording: Path, out: Path) -> tuple[Folder, list]:
    """The folder that was written, and the recording read with the map beside it."""
    folder = open_folder(str(out))
    names = read_names(out / "map.toml", [v.name for v in (*folder.model.inputs, *folder.model.outputs)])
    return folder, read_run(recording, folder, names)


def value(folder: Folder, name: str) -> float:
    return next(v.start for v in folder.model.parameters if v.name == name)


def test_a_german_table_in_degrees(tmp_path: Path):
    r = rig()
    columns = {
        "Zeit [ms]": 1000 * r["t"], "Winkel [deg]": np.degrees(r["q"]),
        "Drehzahl [1/min]": r["v"] * 30 / np.pi,
        "Drehmoment [Nm]": r["torque"], "Temperatur [°C]": 20 + 0 * r["t"],
    }  # fmt: skip
    file = table(tmp_path / "rig.csv", columns, ";", ",")
    said = start(file, tmp_path / "first")
    assert said[0].startswith("template rotary")
    assert any("Temperatur" in s and "one value" in s for s in said)
    folder, (only,) = opened(file, tmp_path / "first")
    assert np.allclose(only.outputs["velocity"].values, r["v"], atol=1e-6)
    assert value(folder, "inertia") == pytest.approx(INERTIA, rel=0.05)
    assert value(folder, "friction") == pytest.approx(FRICTION, rel=0.05)


def test_units_at_the_end_of_names(tmp_path: Path):
    r = rig()
    columns = {
        "time_s": r["t"],
        "q_deg": np.degrees(r["q"]),
        "speed_rpm": r["v"] * 30 / np.pi,
        "tau_Nm": r["torque"],
    }
    file = table(tmp_path / "rig.csv", columns)
    start(file, tmp_path / "first")
    folder, (only,) = opened(file, tmp_path / "first")
    assert np.allclose(only.outputs["position"].values, r["q"], atol=1e-6)
    assert np.allclose(only.outputs["velocity"].values, r["v"], atol=1e-6)
    assert value(folder, "inertia") == pytest.approx(INERTIA, rel=0.05)


def test_names_that_say_nothing_are_told_by_the_data(tmp_path: Path):
    r = rig()
    columns = {"time": r["t"], "enc1_pos [rad]": r["q"], "ch2": r["v"], "ch3": r["torque"]}
    file = table(tmp_path / "rig.csv", columns)
    start(file, tmp_path / "first")
    text = (tmp_path / "first" / "model.py").read_text()
    assert "velocity is column 'ch2': guessed" in text
    assert "command is column 'ch3': guessed" in text
    assert "FILL IN the unit of 'ch2'" in (tmp_path / "first" / "map.toml").read_text()
    folder, (only,) = opened(file, tmp_path / "first")
    assert value(folder, "gain") == pytest.approx(1 / INERTIA, rel=0.05)
    assert set(only.outputs) == {"position", "velocity"}


def test_names_as_of_a_can_log_and_no_speed(tmp_path: Path):
    r = rig()
    columns = {"time": r["t"], "EEC1.ActPos [deg]": np.degrees(r["q"]), "DRV_TrqCmd [N.m]": r["torque"]}
    file = table(tmp_path / "rig.csv", columns)
    start(file, tmp_path / "first", "rotary")
    folder, (only,) = opened(file, tmp_path / "first")
    assert set(only.outputs) == {"position"}
    assert set(only.inputs) == {"torque"}
    assert value(folder, "inertia") == pytest.approx(INERTIA, rel=0.2)


def test_of_names_that_tell_nothing_at_all_the_one_that_moves_in_steps_is_the_input(tmp_path: Path):
    t = 0.001 * np.arange(400)
    dac = np.where((np.arange(400) // 50) % 2, -0.5, 0.5)
    adc = np.zeros(400)
    for k in range(399):
        adc[k + 1] = adc[k] + 0.001 / 0.008 * (dac[k] - adc[k])
    file = table(tmp_path / "rc.csv", {"Time": t, "ADC": adc, "DAC": dac})
    said = start(file, tmp_path / "first", "first-order")
    assert "dac: column DAC (guessed: it moves in steps)" in said
    folder, (only,) = opened(file, tmp_path / "first")
    assert (set(only.inputs), set(only.outputs)) == ({"dac"}, {"adc"})
    assert value(folder, "time_constant") == pytest.approx(0.008, rel=0.2)


def test_columns_that_all_move_in_steps_are_no_inputs(tmp_path: Path):
    t = np.arange(400.0)
    a, b = np.round(np.sin(t / 60), 1), np.round(np.sin(t / 80), 1)
    assert [c.role for c in read_columns(table(tmp_path / "r.csv", {"time": t, "A1": a, "B2": b}))] == [
        "",
        "",
    ]


@pytest.mark.parametrize(("heading", "said"), [("time", True), ("time [ms]", False)])
def test_a_time_without_a_unit_is_said_with_what_it_means(tmp_path: Path, heading: str, said: bool):
    r = rig()
    columns = {heading: 5000 + 5 * np.arange(len(r["t"])), "q [rad]": r["q"], "tau [N.m]": r["torque"]}
    lines = start(table(tmp_path / "r.csv", columns), tmp_path / "first")
    assert any("no unit; taken as s, it has a sample every 5 s" in line for line in lines) is said, lines


def test_two_joints_are_a_chain(tmp_path: Path):
    r = rig()
    columns = {"time": r["t"]}
    for j in (1, 2):
        columns |= {f"q{j} [rad]": r["q"] * j, f"dq{j} [rad/s]": r["v"] * j, f"tau{j} [Nm]": r["torque"]}
    file = table(tmp_path / "rig.csv", columns)
    assert start(file, tmp_path / "first")[0].startswith("template chain: there are 2 axes")
    folder, (only,) = opened(file, tmp_path / "first")
    assert len(folder.model.states) == 4
    assert set(only.inputs) == {"torque1", "torque2"}
    assert np.allclose(only.outputs["position2"].values, 2 * r["q"], atol=1e-6)


def test_a_force_without_a_number_drives_the_first_joint(tmp_path: Path):
    r = rig()
    columns = {"time": r["t"], "force [N]": r["torque"], "x1 [m]": r["q"], "x2 [m]": 2 * r["q"]}
    file = table(tmp_path / "rig.csv", columns)
    said = start(file, tmp_path / "first")
    assert any("force1: column force (guessed: it has no number" in line for line in said), said
    folder, (only,) = opened(file, tmp_path / "first")
    assert set(only.inputs) == {"force1"}
    assert [v.name for v in folder.model.inputs] == ["force1"]


@pytest.mark.parametrize(
    ("driven", "answers"), [("power [W]", "temperature [degC]"), ("voltage [V]", "current [A]")]
)
def test_of_two_quantities_that_are_no_motion_the_one_that_moves_in_steps_drives(tmp_path, driven, answers):
    r = rig()
    file = table(tmp_path / "rig.csv", {"time [s]": r["t"], driven: 60 * (r["torque"] > 0), answers: r["v"]})
    said = start(file, tmp_path / "first")
    assert said[0].startswith("template first-order"), said
    _, (only,) = opened(file, tmp_path / "first")
    assert set(only.inputs) == {driven.partition(" ")[0]}
    assert set(only.outputs) == {answers.partition(" ")[0]}


@pytest.mark.parametrize(("heading", "template"), [("yaw_rate_dps", "rotary"), ("speed [km/h]", "linear")])
def test_what_alone_is_left_beside_motion_drives_it_but_a_temperature_does_not(
    tmp_path, heading: str, template: str
):
    r = rig()
    columns = {"time [s]": r["t"], "pwm_us": 1500 + 100 * r["torque"], heading: r["v"]}
    start(table(tmp_path / "rig.csv", columns), tmp_path / "first")
    folder = open_folder(str(tmp_path / "first"))
    assert [v.name for v in folder.model.inputs] == ["command"]
    columns = {"time [s]": r["t"], "air [degC]": 20 + r["torque"], heading: r["v"]}
    said = start(table(tmp_path / "beside.csv", columns), tmp_path / "second")
    assert said[0].startswith(f"template {template}")
    assert open_folder(str(tmp_path / "second")).model.inputs == ()


def test_pulses_of_a_servo_have_a_middle_at_which_they_do_nothing(tmp_path: Path):
    r = rig()
    columns = {"time [s]": r["t"], "pwm [us]": 1512 + 100 * r["torque"], "rate [rad/s]": r["v"]}
    start(table(tmp_path / "rig.csv", columns), tmp_path / "first")
    folder = open_folder(str(tmp_path / "first"))
    unit = folder.model.inputs[0].unit
    assert value(folder, "neutral") * {"s": 1e6}.get(unit, 1.0) == pytest.approx(1512, abs=2)


def test_a_step_from_nothing_has_no_such_middle(tmp_path: Path):
    r = rig()
    columns = {"Tiempo (s)": r["t"], "pwm [us]": 255.0 * (r["t"] > 5.0), "rate [rad/s]": r["v"]}
    start(table(tmp_path / "rig.csv", columns), tmp_path / "first")
    folder = open_folder(str(tmp_path / "first"))
    assert "neutral" not in {v.name for v in folder.model.parameters}


def test_a_column_may_have_the_name_of_a_state(tmp_path: Path):
    r = filling(1.0)
    columns = {"time (millisec)": 1e3 * r["t"], "u": r["command"], "y": r["level"]}
    start(table(tmp_path / "tank.csv", columns), tmp_path / "first", "first-order")
    _, (only,) = opened(tmp_path / "tank.csv", tmp_path / "first")
    assert set(only.outputs) == {"y"}
    assert only.end_s == pytest.approx(r["t"][-1])


def test_a_level_is_filled_by_a_flow(tmp_path: Path):
    r = filling(1.0)
    columns = {"t [s]": r["t"], "pump [l/min]": 12 * r["command"], "level [mm]": 1000 * r["level"]}
    said = start(table(tmp_path / "tank.csv", columns), tmp_path / "first")
    assert said[0].startswith("template first-order"), said
    _, (only,) = opened(tmp_path / "tank.csv", tmp_path / "first")
    assert (set(only.inputs), set(only.outputs)) == ({"pump"}, {"level"})


def test_without_an_input(tmp_path: Path):
    t = 0.02 * np.arange(200)
    file = table(tmp_path / "fall.csv", {"time [s]": t, "height [m]": 30 - 0.5 * 9.81 * t**2})
    start(file, tmp_path / "first")
    folder, (only,) = opened(file, tmp_path / "first")
    assert folder.model.inputs == ()
    assert set(only.outputs) == {"position"}
    assert value(folder, "acceleration") == pytest.approx(-9.81, rel=0.05)
    assert {v.name: v.tolerance for v in folder.model.parameters} == {"acceleration": 2.0, "damping": 10.0}


TEMPLATES = [
    ("rotary", None),
    ("pendulum", None),
    ("first-order", None),
    ("chain", 1),
    ("chain", 3),
    ("free", None),
]


@pytest.mark.parametrize("driven", [True, False])
@pytest.mark.parametrize(("template", "dof"), TEMPLATES)
def test_every_template_runs_with_equations_of_one_unit(
    tmp_path: Path, template: str, dof: int | None, driven: bool
):
    r = rig(300)
    columns = {"time [s]": r["t"], "angle [deg]": np.degrees(r["q"]), "speed [rpm]": r["v"] * 30 / np.pi}
    columns |= {"torque [Nm]": r["torque"]} if driven else {}
    file = table(tmp_path / "rig.csv", columns)
    start(file, tmp_path / "first", template, dof)
    folder, runs = opened(file, tmp_path / "first")
    assert runs
    scaled(folder.model)


@pytest.mark.parametrize("unit", ["V", "A", "%", "N"])
def test_a_line_driven_by_any_command(tmp_path: Path, unit: str):
    r = rig(300)
    file = table(
        tmp_path / "rig.csv", {"time [s]": r["t"], "x [mm]": 1000 * r["q"], f"u [{unit}]": r["torque"]}
    )
    start(file, tmp_path / "first")
    folder, runs = opened(file, tmp_path / "first")
    assert runs
    scaled(folder.model)


def scaled(model) -> None:
    """Rates and outputs have their units: with other base units for everything they are the same ones."""
    bases = {"kg": 1.7, "m": 2.3, "s": 0.6, "A": 3.1, "K": 1.3}

    def size(name: str) -> float:
        unit = known(name)
        assert unit is not None, name
        return float(np.prod([bases.get(b, 1.0) ** n for b, n in unit.exponents.items()]))

    rng = np.random.default_rng(1)
    groups = (model.states, model.inputs, (), model.parameters)
    at = [rng.uniform(0.5, 1.5, len(g)) for g in groups]
    sizes = [np.array([size(v.unit) for v in g]) for g in groups]
    other = [a * s if len(a) else a for a, s in zip(at, sizes, strict=True)]
    for function, wanted in (
        (model.f, [size(v.unit) / bases["s"] for v in model.states]),
        (model.h, [size(v.unit) for v in model.outputs]),
    ):
        was, now = (np.asarray(function(*map(ca.DM, p))).ravel() for p in (at, other))
        assert np.allclose(now, was * wanted, rtol=1e-9)


def test_the_tolerance_of_what_is_known(tmp_path: Path):
    r = rig(300)
    file = table(tmp_path / "rig.csv", {"time [s]": r["t"], "angle [rad]": r["q"]})
    start(file, tmp_path / "first", "pendulum")
    gravity = next(v for v in open_folder(str(tmp_path / "first")).model.parameters if v.name == "gravity")
    assert gravity.tolerance == 0.001


def test_a_pendulum_of_which_a_gyroscope_alone_is_recorded(tmp_path: Path):
    """Its angle is told by the sum of its rate, without the sensor's zero."""
    time = np.arange(0.0, 20.0, 0.02)
    rate = np.exp(-0.05 * time) * np.sin(np.sqrt(14.0) * time)
    file = table(tmp_path / "fork.csv", {"time [s]": time, "gyro rate [rad/s]": rate + 1.4})
    start(file, tmp_path / "first", "pendulum")
    model = open_folder(str(tmp_path / "first")).model
    assert [v.name for v in model.outputs] == ["velocity"]
    length = next(v for v in model.parameters if v.name == "length")
    assert length.start == pytest.approx(9.81 / 14.0, rel=0.05)


@pytest.mark.parametrize("template", ["first-order", "free"])
@pytest.mark.parametrize("beside", [{}, {"Q1": np.full(80, 50.0)}])
@pytest.mark.parametrize("heading", ["T1", "Voltage ( V )"])
def test_what_alone_moves_is_the_output_whatever_it_is_called(tmp_path: Path, template, beside, heading):
    """A heater switched on before the recording began; a sensor of which there is the voltage alone."""
    t = 3.0 * np.arange(80)
    columns = {"time [s]": t, **beside, heading: np.round(60.0 - 40.0 * np.exp(-t / 90.0), 1)}
    file = table(tmp_path / "r.csv", columns)
    start(file, tmp_path / "first", template)
    folder, (only,) = opened(file, tmp_path / "first")
    assert folder.model.inputs == ()
    assert list(only.outputs) == [{"T1": "t1"}.get(heading, "voltage")]


@pytest.mark.parametrize(("swing", "unit"), [(25.0, "deg"), (0.4, "")])
def test_an_angle_without_a_unit_that_swings_by_many_turns_is_in_degrees(tmp_path: Path, swing, unit):
    t = 0.05 * np.arange(400)
    file = table(tmp_path / "r.csv", {"time [s]": t, "theta": swing * np.exp(-0.05 * t) * np.cos(4.0 * t)})
    start(file, tmp_path / "first", "pendulum")
    text = (tmp_path / "first" / "map.toml").read_text()
    assert ('"theta" = "position [deg]"' in text) == bool(unit)
    (only,) = opened(file, tmp_path / "first")[1]
    assert np.ptp(only.outputs["position"].values) == pytest.approx(
        np.radians(50.0) if unit else 0.8, rel=0.1
    )


@pytest.mark.parametrize(("temperature", "heat"), [("T1", "Q1"), ("T1 [degC]", "Q1 [%]")])
def test_a_heater_and_its_temperature_are_known_by_their_usual_names(tmp_path: Path, temperature, heat):
    t = 1.0 * np.arange(400)
    q = np.where(t < 20.0, 0.0, 50.0)
    rise = 35.0 * (1.0 - np.exp(-np.maximum(t - 20.0, 0.0) / 90.0))
    file = table(tmp_path / "r.csv", {"time [s]": t, temperature: np.round(21.0 + rise, 1), heat: q})
    assert start(file, tmp_path / "first")[0].startswith("template first-order")
    _, (only,) = opened(file, tmp_path / "first")
    assert list(only.inputs) == ["q1"]
    assert list(only.outputs) == ["t1"]


@pytest.mark.parametrize(
    ("angle", "beside", "template"),
    [
        (lambda t: np.exp(-0.05 * t) * np.cos(4.0 * t) + 0.2, {}, "pendulum"),
        (lambda t: 2.0 * t, {}, "rotary"),
        (lambda t: 1.0 - np.exp(-t), {}, "rotary"),
        (lambda t: np.cos(4.0 * t), {"torque [N.m]": lambda t: np.sin(4.0 * t)}, "rotary"),
        (lambda t: np.cos(4.0 * t), {"angle_target": lambda t: np.sin(4.0 * t)}, "rotary"),
    ],
)
def test_an_angle_that_swings_by_itself_is_a_pendulums(tmp_path: Path, angle, beside, template):
    t = 0.05 * np.arange(400)
    columns = {"time [s]": t, "angle [rad]": angle(t), **{n: f(t) for n, f in beside.items()}}
    said = start(table(tmp_path / "r.csv", columns), tmp_path / "first")
    assert said[0].startswith(f"template {template}: column angle is in rad")


@pytest.mark.parametrize(
    ("columns", "arguments", "said"),
    [
        ({"time": np.arange(20.0), "angle [deg]": np.arange(20.0)}, (), "20 samples, and 30 are needed"),
        ({"time": np.arange(50.0), "angle [deg]": np.ones(50)}, (), "every column keeps one value"),
        ({"angle [deg]": np.sin(np.arange(50.0)), "b": np.cos(np.arange(50.0))}, (), "time"),
        ({"time": np.arange(50.0), "foo": np.sin(np.arange(50.0))}, (), "rotary | linear | pendulum"),
        ({"time": np.arange(50.0), "angle [deg]": np.arange(50.0)}, ("--template", "rotor"), "valid: rotary"),
        ({"time": np.arange(50.0), "angle [deg]": np.arange(50.0)}, ("--template", "linear"), "no position"),
        ({"time": np.arange(50.0), "angle [deg]": np.arange(50.0)}, ("--dof", "0"), "--dof N"),
    ],
)  # fmt: skip
def test_what_no_model_can_start_from(tmp_path: Path, capsys, columns, arguments, said: str):
    file = table(tmp_path / "rig.csv", columns)
    assert run(["reconcile", str(file), "--init", str(tmp_path / "first"), *arguments]) == 2
    assert said in capsys.readouterr().err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rig.csv"]


def test_a_folder_that_is_not_empty_stays_as_it_is(tmp_path: Path, capsys):
    file = table(tmp_path / "rig.csv", {"time": np.arange(50.0), "angle [deg]": np.arange(50.0)})
    assert run(["reconcile", str(file), "--init", str(tmp_path)]) == 2
    assert "not empty" in capsys.readouterr().err
    assert run(["reconcile", str(file)]) == 2
    assert "--model MODEL and --out DIR" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "unit"),
    [("q_rad", "rad"), ("x_in", "in"), ("flow_in", ""),
     ("torque(Nm)", "N.m"), ("speed rpm", "rpm"), ("rate_degps", "deg/s"), ("joint_s", ""),
     ("v_kmh", "km/h"),
     ("rpm", "rpm"), ("RPM1", "rpm"), ("MotorRpm", "rpm"), ("rpm_deg", "deg"), ("carpmat", "")],
)  # fmt: skip
def test_units_read_out_of_names(name: str, unit: str):
    assert unit_in_name(name) == unit


def roles(tmp_path: Path, columns: dict[str, np.ndarray]) -> list[str]:
    return [c.role for c in read_columns(table(tmp_path / "rig.csv", columns))]


def test_a_wanted_value_is_no_output_and_an_input_where_there_is_no_other(tmp_path: Path):
    r = rig(300)
    columns = {"time": r["t"], "q_des [rad]": r["q"] + 1, "q [rad]": r["q"]}
    assert roles(tmp_path, columns) == ["input", "position"]
    assert roles(tmp_path, columns | {"tau": r["torque"]}) == ["setpoint", "position", "input"]
    levels = {"time": r["t"], "goal": np.round(r["q"]), "ch1": np.round(r["v"])}
    assert roles(tmp_path, levels) == ["input", ""]


def filling(step: float, rows: int = 400) -> dict[str, np.ndarray]:
    """A vessel that fills and empties, driven by a held command; its time constant is 20 steps."""
    command = np.repeat(np.random.default_rng(4).uniform(0, 1, rows // 40 + 1), 40)[:rows]
    level = np.zeros(rows)
    for k in range(rows - 1):
        level[k + 1] = level[k] + (2.0 * command[k] - level[k]) / 20.0
    return {"t": step * np.arange(rows), "command": command, "level": level}


@pytest.mark.parametrize("heading", ["pump", "ch1", "valve opening"])
def test_what_moves_a_level_is_not_taken_for_its_speed(tmp_path: Path, heading: str):
    r = filling(4.0)
    file = table(tmp_path / "tank.csv", {"t [s]": r["t"], heading: r["command"], "level [m]": r["level"]})
    start(file, tmp_path / "first", "first-order")
    _, (only,) = opened(file, tmp_path / "first")
    assert set(only.outputs) == {"level"}
    assert len(only.inputs) == 1


def test_a_sample_that_stands_for_no_value_bends_no_estimate(tmp_path: Path):
    r = filling(4.0)
    r["level"][50] = -999.0
    file = table(tmp_path / "r.csv", {"t [s]": r["t"], "pump [V]": r["command"], "level [m]": r["level"]})
    start(file, tmp_path / "first", "first-order")
    assert value(open_folder(str(tmp_path / "first")), "time_constant") == pytest.approx(80.0, rel=0.1)


def test_a_lag_that_the_model_lacks_bends_an_estimate_by_less_than_two(tmp_path: Path):
    r = filling(4.0)
    read = r["level"].copy()
    for k in range(len(read) - 1):
        read[k + 1] = read[k] + (r["level"][k] - read[k]) / 8.0
    file = table(tmp_path / "r.csv", {"t [s]": r["t"], "pump [V]": r["command"], "level [m]": read})
    start(file, tmp_path / "first", "first-order")
    folder = open_folder(str(tmp_path / "first"))
    assert 80.0 < value(folder, "time_constant") < 160.0
    assert 1.0 < value(folder, "gain") < 4.0
    assert "a guess" not in (tmp_path / "first" / "model.py").read_text(encoding="utf-8")


@pytest.mark.parametrize("step", [1e-5, 30.0, 3600.0])
def test_what_is_recorded_very_fast_or_slowly_can_be_run(tmp_path: Path, step: float):
    r = filling(step)
    file = table(tmp_path / "rc.csv", {"t [s]": r["t"], "u_in [V]": r["command"], "u_out [V]": r["level"]})
    start(file, tmp_path / "first", "first-order")
    folder, (only,) = opened(file, tmp_path / "first")
    assert set(only.outputs) == {"u_out"}
    assert f"#define SLW_STEP {float(step)!r}\n" in model_config_h(folder.model, "")
    entry = ("sensor_delay", "u_out", None, {"delay": 200.0 * step})
    longer = extend(tmp_path / "first", [entry], {})
    assert longer.sample_time == folder.model.step
    assert longer.max_delay >= 200.0 * step
    assert "SLW_ECHO" in model_config_h(longer, "")


def test_the_one_output_has_the_other_column_as_its_input_and_is_asked_for_no_unit_that_the_model_refuses(
    tmp_path: Path,
):
    flow = np.random.default_rng(1).uniform(0.1, 0.7, 200)
    heat = 300.0 - 8.0 * np.convolve(flow, np.full(5, 0.2), "same")
    file = table(tmp_path / "a.csv", {"time [s]": np.arange(200.0), "flow": flow, "warm [K]": heat})
    start(file, tmp_path / "first")
    _, (run,) = opened(file, tmp_path / "first")
    assert list(run.outputs) == ["warm"]
    assert list(run.inputs) == ["flow"]
    names = (tmp_path / "first" / "map.toml").read_text()
    assert "FILL IN" not in names
    assert "'flow' has no unit" in names
