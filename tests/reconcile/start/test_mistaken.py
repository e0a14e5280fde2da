"""Signs and units that no other channel contradicts: the model errs less with a channel multiplied."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reconcile.judging import mistaken
from reconcile.judging.readings import Reading, asked, multiplied, relabelled
from reconcile.recordings import checks
from reconcile.recordings.data import Run, Signal, read_run, split
from reconcile.search.core import Core
from reconcile.start.units import other_units
from reconcile.workflow import examine
from slewright.__main__ import run
from specs.errors import InputError
from tests.reconcile.start.test_init import rig, table

ROTARY = """
from fmus.definition import Model, Variable

MODEL = Model(
    name="rotary", description="A flywheel", kind="continuous", step=0.02,
    states=(Variable("q", "rad", "Angle"), Variable("v", "rad/s", "Speed")),
    inputs=(Variable("torque", "N.m", "Torque"),),
    outputs=(Variable("position", "rad", "Angle"),),
    parameters=(
        Variable("inertia", "kg.m2", "Inertia", start=0.25, min=0.02, max=2),
        Variable("friction", "N.m.s/rad", "Friction", start=0.2, min=0, max=2),
    ),
    rhs=lambda x, u, m, p: {"q": x.v, "v": (u.torque - p.friction * x.v) / p.inertia},
    out=lambda x, u, m, p: {"position": x.q},
)
"""
SPEED = ROTARY.replace('Variable("position", "rad", "Angle")', 'Variable("speed", "rad/s", "Speed")').replace(
    '{"position": x.q}', '{"speed": x.v}'
)
SWINGING = (
    ROTARY.replace('inputs=(Variable("torque", "N.m", "Torque"),)', "inputs=()")
    .replace("(u.torque - p.friction * x.v) / p.inertia", "-p.pull * sin(x.q) - p.friction * x.v")
    .replace(
        'Variable("inertia", "kg.m2", "Inertia", start=0.25, min=0.02, max=2)',
        'Variable("pull", "1/s2", "g / l", start=9, min=1, max=50)',
    )
    .replace("from fmus", "from casadi import sin\nfrom fmus")
)
GAIN = ROTARY.replace("(u.torque -", "(p.gain * u.torque -").replace(
    "    parameters=(", '    parameters=(Variable("gain", "1", "Gain", start=-1, min=-5, max=5),'
)
LAG = """
from fmus.definition import Model, Variable

MODEL = Model(
    name="lag", description="A level", kind="continuous", step=0.02,
    states=(Variable("y", "1", "Level"),), inputs=(Variable("u", "1", "Command"),),
    outputs=(Variable("level", "1", "Level"),),
    parameters=(
        Variable("T", "s", "Time constant", start=0.6, min=0.05, max=10),
        Variable("gain", "1", "Gain", start=1.7, min=0.1, max=10),
    ),
    rhs=lambda x, u, m, p: {"y": (p.gain * u.u - x.y) / p.T},
    out=lambda x, u, m, p: {"level": x.y},
)
"""
FALLING = """
from fmus.definition import Model, Variable

MODEL = Model(
    name="falling", description="A ball", kind="continuous", step=0.02,
    states=(Variable("h", "m", "Height"), Variable("v", "m/s", "Speed")),
    inputs=(), outputs=(Variable("height", "m", "Height"),),
    parameters=(Variable("g", "m/s2", "Gravity", start=9.81, tolerance=0.001, min=9.7, max=9.9),),
    rhs=lambda x, u, m, p: {"h": x.v, "v": p.g},
    out=lambda x, u, m, p: {"height": x.h},
)
"""


def folder(path: Path, text: str) -> Path:
    path.mkdir()
    (path / "model.py").write_text(text, encoding="utf-8")
    return path


def recorded(path: Path, factor: float = 1.0) -> Path:
    """A flywheel's angle with noise, and its torque as somebody wrote it down."""
    r = rig(rows=1600)
    noisy = r["q"] + 0.002 * np.random.default_rng(8).normal(size=len(r["q"]))
    every = slice(None, None, 2)
    return table(path, {"time": r["t"][every], "q": noisy[every], "M": factor * r["torque"][every]})


