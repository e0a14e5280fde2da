"""What recordings can tell is said before anything is searched."""

import numpy as np
import pytest

from reconcile.equations.model import read_folder
from reconcile.recordings.data import runs_of, split
from reconcile.search.core import Core
from reconcile.start.tellable import lines, told
from tests.reconcile import models
from tests.reconcile.conftest import RIG
from tests.reconcile.truth import Truth, record


def figures(size: float) -> dict:
    folder = read_folder(RIG)
    runs = runs_of(record(Truth(), 12.0, 1, size=size), folder, "a")
    return told(Core(folder, split(runs, (), ())), runs)


def test_a_moving_rig_tells_its_parameters_and_frictions():
    found = figures(8.0)
    assert all(p["told"] for p in found["parameters"].values())
    assert found["effects"]["coulomb_friction@v"]["told"] == "well"
    dry, own = (found["effects"][f"{n}@v"]["least"] for n in ("coulomb_friction", "viscous_friction"))
    assert own is None or dry < own  # the model has drag itself
    assert "mass" in " ".join(lines(found))
    assert {"input_dead_zone@force", "structural_compliance@v"} <= set(found["not_foretold"])
    assert any(line.startswith("effects that are looked for, but") for line in lines(found))


def test_less_motion_tells_less():
    effects = figures(8.0)["effects"], figures(0.5)["effects"]
    strong, weak = (e["quadratic_drag@v"]["least"] for e in effects)
    assert np.isfinite(strong)
    assert weak is None or weak > strong


def test_command_says_it(tmp_path, capfd):
    from slewright.__main__ import main
    from tests.reconcile.test_bad_input import COLUMNS, UNITS, csv

    run = csv(tmp_path / "a.csv", COLUMNS, UNITS)
    with pytest.raises(SystemExit) as ended:
        main(["reconcile", str(run), "--model", str(RIG), "--check-only"])
    assert not ended.value.code
    assert "sampling:" in capfd.readouterr().out


def test_what_reading_assumed_is_said(tmp_path):
    from reconcile.start.tellable import examine

    t = 0.02 * np.arange(600)
    rows = zip(t, np.sign(np.sin(t)), np.sin(0.7 * t), np.cos(0.7 * t), strict=True)
    table = tmp_path / "b.csv"
    table.write_text("time,force,position,velocity\n" + "".join(f"{a},{b},{c},{d}\n" for a, b, c, d in rows))
    assert "b: the time states no unit: taken as s" in lines(examine([table], str(RIG)))


def test_that_a_model_has_no_axis_is_said():
    folder = models.cooling(driven=False)
    t = 1.0 * np.arange(100)
    values = 20.0 * np.exp(-t / 30.0) + 0.01 * np.random.default_rng(0).standard_normal(100)
    run = models.run({}, {"temperature": (t, values)})
    assert "declare PORTS in model.py" in lines(told(Core(folder, split([run], (), ())), [run]))[-1]
