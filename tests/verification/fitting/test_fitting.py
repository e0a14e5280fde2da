"""Fits of an FMU: known values come back within their intervals, what is not told is said, bad input."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.python.pack import build_python_fmu
from fmus.toolchain.build import build_fmu
from fmus.toolchain.loader import model_folders
from orchestrator.fmi.instance import LIMIT_S
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from specs.errors import HungError, RunError
from tests.conftest import Command
from verification.fitting.fit import FAILED, Problem, own_shares
from verification.fitting.parameters import Moved, moved
from verification.fitting.recordings import Recording

STEP_S, TICKS = 0.02, 600
TRUE = {"boom_response": 0.31, "stick_response": 0.12}
SHOWN = ("q_boom", "qd_boom", "qd_stick")
NOISE = {"q_boom": 0.002, "qd_boom": 0.004, "qd_stick": 0.004}


@pytest.fixture(scope="module")
def arm() -> Path:
    return build_fmu(model_folders()["arm"], 2)


@pytest.fixture(scope="module")
def recordings(arm: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two runs of an arm with TRUE values, with noise, every second sample left out of one output."""
    system, folder = load_system(arm, STEP_S), tmp_path_factory.mktemp("runs")
    (component,) = system.components
    made = []
    for number in range(2):
        rng = np.random.default_rng(number)
        refs = 0.15 * rng.uniform(-1, 1, (2, TICKS // 40 + 1)).repeat(40, axis=1)[:, :TICKS]
        drive = {k: {"qd_boom_ref": refs[0, k], "qd_stick_ref": refs[1, k]} for k in range(TICKS)}
        record = simulate(system, TICKS, Stimuli(drive), {f"{component}.{n}": v for n, v in TRUE.items()})
        columns = {n: record.column(n) + NOISE[n] * rng.standard_normal(TICKS + 1) for n in SHOWN}
        columns |= {"qd_boom_ref": np.append(refs[0], 0.0), "qd_stick_ref": np.append(refs[1], 0.0)}
        path = folder / f"run{number}.csv"
        table = np.column_stack([record.time, *columns.values()])
        heads = ["time [s]", *(f"{n} [rad/s]" if n.startswith("qd") else f"{n} [rad]" for n in columns)]
        np.savetxt(path, table, delimiter=",", header=",".join(heads), comments="")
        made.append(path)
    return made


def test_known_values_come_back_within_their_intervals(
    slewright_here: Command, arm: Path, recordings: list[Path], tmp_path: Path
) -> None:
    file = tmp_path / "fit.json"
    done = slewright_here(
        *("fit", "fmu", arm, recordings[0], "--holdout", recordings[1], "--json", file, "--starts", "2"),
        *("--step", STEP_S, "--parameter", "boom_response=0.02:1", "--parameter", "stick_response"),
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(file.read_text())
    for name, true in TRUE.items():
        row = next(r for n, r in found["parameters"].items() if n.endswith(name))
        assert row["value"] == pytest.approx(true, rel=0.05)
        half = (row["interval"][1] - row["interval"][0]) / 2
        assert abs(row["value"] - true) < 1.6 * half  # three deviations
        assert half < 0.05 * true
        assert row["told"]
    for name, size in NOISE.items():
        assert found["holdout"][name]["after"] == pytest.approx(size, rel=0.1)
        assert found["holdout"][name]["before"] >= found["holdout"][name]["after"]
    assert found["starts_to_the_same"] == 2


def test_what_recordings_do_not_tell_is_said(
    slewright_here: Command, arm: Path, recordings: list[Path], tmp_path: Path
) -> None:
    file = tmp_path / "fit.json"
    done = slewright_here(
        *("fit", "fmu", arm, recordings[0], "--json", file, "--starts", "1", "--step", STEP_S),
        *("--parameter", "boom_response", "--parameter", "cabin_mass"),
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(file.read_text())["parameters"]
    assert [row["told"] for row in found.values()] == [True, False]
    assert "the recordings do not tell it" in " ".join(done.stdout.split())


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (("boom_respons",), "boom_response"),
        (("boom_response=1:0.1",), "LOW must be below HIGH"),
        (("boom_response=fast",), "two numbers"),
        (("boom_response=0.7:0.9",), "not in 0.7 .. 0.9"),
        (("boom_response", "boom_response"), "given twice"),
    ],
)
def test_wrong_parameters_are_named(
    slewright_here: Command, arm: Path, recordings: list[Path], texts: tuple[str, ...], said: str
) -> None:
    words = [w for text in texts for w in ("--parameter", text)]
    done = slewright_here("fit", "fmu", arm, recordings[0], *words)
    assert done.returncode == 2
    assert said in done.stderr


def test_recordings_that_are_none_of_the_system_are_refused(
    slewright_here: Command, arm: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other.csv"
    other.write_text("time,temperature\n" + "".join(f"{0.1 * k},{k % 3}\n" for k in range(50)))
    done = slewright_here("fit", "fmu", arm, other, "--parameter", "boom_response")
    assert done.returncode == 2
    assert "no output of arm in it (has temperature" in done.stderr


@pytest.mark.parametrize("bounds", [(0.1, 10.0), (-2.0, 3.0), (1.0, 2.0)])
def test_values_and_shares_go_both_ways(bounds):
    one = Moved("p", bounds[0], *bounds)
    for share in (0.0, 0.3, 1.0):
        assert one.share(one.value(share)) == pytest.approx(share)
    step = 1e-6
    slope = (one.value(0.4 + step) - one.value(0.4 - step)) / (2 * step)
    assert one.slope(one.value(0.4)) == pytest.approx(slope, rel=1e-6)


def test_a_parameter_without_bounds_gets_a_factor_of_ten_within_those_of_the_fmu(arm: Path) -> None:
    system = load_system(arm, STEP_S)
    (found,) = moved(system, ["boom_mass"])
    assert found.low >= found.start / 10.0
    assert found.high <= found.start * 10.0
    (component,) = system.components
    variable = system.components[component].model.variables["boom_mass"]
    assert variable.min is None or found.low >= variable.min
    assert replace(found, low=-1.0).log is False


@pytest.mark.parametrize("content", ["names = 3", "[names]\na = 3", "[namez]\na = 'b'", ""])
def test_a_map_that_is_none_is_refused(
    slewright_here: Command, arm: Path, recordings: list[Path], tmp_path: Path, content: str
) -> None:
    names = tmp_path / "names.toml"
    names.write_text(content)
    done = slewright_here("fit", "fmu", arm, recordings[0], "--map", names, "--parameter", "boom_response")
    assert done.returncode == 2
    assert "write it as [names]" in done.stderr


def test_a_recording_is_not_taken_twice(slewright_here: Command, arm: Path, recordings: list[Path]) -> None:
    run = recordings[0]
    done = slewright_here("fit", "fmu", arm, run, "--holdout", run, "--parameter", "boom_response")
    assert done.returncode == 2
    assert "run0.csv is given twice" in done.stderr


@pytest.mark.parametrize(("ours", "said"), [("q_bom", "did you mean q_boom"), ("-q_bom [deg]", "q_boom")])
def test_a_map_to_a_name_that_the_system_lacks_is_refused(
    slewright_here: Command, arm: Path, recordings: list[Path], tmp_path: Path, ours: str, said: str
) -> None:
    names = tmp_path / "names.toml"
    names.write_text(f"[names]\nq_boom = '{ours}'\n")
    done = slewright_here("fit", "fmu", arm, recordings[0], "--map", names, "--parameter", "boom_response")
    assert done.returncode == 2
    assert f"'q_boom' = '{ours}': arm has no such input or output" in done.stderr
    assert said in done.stderr


class _Hanging(Recording):
    def simulated(self, system, parameters, limit_s=LIMIT_S):  # type: ignore[override]
        raise HungError(f"no answer from doStep within {limit_s:g} s")


def test_runs_that_hang_are_said_and_the_third_ends_the_fit(arm: Path) -> None:
    system, told = load_system(arm, STEP_S), []
    time = np.arange(20) * STEP_S
    run = _Hanging("monday.csv", 19, Stimuli(), {"q_boom": (time, time)})
    problem = Problem(system, moved(system, ["boom_response"]), [run], 5.0, told.append)
    shares = own_shares(problem)
    for _ in range(2):
        assert set(problem.residuals(shares)) == {FAILED}
    assert len(told) == 2
    assert "monday.csv cannot be simulated with arm.boom_response = " in told[0]
    assert "no answer from doStep within 5 s" in told[0]
    with pytest.raises(RunError, match=r"3 runs hung; the last: monday.csv .* doStep within 5 s"):
        problem.residuals(shares)


LAG = """
class Lag:
    inputs = {"u": 0.0}
    outputs = {"y": 0.0}
    parameters = {"a": 1.0, "b": 1.0, "idle": 1.0, "T": 1.0}
    step_s = 0.1

    def step(self, time, h):
        self.y += h * (self.a * self.b * self.u - self.y) / self.T
"""


@pytest.fixture(scope="module")
def lag(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """An FMU, and a recording without any noise of what it gives with a = 2.5 and T = 0.7."""
    folder = tmp_path_factory.mktemp("lag")
    (folder / "lag.py").write_text(LAG)
    (folder / "lag.fmu").write_bytes(build_python_fmu(folder / "lag.py"))
    time = np.arange(81) * 0.1
    u, y = (time > 1.0) + 0.3 * np.sin(time), np.zeros(81)
    for k in range(80):
        y[k + 1] = y[k] + 0.1 * (2.5 * u[k] - y[k]) / 0.7
    table = np.column_stack([time, u, y])
    np.savetxt(folder / "lag.csv", table, delimiter=",", header="time [s],u,y", comments="")
    return folder / "lag.fmu", folder / "lag.csv"


def fit_of_lag(slewright: Command, lag: tuple[Path, Path], file: Path, *names: str) -> dict:
    options = [text for name in names for text in ("--parameter", name)]
    done = slewright("fit", "fmu", *lag, *options, "--json", file)
    assert done.returncode == 0, done.stderr
    return json.loads(file.read_text())


@pytest.mark.long
def test_what_nothing_tells_stays_where_it_is(
    slewright_here: Command, lag: tuple[Path, Path], tmp_path: Path
) -> None:
    found = fit_of_lag(slewright_here, lag, tmp_path / "f.json", "a", "idle", "T")
    values = {n: p["value"] for n, p in found["parameters"].items()}
    assert values == pytest.approx({"Lag.a": 2.5, "Lag.idle": 1.0, "Lag.T": 0.7}, rel=1e-4)
    assert not found["parameters"]["Lag.idle"]["told"]
    assert found["starts_to_the_same"] == 3  # wherever `idle` ended


@pytest.mark.long
def test_of_a_product_neither_factor_is_told_without_noise_too(
    slewright_here: Command, lag: tuple[Path, Path], tmp_path: Path
) -> None:
    found = fit_of_lag(slewright_here, lag, tmp_path / "f.json", "a", "b", "T")
    told = {n: p["told"] for n, p in found["parameters"].items()}
    assert told == {"Lag.a": False, "Lag.b": False, "Lag.T": True}
    assert found["alike"][0]["parameters"] == ["Lag.b", "Lag.a"]