def named(path: Path, torque: str) -> Path:
    path.write_text(f'[names]\n"q" = "position [rad]"\n"M" = "{torque}"\n', encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("factor", "stated", "line"),
    [(-1.0, "torque [N.m]", "-torque [N.m]"), (1.0, "-torque [N.m]", "torque [N.m]")],
)
def test_an_input_turned_round_is_asked_and_nothing_is_written(
    factor: float, stated: str, line: str, tmp_path: Path, capsys
):
    model, names = folder(tmp_path / "model", ROTARY), named(tmp_path / "map.toml", stated)
    out, file = tmp_path / "out", recorded(tmp_path / "a.csv", factor)
    arguments = ["reconcile", str(file), "--model", str(model), "--map", str(names), "--out", str(out)]
    assert run(arguments) == 2
    said = capsys.readouterr().err
    assert "column M: with the sign turned" in said
    assert f"write 'M' = '{line}' in" in said
    assert said.rstrip().endswith("--as-stated takes the recordings as they are")
    assert not out.exists()


def test_a_question_is_foretold_and_may_be_left_out(tmp_path: Path, capsys):
    model, names = folder(tmp_path / "model", ROTARY), named(tmp_path / "map.toml", "torque [N.m]")
    file, out = recorded(tmp_path / "a.csv", -1.0), tmp_path / "out"
    given = ["reconcile", str(file), "--model", str(model), "--map", str(names)]
    assert run([*given, "--check-only"]) == 0
    assert "question: column M: with the sign turned" in capsys.readouterr().out
    assert run([*given, "--out", str(out), "--report-only", "--as-stated"]) == 0
    assert (out / "report.json").is_file()


@pytest.mark.parametrize(
    ("factor", "word"), [pytest.param(1000.0, "a factor of 1000", marks=pytest.mark.long), (1.0, "")]
)
def test_an_input_in_another_unit_is_asked_and_a_right_one_is_not(tmp_path: Path, factor: float, word: str):
    own = checks.open_folder(str(folder(tmp_path / "model", ROTARY)))
    names = {"q": "position [rad]", "M": "torque [N.m]"}
    runs = read_run(recorded(tmp_path / "a.csv", factor), own, names)
    if word:
        with pytest.raises(InputError, match=word):
            examine(own, runs, names=names)
    else:
        assert examine(own, runs, names=names)[0]["verdict"] in ("agrees", "reestimated")


@pytest.mark.parametrize(("factor", "asked"), [(0.01, "column u: 100 times as large"), (1.0, "")])
def test_a_command_in_per_cent_is_asked_where_a_gain_would_lie_beyond_its_limits(
    tmp_path: Path, factor: float, asked: str
):
    text = LAG.replace('Variable("level", "1"', 'Variable("level", "bar"')
    own = checks.open_folder(str(folder(tmp_path / "model", text)))
    time, u = 0.02 * np.arange(1200), np.repeat([20.0, 30.0, 60.0, 45.0, 80.0, 20.0], 200)
    level = np.full(len(time), 34.0)
    for k in range(1, len(time)):
        level[k] = 1.7 * u[k - 1] + (level[k - 1] - 1.7 * u[k - 1]) * np.exp(-0.02 / 0.6)
    level += 0.3 * np.random.default_rng(4).normal(size=len(time))
    file = table(tmp_path / "a.csv", {"time": time, "u [1]": factor * u, "level [bar]": level})
    core = Core(own, split(read_run(file, own), (), ()))
    said = mistaken.evident(core)
    assert said.startswith(asked)
    assert bool(said) == bool(asked)


@pytest.mark.parametrize("swing", [1.2, 0.09], ids=["a large swing", "a small swing"])
@pytest.mark.parametrize(("factor", "word"), [(57.29578, "degrees against radians"), (1.0, "")])
def test_an_angle_in_degrees_is_asked_and_one_in_radians_is_not(
    tmp_path: Path, factor: float, word: str, swing: float
):
    own = checks.open_folder(str(folder(tmp_path / "model", SWINGING)))
    step, fine = 0.02, 20
    q, v, angles = swing, 0.0, []
    for _ in range(400):
        angles.append(q)
        for _ in range(fine):
            v += step / fine * (-12.0 * np.sin(q) - 0.1 * v)
            q += step / fine * v
    noise = 0.002 * swing * np.random.default_rng(5).normal(size=len(angles))
    columns = {"time": step * np.arange(len(angles)), "position": factor * (np.array(angles) + noise)}
    core = Core(own, split(read_run(table(tmp_path / "a.csv", columns), own), (), ()))
    assert word in mistaken.evident(core)
    assert bool(mistaken.evident(core)) == bool(word)


