"""What a user can get wrong is said in at most two lines that name it, and nothing is written."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reconcile.equations.model import read_folder
from reconcile.judging import unidentifiable
from reconcile.judging.answer import Answer
from reconcile.judging.judge import Judge
from reconcile.recordings.data import read_run, runs_of, split
from reconcile.reporting.target import check as check_target, staged
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.workflow import examine, reconcile, told
from records.measurement import Channel, Measurement
from slewright.__main__ import run as command
from specs.errors import InputError
from tests.reconcile.conftest import RIG
from tests.reconcile.start.test_init import table
from tests.reconcile.truth import Truth, record

SECONDS = 12.0
TABLE = record(Truth(), seconds=SECONDS, seed=1)
COLUMNS = {n: c.values for n, c in TABLE.channels.items()}
UNITS = {n: c.unit for n, c in TABLE.channels.items()}
TIME = TABLE["force"].time


def csv(path: Path, columns: dict[str, np.ndarray], units: dict[str, str], time: np.ndarray = TIME) -> Path:
    """A table; NaN is an empty cell."""
    heads = ["time"] + [f"{n} [{units[n]}]" if units.get(n) else n for n in columns]
    rows = np.column_stack([time, *columns.values()])
    lines = [",".join("" if np.isnan(v) else f"{v:.9g}" for v in row) for row in rows]
    path.write_text("\n".join([",".join(heads), *lines, ""]), encoding="utf-8")
    return path


def measurement(
    scaled: dict[str, float] | None = None, units: dict[str, str] | None = None, **times: np.ndarray
) -> Measurement:
    """The table with columns multiplied, in other units, at other times (and as many samples)."""
    found = {}
    for n, v in COLUMNS.items():
        time = times.get(n, TIME)
        values = np.interp(time, TIME, v) if n in times else v
        found[n] = Channel(
            n, (UNITS if units is None else units).get(n, ""), time, (scaled or {}).get(n, 1.0) * values
        )
    return Measurement(found, source="rec.csv")


def model(folder: Path, old: str = "", new: str = "") -> Path:
    """A copy of the rig's model file with a text replaced."""
    text = (RIG / "model.py").read_text(encoding="utf-8")
    assert old in text
    folder.mkdir()
    (folder / "model.py").write_text(text.replace(old, new), encoding="utf-8")
    return folder


class Given:
    """A correct call in a folder of its own, of which a case makes one thing wrong."""

    def __init__(self, folder: Path):
        self.folder, self.out = folder, folder / "report"
        self.runs = [csv(folder / "a.csv", COLUMNS, UNITS)]
        self.model: Path | str = RIG
        self.confirm: list[Path] = []
        self.holdout: list[Path] = []
        self.names: Path | None = None

    def names_are(self, text: str) -> None:
        self.names = self.folder / "map.toml"
        self.names.write_text(text, encoding="utf-8")

    def columns_are(self, units: dict[str, str] = UNITS, time: np.ndarray = TIME, **columns: Any) -> None:
        """Write the recording again with other columns (None: left out)."""
        kept = {n: v for n, v in (COLUMNS | columns).items() if v is not None}
        self.runs = [csv(self.folder / "a.csv", kept, units, time)]  # type: ignore[arg-type]

    def copied(self, name: str) -> Path:
        path = self.folder / name
        path.write_bytes(self.runs[0].read_bytes())
        return path

    def model_with(self, old: str, new: str) -> None:
        self.model = model(self.folder / "mine", old, new)

    def arguments(self) -> list[str]:
        found = ["reconcile", *map(str, self.runs), "--model", str(self.model), "--out", str(self.out)]
        for option, paths in (("--confirm", self.confirm), ("--holdout", self.holdout)):
            found += [x for p in paths for x in (option, str(p))]
        return [*found, "--map", str(self.names)] if self.names else found


def _made(path: Path, text: str | None = None) -> Path:
    if text is None:
        path.mkdir()
    else:
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return path


def _gap(g: Given) -> None:
    """A short recording with a gap in its middle."""
    values = {n: v[:40].copy() for n, v in COLUMNS.items()}
    values["position"][16:24] = np.nan
    g.runs = [csv(g.folder / "a.csv", values, UNITS, TIME[:40])]


