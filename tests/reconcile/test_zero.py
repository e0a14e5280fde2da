"""A sensor whose zero is far off: it is named, and the model is not bent to follow it."""

from pathlib import Path

import numpy as np
import pytest

from reconcile.recordings import checks
from reconcile.recordings.data import read_run
from reconcile.workflow import examine
from tests.reconcile.start.test_init import table

SWINGING = """
from casadi import sin

from fmus.definition import Model, Variable

MODEL = Model(
    name="fork", description="It swings; a gyroscope shows its rate", kind="continuous", step=0.02,
    states=(Variable("q", "rad", "Angle", start=0.2), Variable("v", "rad/s", "Rate")), inputs=(),
    outputs=(Variable("gyro", "rad/s", "Rate"),),
    parameters=(
        Variable("pull", "1/s2", "g / l", start=16, min=1, max=100, tolerance=0.5),
        Variable("damping", "1/s", "Damping by inertia", start=0.05, min=0, max=10, tolerance=2),
    ),
    rhs=lambda x, u, m, p: {"q": x.v, "v": -p.pull * sin(x.q) - p.damping * x.v},
    out=lambda x, u, m, p: {"gyro": x.v},
)
"""


def gyro(zero: float) -> dict[str, np.ndarray]:
    """30 s at 50 Hz, simulated; its pull is 13 % less than the model's."""
    step, fine, q, v, rates = 0.02, 20, 0.3, 0.0, []
    for _ in range(1500):
        rates.append(v)
        for _ in range(fine):
            v += step / fine * (-14.0 * np.sin(q) - 0.06 * v)
            q += step / fine * v
    noise = 0.004 * np.random.default_rng(2).normal(size=len(rates))
    return {"time [s]": step * np.arange(len(rates)), "gyro [rad/s]": np.array(rates) + zero + noise}


@pytest.mark.long
@pytest.mark.parametrize("zero", [-1.3, 0.0])
def test_a_zero_that_is_far_off_is_named_and_none_where_there_is_none(tmp_path: Path, zero: float):
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "model.py").write_text(SWINGING, encoding="utf-8")
    own = checks.open_folder(str(tmp_path / "model"))
    figures, answer = examine(own, read_run(table(tmp_path / "a.csv", gyro(zero)), own))
    assert [e["name"] for e in figures["effects"]] == (["sensor_bias"] if zero else [])
    if zero:
        found = figures["effects"][0]["parameters"]["bias"]
        assert found["value"] == pytest.approx(zero, abs=0.01)
    assert answer.point.values["pull"] == pytest.approx(14.0, rel=0.01)