def test_a_dead_zone_that_takes_nearly_all_of_a_command_is_no_turned_sign(tmp_path: Path):
    own, step = checks.open_folder(str(folder(tmp_path / "model", LAG))), 0.02
    u = np.repeat(np.random.default_rng(3).uniform(-1, 1, 20), 50)
    y, noise = np.zeros(len(u)), np.random.default_rng(9).normal(size=len(u))
    for k in range(len(u) - 1):
        beyond = np.sign(u[k]) * max(abs(u[k]) - 0.8, 0.0)
        y[k + 1] = y[k] + (2.0 * beyond - y[k]) * (1 - np.exp(-step / 0.5))
    columns = {"time": step * np.arange(len(u)), "u": u, "level": y + 0.002 * np.std(y) * noise}
    core = Core(own, split(read_run(table(tmp_path / "a.csv", columns), own), (), ()))
    assert mistaken.evident(core) == ""


@pytest.mark.parametrize(("start", "asked"), [("start=-1", True), ("start=-1, tolerance=10", False)])
def test_a_gain_that_turns_its_sign_is_said_unless_it_was_a_guess(tmp_path: Path, start: str, asked: bool):
    own = checks.open_folder(str(folder(tmp_path / "model", GAIN.replace("start=-1", start))))
    names = {"q": "position [rad]", "M": "torque [N.m]"}
    figures, _ = examine(own, read_run(recorded(tmp_path / "a.csv"), own, names))
    assert ("instead of -1: is the sign of a channel turned?" in figures["sentence"]) == asked


@pytest.mark.long
def test_a_parameter_at_its_limit_is_said(tmp_path: Path):
    text = ROTARY.replace("start=0.25, min=0.02, max=2", "start=0.25, min=0.24, max=2")
    own = checks.open_folder(str(folder(tmp_path / "model", text)))
    names = {"q": "position [rad]", "M": "torque [N.m]"}
    figures, _ = examine(own, read_run(recorded(tmp_path / "a.csv"), own, names))
    assert "inertia lies at its limit, 0.24 (in model.py)" in figures["sentence"]


def test_gravity_that_points_the_other_way_is_asked(tmp_path: Path):
    own = checks.open_folder(str(folder(tmp_path / "model", FALLING)))
    t, random, runs = 0.02 * np.arange(40), np.random.default_rng(4), []
    for i, v in enumerate((0.0, 1.0, 2.5)):
        h = 3.0 + v * t - 0.5 * 9.81 * t**2 + 0.003 * random.normal(size=len(t))
        runs += read_run(table(tmp_path / f"{i}.csv", {"time": t, "height": h}), own)
    with pytest.raises(InputError, match="or gravity in model"):
        examine(own, runs)


def test_an_angle_in_radians_that_is_said_to_be_in_degrees_is_asked_beside_an_input_too(tmp_path: Path):
    """With rpm in place of degrees the model errs as little, but its inertia is six times as large."""
    own = checks.open_folder(str(folder(tmp_path / "model", ROTARY)))
    r = rig(rows=1600)
    columns = {"time": r["t"], "position [deg]": r["q"], "torque [N.m]": r["torque"]}
    core = Core(own, split(read_run(table(tmp_path / "a.csv", columns), own), (), ()))
    assert "column position: 57.3 times as large" in mistaken.evident(core)


