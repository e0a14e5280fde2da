"""`slewright estimate`: recordings in, figures out, what is refused; the score on simulated machines."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from baselines.load.balance import unknowns
from baselines.load.calibration import uncalibrated
from baselines.load.calibration_file import as_dict, read
from baselines.load.trials import Trial, run
from baselines.load.validate import accepted, validate
from records.formats import write_measurement
from slewright.app import app
from specs.errors import InputError

RUNNER = CliRunner()


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """An empty and a loaded trial of one machine as Parquet files."""
    folder = tmp_path_factory.mktemp("load")
    found = {}
    for name, trial in {
        "empty": Trial("calibration", 0, 0.0, 4),
        "loaded": Trial("score", 0, 900.0, 2),
    }.items():
        found[name] = folder / f"{name}.parquet"
        write_measurement(run(trial), found[name])
    return found


def test_calibrate_then_estimate(recordings: dict[str, Path], tmp_path: Path) -> None:
    machine, figures = tmp_path / "machine.json", tmp_path / "figures.json"
    done = RUNNER.invoke(app, ["estimate", "calibrate", str(recordings["empty"]), "--out", str(machine)])
    assert done.exit_code == 0, done.output
    assert "tool_mass" in done.output
    assert "kg now" in done.output
    arguments = ["--calibration", str(machine), "--json", str(figures)]
    done = RUNNER.invoke(app, ["estimate", "load", str(recordings["loaded"]), *arguments])
    assert done.exit_code == 0, done.output
    found = json.loads(figures.read_text())["recordings"][str(recordings["loaded"])]
    assert abs(found["still"]["load_kg"] - 900.0) < 100.0
    assert found["still"]["low_kg"] < 900.0 < found["still"]["high_kg"]
    assert found["still"]["windows"] + found["moving"]["windows"] == len(found["estimates"])
    assert {"time_s", "load_kg", "low_kg", "high_kg", "motion", "from", "agreement"} == set(
        found["estimates"][0]
    )


def test_calibration_file_keeps_everything(tmp_path: Path) -> None:
    path, before = tmp_path / "c.json", uncalibrated()
    path.write_text(json.dumps(as_dict(before)))
    after = read(path)
    for name in ("values", "covariance", "residual", "freedom"):
        assert (getattr(after, name) == getattr(before, name)).all()


def test_a_covariance_of_very_different_units_is_read(tmp_path: Path) -> None:
    """Correlated variances of rad² beside Pa²: positive, whatever rounding makes of the eigenvalues."""
    n = len(unknowns())
    sd = np.logspace(-6, 6, n)
    covariance = np.outer(sd, sd) * (np.eye(n) + 0.9 * (1 - np.eye(n)))
    path = tmp_path / "c.json"
    path.write_text(json.dumps(as_dict(uncalibrated()) | {"covariance": covariance.tolist()}))
    assert (read(path).covariance == covariance).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"load_calibration": 9}, "not a load calibration"),
        ({"unknowns": {"boom_mass": 1.0}}, "other unknowns"),
        ({"covariance": [[1.0]]}, "covariance is not"),
        ({"covariance": [[0.0] * len(unknowns())] * len(unknowns())}, "must be positive"),
        ({"freedom": {"still": "many", "moving": 3}}, "damaged"),
    ],
)
def test_damaged_calibrations_are_refused(change: dict[str, object], message: str, tmp_path: Path) -> None:
    path = tmp_path / "c.json"
    path.write_text(json.dumps(as_dict(uncalibrated()) | change))
    with pytest.raises(InputError, match=message):
        read(path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["load"], "takes recordings, or --simulate"),
        (["load", "a.parquet", "--simulate"], "not both"),
        (["load", "--simulate", "--calibration", "c.json"], "calibrates each machine itself"),
        (["load", "--simulate", "--draws", "99"], "draw 24 of set validation: valid are 0 to 23"),
        (["load", "--simulate", "--retained", "1", "0"], "--retained 1 0"),
        (["load", "nothere.parquet"], "nothere.parquet"),
        (["load", "nothere.parquet", "--calibration", "c.json"], "c.json: cannot be read"),
        (
            ["calibrate", "a", "b", "--load", "0", "--load", "1", "--load", "2", "--out", "o.json"],
            "3 loads for 2",
        ),
        (["calibrate", "a", "--load", "-5", "--out", "o.json"], "--load -5"),
    ],
)
def test_wrong_calls(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = RUNNER.invoke(app, ["estimate", *arguments])
    assert isinstance(done.exception, InputError)
    assert message in str(done.exception)
    assert not list(tmp_path.iterdir())


def test_score_has_its_figures() -> None:
    figures = validate(["nominal"], loads=(500.0,), poses=1)
    shipped = figures["calibrations"]["empty"]
    assert min(shipped[m]["within_limit"] for m in ("still", "moving")) >= 0.95
    used = sum(shipped[m]["estimates"] for m in ("still", "moving"))
    assert figures["windows"] == used + sum(figures["left_out"].values())
    assert not accepted({"still": shipped["still"]})  # without one motion nothing is accepted
    assert not accepted({"still": shipped["still"], "moving": shipped["moving"] | {"covered": 0.9}})