def _rows(count: int) -> Callable[[Given], None]:
    """A recording of so many rows, whose units are not stated."""

    def change(g: Given) -> None:
        first = {n: v[:count] for n, v in COLUMNS.items()}
        g.runs = [csv(g.folder / "a.csv", first, {}, TIME[:count])]

    return change


def _late_input(g: Given) -> None:
    n = np.full(len(TIME), np.nan)
    columns = {
        "force": np.concatenate([COLUMNS["force"], n]),
        **{k: np.concatenate([n, COLUMNS[k]]) for k in ("position", "velocity")},
    }
    g.runs = [csv(g.folder / "a.csv", columns, UNITS, np.concatenate([TIME, TIME + 1000.0]))]


def _swapped(g: Given) -> None:
    time = TIME.copy()
    time[200:] -= 1.0
    g.columns_are(time=time)


def _set(**values: object) -> Callable[[Given], None]:
    def change(g: Given) -> None:
        for name, value in values.items():
            setattr(g, name, value(g) if callable(value) else value)

    return change


RATES = '{"x": x.v, "v": (u.force - p.drag * x.v) / p.mass}'
PULLS = """)

PORTS = {"load": {"kind": "hung", "axis": "v", "pull": lambda x, u, m, p: x.sway}}
"""
EXPLODES = ("(u.force - p.drag * x.v) / p.mass", "900.0 * x.v + u.force")
CASES: dict[str, tuple[Callable[[Given], object], list[str]]] = {
    # recordings
    "no such recording": (_set(runs=lambda g: [g.folder / "b.csv"]), ["no recording at", "b.csv"]),
    "unknown format": (_set(runs=lambda g: [_made(g.folder / "a.xyz", "x")]), ["a.xyz", ".xyz", "valid"]),
    "empty": (_set(runs=lambda g: [_made(g.folder / "b.csv", "")]), ["b.csv", "is empty"]),
    "given twice": (_set(runs=lambda g: [g.runs[0], g.runs[0]]), ["a.csv", "is given twice"]),
    "to fit and held out": (_set(holdout=lambda g: g.runs), ["a.csv", "to fit and for --holdout"]),
    "a copy": (_set(confirm=lambda g: [g.copied("b.csv")]), ["b.csv", "the same as", "a.csv"]),
    "gaps": (lambda g: _gap(g), ["a.csv", "without a gap", "samples, and 22 are needed"]),
    "too short": (
        lambda g: setattr(
            g, "runs", [csv(g.folder / "a.csv", {n: v[:23] for n, v in COLUMNS.items()}, UNITS, TIME[:23])]
        ),
        ["samples are left for", "record longer"],
    ),
    **{f"{n} rows without units": (_rows(n), [f"has {n} samples, and 22 are needed"]) for n in (2, 3, 4, 5)},
    "all NaN": (lambda g: g.columns_are(force=np.full(len(TIME), np.nan)), ["none of the model's inputs"]),
    "no outputs": (lambda g: g.columns_are(position=None, velocity=None), ["none of the model's outputs"]),
    "no inputs": (lambda g: g.columns_are(force=None), ["none of the model's inputs (force)", "--map"]),
    "a unit of something else": (
        lambda g: g.columns_are(UNITS | {"position": "bar"}),
        ["position", "'bar' does not measure what m does"],
    ),
    "an unknown unit": (
        lambda g: g.columns_are(UNITS | {"force": "furlong"}),
        ["force", "it has force [furlong]", "--map"],
    ),
    "mm without unit": (
        lambda g: g.columns_are(UNITS | {"position": ""}, position=1e3 * COLUMNS["position"]),
        ["column position states no unit", "Is it in mm?", "'position [mm]'"],
    ),
    "time in ms": (
        lambda g: g.columns_are(time=1e3 * TIME),
        ["times the slope of column position", "--map", "'time' = 'time [ms]' if it is the times"],
    ),
    "time not increasing": (_swapped, ["clock jumps back by", "line 202"]),
    "clocks apart": (_late_input, ["force ends at 11.98 s, position begins at 1000 s", "clocks"]),
    # names
    "map: unknown name of ours": (
        lambda g: g.names_are("[names]\nforce = 'forze'"),
        ["map.toml", "'forze'", "did you mean force"],
    ),
    "map: unknown name of theirs": (
        lambda g: g.names_are("[names]\nForce = 'force'"),
        ["a.csv has no channel 'Force'", "did you mean force"],
    ),
    "map: not a table": (lambda g: g.names_are("force = 'force'"), ["map.toml", "[names]"]),
    "map: not TOML": (lambda g: g.names_are("[names"), ["map.toml", "not valid TOML"]),
    "map: a number": (lambda g: g.names_are("[names]\nforce = 3"), ["map.toml", "'force' = 3 is no name"]),
    # model
    "no such model": (_set(model="slow"), ["no model 'slow'", "did you mean slew"]),
    "model is a file": (_set(model=lambda g: g.runs[0]), ["a.csv'", "not a folder with a model.py"]),
    "a step that the sample time does not hold": (
        lambda g: g.model_with("step=0.005", "step=0.015, sample_time=0.02"),
        [
            "model.py: sample_time of 0.02 s is not a multiple of the step 0.015 s",
            "state a sample_time that is",
        ],
    ),
    "model without MODEL": (lambda g: g.model_with("MODEL = Model", "OTHER = Model"), ["defines no MODEL"]),
    "import raises": (
        lambda g: g.model_with("from fmus", "1 / 0\nfrom fmus"),
        ["mine/model.py, line 6 cannot be imported: ZeroDivisionError"],
    ),
    "import exits": (lambda g: g.model_with("MODEL =", "raise SystemExit\nMODEL ="), ["sys.exit"]),
    "f raises": (
        lambda g: g.model_with('return {"x": x.v', 'raise ValueError("no rates")\n    return {"x": x.v'),
        ["mine/model.py", "ValueError", "no rates"],
    ),
    "f branches on a state": (
        lambda g: g.model_with('return {"x": x.v', 'v = 1 if x.v > 0 else 2\n    return {"x": x.v'),
        ["mine/model.py", "truth value"],
    ),
    "h raises": (
        lambda g: g.model_with('return {"position": x.x', 'return {"position": x.missing'),
        ["mine/model.py, line 14: out: no 'missing' in states (x, v)"],
    ),
    "h forgets an output": (
        lambda g: g.model_with('"position": x.x, "velocity"', '"velocity"'),
        [
            "mine/model.py, line 13",
            "out returns the wrong names: position is missing",
            "valid: position, vel",
        ],
    ),
    "a parameter that is not there": (
        lambda g: g.model_with("p.drag * x.v", "p.drga * x.v"),
        ["mine/model.py, line 10: rhs: no 'drga' in parameters (mass, drag)"],
    ),
    "a parameter among the inputs": (
        lambda g: g.model_with("p.drag * x.v", "u.drag * x.v"),
        ["mine/model.py, line 10: rhs: no 'drag' in inputs (force); write p.drag"],
    ),
    "a bare name": (
        lambda g: g.model_with("p.drag * x.v", "drag * x.v"),
        ["mine/model.py, line 10: rhs: name 'drag' is not defined; write p.drag"],
    ),
    "a rate too few": (
        lambda g: g.model_with(RATES, '{"x": x.v}'),
        ["mine/model.py, line 9", "rhs returns the wrong names: v is missing; valid: x, v"],
    ),
    "a rate too many": (
        lambda g: g.model_with(RATES, '{"x": x.v, "v": x.v, "w": x.v}'),
        ["mine/model.py, line 9", "w is none of them; valid: x, v"],
    ),
    "rates without names": (
        lambda g: g.model_with(RATES, "[x.v, x.v]"),
        ["mine/model.py, line 9", "rhs returns a list, not {name: expression} of x, v"],
    ),
    "a rate that is nothing": (
        lambda g: g.model_with(RATES, '{"x": x.v, "v": None}'),
        ["mine/model.py, line 9", "rhs: v is a NoneType, not a number or expression"],
    ),
    "a rate of two values": (
        lambda g: g.model_with(RATES, '{"x": x.v, "v": __import__("casadi").vertcat(x.v, x.x)}'),
        ["mine/model.py, line 9", "rhs: v has 2 values, not one"],
    ),
    "rates of other arguments": (
        lambda g: g.model_with("_rates(x, u, m, p)", "_rates(x, u, p)"),
        ["mine/model.py, line 9: rhs: TypeError", "takes 3 positional arguments"],
    ),
    "a port's function raises": (
        lambda g: g.model_with("out=_outputs,\n)", "out=_outputs,\n" + PULLS),
        ["mine/model.py, line 33: PORTS['load']: no 'sway' in states (x, v)"],
    ),
    "ports without names": (
        lambda g: g.model_with("MODEL =", 'PORTS = ["v"]\nMODEL ='),
        ["mine/model.py: PORTS is a list, not {name: {key: value}}"],
    ),
    "not a number": (
        lambda g: g.model_with("(u.force - p.drag * x.v)", "(u.force / x.v)"),
        ["rate of v is not a number at the start"],
    ),
    "a start out of range": (
        lambda g: g.model_with("start=2.0, min=0.1", "start=20.0, min=0.1"),
        ["mine/model.py: parameter mass starts at 20, not in 0.1 .. 10"],
    ),
    "an unstable model": (lambda g: g.model_with(*EXPLODES), ["rig", "runs away", "stable"]),
    "an unstable model, units not stated": (
        lambda g: (g.model_with(*EXPLODES), g.columns_are({})),
        ["rig", "runs away", "stable"],
    ),
    # DIR
    "DIR is a file": (_set(out=lambda g: g.runs[0]), ["a.csv is a file; name a folder"]),
    "DIR in a file": (_set(out=lambda g: g.runs[0] / "x" / "y"), ["a.csv is a file, not a folder"]),
    "DIR not writable": (_set(out=Path("/proc/report")), ["/proc/report cannot be written"]),
    "DIR holds something else": (
        lambda g: _made(g.out / "thesis.txt", "mine"),
        ["holds thesis.txt, which is not from reconcile"],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_wrong_input_is_said_and_nothing_is_written(case, tmp_path, capfd):
    given = Given(tmp_path)
    change, said = CASES[case]
    change(given)
    before = sorted(p for p in tmp_path.rglob("*") if "__pycache__" not in p.parts)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # they would stand above the message
        assert command(given.arguments()) == 2
    message = capfd.readouterr().err
    lines = [line for line in message.splitlines() if not line.startswith("reconcile: ")]
    assert 1 <= len(lines) <= 2, message
    for text in said:
        assert text in "\n".join(lines)
    assert before == sorted(p for p in tmp_path.rglob("*") if "__pycache__" not in p.parts)


@pytest.mark.parametrize(
    ("scaled", "hint"),
    [
        ({"position": 1e3}, "position [mm]"),
        ({"position": 57.3}, "its slope is 57.3 times velocity"),
        ({"position": 1e3, "velocity": 1e3}, "the outputs are 1000 times"),
        ({"force": 1e-3}, "force [kN]"),
        ({"velocity": 3.6}, "velocity [km/h]"),
    ],
)
def test_a_column_without_unit_that_is_off_by_a_factor_is_pointed_out(rig, scaled, hint):
    with pytest.raises(InputError, match="states no unit") as error:
        runs_of(measurement(scaled, units={}), rig, "rec")
    assert hint in str(error.value)


def test_a_time_in_thousandths_that_states_no_unit_is_asked(rig, tmp_path):
    move = np.sin(0.05 * np.arange(200.0))
    columns = {"position [m]": move, "velocity [m/s]": np.gradient(move, 0.005), "force [N]": move}
    file = table(tmp_path / "a.csv", {"time": 5.0 * np.arange(200.0), **columns})
    with pytest.raises(InputError, match=r"1000 steps of the model .*'time \[ms\]'"):
        read_run(file, rig)
    (run,) = read_run(file, rig, {"time": "time [ms]"})
    assert run.period_s == pytest.approx(0.005)
    (run,) = read_run(file, rig, {"time": "time [s]"})
    assert run.period_s == pytest.approx(5.0)


def test_a_column_without_unit_of_the_right_size_is_taken_and_so_is_a_stated_one(rig):
    assert runs_of(measurement(units={}), rig, "rec")
    for scale in (1 / 3.0, 1.2, 3.0):  # an encoder's scale that is off
        assert runs_of(measurement({"position": scale}, units={}), rig, "rec")
    given = measurement({"position": 1e3}, units=UNITS | {"position": "mm"})
    [run] = runs_of(given, rig, "rec")
    assert np.allclose(run.outputs["position"].values, COLUMNS["position"])
    assert runs_of(measurement({"position": 1e3}), rig, "rec")  # it says m: taken at its word


def _still(levels: tuple[float, float], force: np.ndarray | float) -> Measurement:
    """A table without units of a carriage that stands: of these noise levels, whatever the command."""
    rng = np.random.default_rng(0)
    noise = zip(("position", "velocity"), levels, strict=True)
    values = {n: level * rng.standard_normal(len(TIME)) for n, level in noise}
    values["force"] = force + np.zeros(len(TIME))
    return Measurement({n: Channel(n, "", TIME, v) for n, v in values.items()}, source="rec.csv")


@pytest.mark.parametrize(
    ("noise", "force"),
    [
        ((2.6e-3, 1e-3), 0.0),  # noise of the position is 57 times what the speed's noise adds up to
        ((1.4e-4, 2.1e-4), COLUMNS["force"]),  # stuck: the model answers 1000 times its noise
        ((8e-3, 1.4e-2), 1e-3 * np.random.default_rng(1).standard_normal(len(TIME))),  # shaken, not driven
    ],
)
def test_a_steady_recording_says_nothing_of_units(rig, noise, force):
    assert runs_of(_still(noise, force), rig, "rec")


def test_channels_keep_their_own_rates(rig):
    slow, fast = TIME[::3], np.arange(0.0, SECONDS - 0.02, 0.004)
    [run] = runs_of(measurement(position=slow, velocity=fast), rig, "rec")
    assert run.outputs["position"].period_s == pytest.approx(0.06)
    assert run.outputs["velocity"].period_s == pytest.approx(0.004)
    assert run.inputs["force"].period_s == pytest.approx(0.02)
    assert run.period_s == pytest.approx(0.004)
    parts = split([run], [], [])
    assert all((parts.fit, parts.confirm, parts.holdout))


def test_a_gap_makes_two_runs_of_a_recording(rig):
    keep = np.r_[0:250, 300 : len(TIME)]
    channels = {n: Channel(n, c.unit, c.time[keep], c.values[keep]) for n, c in TABLE.channels.items()}
    found = runs_of(Measurement(channels), rig, "rec")
    assert [r.name for r in found] == ["rec", "rec.1"]
    assert found[0].end_s < 5.1 < 6.0 - 1e-9 <= found[1].start_s


def test_a_held_out_recording_without_one_to_confirm_leaves_blocks_to_confirm(rig):
    run = runs_of(TABLE, rig, "a")
    other = runs_of(record(Truth(), seconds=SECONDS, seed=2), rig, "b")
    parts = split(run, [], other)
    assert {b.run.name for b in parts.fit} == {b.run.name for b in parts.confirm} == {"a"}
    assert [(b.run.name, b.start_s, b.end_s) for b in parts.holdout] == [
        ("b", other[0].start_s, other[0].end_s)
    ]
    for fit in parts.fit:  # and none of it is fitted
        assert all(c.end_s <= fit.start_s or c.start_s >= fit.end_s for c in parts.confirm)


def test_missing_channels_are_named_with_the_effects_they_hide(rig):
    channels = {n: c for n, c in TABLE.channels.items() if n != "velocity"}
    found = {
        r["effect"]: r["because"]
        for r in unidentifiable.effects(rig, runs_of(Measurement(channels), rig, "a"))
    }
    assert found["sensor_scale"] == "output velocity is not recorded"
    assert "coulomb_friction" not in found
    whole = {r["effect"]: r["because"] for r in unidentifiable.effects(rig, runs_of(TABLE, rig, "a"))}
    assert "sensor_scale" not in whole
    assert "no second signal" in whole["cross_axis_misalignment"]
    assert "turns by an angle" in whole["gravity_load"]


def _constant(**values: float) -> Measurement:
    """The table with channels that keep one value."""
    steady = {n: replace(TABLE[n], values=np.full(len(TIME), v)) for n, v in values.items()}
    return Measurement(dict(TABLE.channels) | steady, source="rec.csv")


@pytest.mark.parametrize("value", [0.0, 3.0])
def test_what_only_an_input_that_moves_would_tell_is_left_out_and_said(rig, value):
    runs = runs_of(_constant(force=value), rig, "a")
    core = Core(rig, split(runs, (), ()))
    keys = {a.key for a in core.candidates}
    assert not [a.key for a in core.candidates if a.effect.place == "input" or a.effect.shaft]
    assert not keys & {f"{n}@all outputs" for n in ("sensor_delay", "clock_drift")}
    assert keys >= {"coulomb_friction@v", "stiffness@v", "sensor_delay@position", "sensor_scale@velocity"}
    assert "sensor_lag.together@all outputs" in keys  # it shows as an exponential
    said = {r["effect"]: r["because"] for r in unidentifiable.effects(rig, runs)}
    told_by = ("input_dead_zone", "input_delay", "clock_drift", "structural_compliance")
    assert {said[n] for n in told_by} == {"input force does not change"}
    assert "coulomb_friction" not in said


def test_an_input_that_changes_from_run_to_run_is_not_constant(rig):
    runs = [r for v in (1.0, 2.0) for r in runs_of(_constant(force=v), rig, f"at {v}")]
    assert "input_dead_zone@force" in {a.key for a in Core(rig, split(runs, (), ())).candidates}


@pytest.mark.slow
@pytest.mark.long
def test_a_model_that_runs_away_without_an_effect_is_told_which(tmp_path):
    folder = read_folder(model(tmp_path / "mine", EXPLODES[0], "9.0 * x.v + u.force"))
    figures = examine(folder, runs_of(TABLE, folder, "a"))[0]
    assert figures["verdict"] == "named"
    found = {e["name"]: e["parameters"] for e in figures["effects"]}
    assert found["viscous_friction"]["b"]["value"] == pytest.approx(
        10.5, rel=0.1
    )  # for a mass that is as free


def test_an_earlier_report_is_replaced_unless_something_was_put_beside_it(tmp_path):
    out = tmp_path / "report"
    for text in ("old", "new"):
        check_target(out, [])
        with staged(out) as part:
            (part / "model").mkdir()
            (part / "model" / text).write_text(text, encoding="utf-8")
            (part / "report.json").write_text(
                '{"verdict": "named", "gap": {}, "files": ["model"]}', encoding="utf-8"
            )
    assert [p.name for p in (out / "model").iterdir()] == ["new"]
    with pytest.raises(InputError, match="would be replaced"):
        check_target(out, [out / "model"])
    (out / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=r"holds notes\.txt"):
        check_target(out, [])
    assert [p.name for p in tmp_path.iterdir()] == ["report"]


def test_a_failure_while_writing_leaves_what_was_there(tmp_path):
    out = tmp_path / "report"
    out.mkdir()

    def fails() -> None:
        with staged(out) as part:
            (part / "half").write_text("x", encoding="utf-8")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fails()
    assert list(tmp_path.iterdir()) == [out]
    assert not any(out.iterdir())


@pytest.mark.slow
@pytest.mark.long
def test_what_cannot_be_seen_is_said_with_what_to_drive(tmp_path):
    rng = np.random.default_rng(1)
    still = {n: 1e-4 * rng.standard_normal(len(v)) for n, v in COLUMNS.items()}
    run = csv(tmp_path / "a.csv", still | {"force": 0.0 * TIME}, UNITS)
    pages = []
    said = lambda *_: pages.extend(tmp_path.glob("*-first.html"))  # noqa: E731
    figures = reconcile([run], str(RIG), tmp_path / "out", report=said)
    assert {p.name for p in pages} == {"out-first.html"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", "out"]
    assert figures["verdict"] == "insufficient_excitation"
    assert {r["parameter"]: r["drive"] for r in figures["unseen"]}["mass"] == ["force"]
    assert "drive force" in figures["sentence"]


@pytest.mark.parametrize("value", [1.0, 0.7])  # 1: not taken for a switch
def test_an_output_that_never_changes_is_left_out_and_said_to_be(rig, value):
    stuck = dict(TABLE.channels) | {"position": replace(TABLE["position"], values=np.full(len(TIME), value))}
    core = Core(rig, split(runs_of(Measurement(stuck), rig, "a"), (), ()), ())
    assert core.still == {"position"}
    assert list(core.floors) == ["velocity"]
    beam = Beam(core)
    beam.run()
    answer = Answer(core, beam, Judge(beam).decide())
    noted = told(answer, {"verdict": "agrees", "nuisances": {}})["nuisances"]["a"]["mended"]
    assert any("position does not change: it is left out" in n for n in noted)


def test_a_logger_that_writes_in_bursts_is_read_in_one_run(rig, tmp_path: Path):
    """Nine samples of the position, then a pause of six, again and again."""
    position = np.where(np.arange(len(TIME)) % 15 > 8, np.nan, COLUMNS["position"])
    (run,) = read_run(csv(tmp_path / "a.csv", COLUMNS | {"position": position}, UNITS), rig)
    assert len(run.outputs["position"].time) == np.isfinite(position).sum()