@pytest.mark.parametrize(
    ("ratio", "unit", "columns", "asked"),
    [
        (1e3, "s", "qM", "column clock: 0.001 times as long"),
        (1e6, "s", "qM", "column clock: 1e-06 times as long"),
        (1.0, "ms", "qM", "column clock: 1000 times as long"),
        (1.0, "min", "qM", "column clock: 0.01667 times as long"),
        (1.0 / 60.0, "s", "qM", "column clock: 60 times as long"),
        (1.0, "s", "Mq", "columns q and M: with one taken for the other"),
        (1.0, "s", "qM", ""),
    ],
)
def test_a_clock_in_another_unit_and_exchanged_columns_are_asked(
    tmp_path: Path, ratio: float, unit: str, columns: str, asked: str
):
    own = checks.open_folder(str(folder(tmp_path / "model", ROTARY)))
    names = {"clock": f"time [{unit}]", columns[0]: "position [rad]", columns[1]: "torque [N.m]"}
    r = rig(rows=1600)
    file = table(tmp_path / "a.csv", {"clock": ratio * r["t"], "q": r["q"], "M": r["torque"]})
    core = Core(own, split(read_run(file, own, names), (), ()))
    said = mistaken.evident(core, names)
    assert said.startswith(asked)
    assert bool(said) == bool(asked)


def test_exchanged_columns_that_strange_parameters_make_up_for_are_asked(tmp_path: Path):
    """A level read as the command that makes it: by a gain far from the one stated it fits."""
    text = LAG.replace("- x.y)", "* p.K - x.y)").replace(
        "    parameters=(",
        '    parameters=(Variable("K", "1", "Gain", start=1.7, min=0.1, max=20, tolerance=0.05),',
    )
    own = checks.open_folder(
        str(folder(tmp_path / "model", text.replace("max=10)", "max=10, tolerance=0.1)")))
    )
    time, u = 0.02 * np.arange(1200), np.repeat([0.0, 60.0], [30, 1170])
    level = 1.7 * 60.0 * (1.0 - np.exp(-np.maximum(time - 0.6, 0.0) / 0.6))
    level += 0.3 * np.random.default_rng(4).normal(size=len(time))
    file = table(tmp_path / "a.csv", {"time": time, "y": level, "heat": u})
    core = Core(own, split(read_run(file, own, {"y": "u [1]", "heat": "level [1]"}), (), ()))
    assert mistaken.evident(core).startswith("columns u and level: with one taken for the other")
    right = Core(own, split(read_run(file, own, {"y": "level [1]", "heat": "u [1]"}), (), ()))
    assert not mistaken.evident(right)


def test_a_command_that_is_read_as_the_only_output_is_asked(tmp_path: Path):
    own = checks.open_folder(str(folder(tmp_path / "model", LAG)))
    time = 0.02 * np.arange(400)
    file = table(tmp_path / "a.csv", {"time": time, "y": 1.0 - np.exp(-time), "heat": 0 * time + 50.0})
    parts = split(read_run(file, own, {"y": "u [1]", "heat": "level [1]"}), (), ())
    with pytest.raises(InputError, match="level at one value all the time, u not; are their"):
        Core(own, parts)


def test_of_readings_that_explain_the_one_that_leaves_least_is_asked_whatever_the_parameters(monkeypatch):
    """A clock in minutes, beside a factor of 1000 that leaves 16 % with parameters a little nearer."""
    rows = [(0.16, 0.14, multiplied(1e-3, "y")), (0.005, 0.45, Reading(unit="min"))]
    monkeypatch.setattr(mistaken, "_explained", lambda core, enough, lost: iter(rows))
    monkeypatch.setattr(mistaken, "_by_itself", lambda core: (0.62, 14.6))
    monkeypatch.setattr(mistaken, "beyond_sensors", lambda core, point: 0.7)
    monkeypatch.setattr(mistaken, "turned", lambda core: [])
    said = mistaken.evident(SimpleNamespace(base=None), {"clock": "time"})  # type: ignore[arg-type]
    assert said.startswith("column clock: 60 times as long")


@pytest.mark.parametrize(
    ("unit", "lost", "told"), [("s", True, True), ("s", False, False), ("min", True, False)]
)
def test_of_two_clocks_that_explain_as_much_the_nearest_is_asked_where_all_is_lost(
    monkeypatch, unit: str, lost: bool, told: bool
):
    """What follows its input at once does so in s and in min."""
    core: Any = SimpleNamespace(model=SimpleNamespace(outputs=[]))
    monkeypatch.setattr(mistaken, "_refitted", lambda core, reading: (0.05, 0.05, 0.0))
    assert mistaken._boundless(core, 0.05, Reading(unit=unit, stated="ms"), lost) is not told


def test_a_clock_in_which_nothing_moves_is_no_reading(tmp_path: Path):
    """Within a thousandth of the time a level stands still: a model that leaves little then tells nothing."""
    own = checks.open_folder(str(folder(tmp_path / "model", LAG.replace("max=10)", "max=50)"))))
    time, u = 0.02 * np.arange(1200), np.repeat([0.0, 30.0, 60.0, 45.0, 80.0, 20.0], 200)
    level = np.zeros(len(time))
    for k in range(1, len(time)):
        level[k] = 1.7 * u[k - 1] + (level[k - 1] - 1.7 * u[k - 1]) * np.exp(-0.02 / 0.6)
    level += 2.0 * np.random.default_rng(4).normal(size=len(time))
    file = table(tmp_path / "a.csv", {"time": time, "pwm": level, "rpm": u})
    core = Core(own, split(read_run(file, own, {"pwm": "u [1]", "rpm": "level [1]"}), (), ()))
    assert mistaken._refitted(core, Reading(unit="ms"))[0] == np.inf
    assert mistaken._refitted(core, Reading(exchanged=("u", "level")))[0] < 0.05


@pytest.mark.parametrize(("lost", "range_"), [(True, ""), (True, ", min=0"), (False, "")])
def test_an_input_that_lost_its_sign_is_asked(tmp_path: Path, lost: bool, range_: str):
    """As of a duty that a driver logs beside a direction; of what cannot be negative nothing is asked."""
    text = SPEED.replace('"Torque")', f'"Torque"{range_})')
    own = checks.open_folder(str(folder(tmp_path / "model", text)))
    r = rig(rows=1600)
    u = 0.4 * np.sin(0.8 * r["t"])
    v = np.zeros_like(u)
    for k in range(1, len(v)):
        v[k] = v[k - 1] + 0.02 * (u[k - 1] - 0.2 * v[k - 1]) / 0.05
    columns = {"time": r["t"], "rate [rad/s]": v, "M [N.m]": np.abs(u) if lost else u}
    names = {"rate": "speed [rad/s]", "M": "torque [N.m]"}
    core = Core(own, split(read_run(table(tmp_path / "a.csv", columns), own, names), (), ()))
    said = mistaken.evident(core, names)
    assert said.startswith("column M: with the sign of rate") is (lost and not range_)


def test_what_settles_a_question_about_columns_is_said_in_the_recordings_words():
    core: Any = SimpleNamespace()
    names = {"uhr": "time", "M": "torque [N.m]", "q": "position [rad]"}
    exchanged = Reading(exchanged=("torque", "position"))
    assert "write 'M' = 'position' and 'q' = 'torque' in [names]" in asked(exchanged, core, "", names)
    assert "its times are in ms, write 'uhr' = 'time [ms]' in" in asked(Reading(unit="ms"), core, "", names)


@pytest.mark.parametrize(
    ("turned", "undriven", "said"),
    [(0.3, 0.65, True), (0.4, 0.65, False), (0.3, 0.35, False), (0.6, 2.0, False)],
    ids=["half of the error is left", "more is left", "without any input, too", "as large as the motion"],
)
def test_a_sign_is_asked_for_where_half_of_the_error_is_left(
    monkeypatch, turned: float, undriven: float, said: bool
):
    """Of readings that leave as little, the one whose parameters are nearer to the model's is asked for."""
    core: Any = SimpleNamespace(base=None, name="as they are")
    least = 0.65 if turned < 0.5 else 2.0
    errors = {"as they are": (least, 0.0), "u": (turned, 1.0), "y": (0.99 * turned, 9.0), "": (undriven, 0.0)}
    monkeypatch.setattr(mistaken, "inputs", lambda core: ["u"])
    monkeypatch.setattr(mistaken, "turned", lambda core: [multiplied(-1.0, n) for n in ("y", "u")])
    monkeypatch.setattr(mistaken, "_explained", lambda core, enough, lost: [])
    monkeypatch.setattr(mistaken, "beyond_sensors", lambda core, point: 2.5)
    monkeypatch.setattr(mistaken, "_by_itself", lambda core: errors[core.name])

    def read(core, reading):
        ((name, ratio),) = reading.ratios
        return SimpleNamespace(name=name if ratio else "")

    monkeypatch.setattr(mistaken, "_read", read)
    monkeypatch.setattr(mistaken, "asked", lambda reading, core, gains, names: reading.ratios[0][0])
    assert mistaken.evident(core) == ("u" if said else "")


def test_degrees_fahrenheit_are_a_reading_of_what_is_in_celsius():
    model = SimpleNamespace(kind="continuous", inputs=[], outputs=[SimpleNamespace(name="t", unit="degC")])
    core: Any = SimpleNamespace(
        model=model, folder=SimpleNamespace(ports=SimpleNamespace(controls=[])), runs=[]
    )
    core.outputs = ["t"]
    (found,) = (r for r in relabelled(core) if r.ratios)
    signal = Signal(np.arange(2.0), np.array([32.0, 212.0]))
    run = Run("run", 0.0, 1.0, {}, {"t": signal})
    np.testing.assert_allclose(found.of(run).outputs["t"].values, [0.0, 100.0], atol=1e-9)
    assert "column warm: as degrees Fahrenheit" in asked(found, core, "", {"warm": "t"})


@pytest.mark.parametrize(
    ("kind", "channels", "pairs"), [("continuous", 4, 6), ("continuous", 6, 4), ("discrete", 4, 6)]
)
def test_other_readings_are_few(kind: str, channels: int, pairs: int):
    """Of six channels in two units only those of one unit may be exchanged."""
    units = ["V", "V", "rad", "rad", "rad", "K"][:channels]
    signals = [SimpleNamespace(name=f"c{k}", unit=unit) for k, unit in enumerate(units)]
    model = SimpleNamespace(kind=kind, inputs=signals[:2], outputs=signals[2:])
    moving = Signal(np.arange(9.0), np.arange(9.0))
    runs = [SimpleNamespace(inputs={"c0": moving, "c1": moving}, outputs={}, clock_unit="s")]
    ports = SimpleNamespace(controls=["c0", "c1"])
    core: Any = SimpleNamespace(model=model, folder=SimpleNamespace(ports=ports), runs=runs)
    core.outputs = [s.name for s in signals[2:]]
    found = relabelled(core)
    assert len([r for r in found if r.exchanged]) == pairs
    assert bool([r for r in found if r.clock != 1.0]) == (kind == "continuous")
    assert len([r for r in found if r.added]) == (2 if channels == 6 else 0)


@pytest.mark.parametrize(
    ("duty", "speed", "may"), [(True, False, False), (True, True, True), (False, True, True)]
)
def test_a_held_command_is_not_taken_for_a_reading(duty: bool, speed: bool, may: bool):
    moving, held = (Signal(np.arange(9.0), v) for v in (np.arange(9.0), np.repeat([2.0, 254.0, 2.0], 3)))
    signals = [SimpleNamespace(name=n, unit="1") for n in ("duty", "speed")]
    model = SimpleNamespace(kind="discrete", inputs=signals[:1], outputs=signals[1:])
    run = SimpleNamespace(
        inputs={"duty": held if duty else moving}, outputs={"speed": held if speed else moving}
    )
    core: Any = SimpleNamespace(model=model, runs=[run], outputs=["speed"])
    core.folder = SimpleNamespace(ports=SimpleNamespace(controls=["duty"]))
    assert bool(relabelled(core)) == may


@pytest.mark.parametrize(
    ("unit", "ratio"), [("deg", 57.29578), ("rpm", 9.549297), ("km/h", 3.6), ("V", 1000.0), ("1", 1000.0)]
)
def test_units_that_a_channel_may_be_in_are_of_its_quantity(unit: str, ratio: float):
    assert other_units(unit)[-1] == ratio
    assert (3.6 in other_units(unit)) == (unit == "km/h")
