"""A delayed input that changes within steps, behind a dead band; a state that no output shows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reconcile.data import Block, Parts, runs_of
from reconcile.fit.solve import fit
from reconcile.fit.windows import InputTable
from reconcile.model import read_folder
from reconcile.study import Study
from records.measurement import Channel, Measurement

DELAY, LAG, BAND, GAIN = 0.1334, 0.05, 0.3, 2.0  # s, s, 1, 1/s
VALVE = f'''
"""A cylinder behind a valve: spool with lag and dead band, command with a transport delay."""

from fmus.definition import Model, Variable


def _rates(x, u, m, p):
    import casadi as ca

    open_ = ca.fmax(x.spool - {BAND}, 0) + ca.fmin(x.spool + {BAND}, 0)
    return {{"spool": (u.command - x.spool) / {LAG}, "x": p.gain * open_}}


MODEL = Model(
    name="valve",
    description="Cylinder behind a valve",
    kind="continuous",
    step=0.005,
    states=(Variable("spool", "1", "Spool"), Variable("x", "m", "Position")),
    inputs=(Variable("command", "1", "Command", min=-1.0, max=1.0),),
    outputs=(Variable("position", "m", "Position"),),
    parameters=(
        Variable("gain", "1/s", "Speed at full opening", start={GAIN}, min=0.1, max=10.0),
        Variable("delay", "s", "Transport delay", start={DELAY}, min=0.0, max=0.5),
    ),
    rhs=_rates,
    out=lambda x, u, m, p: {{"position": x.x}},
    delays={{"command": "delay"}},
)
'''


def recording() -> tuple[Measurement, np.ndarray]:
    """Steps of the command every 0.3 s, sampled at 50 Hz; the spool at the samples beside it."""
    rng, fine = np.random.default_rng(5), 2e-5
    time = 0.02 * np.arange(600)
    command = np.repeat(rng.uniform(-1.0, 1.0, 40), 15)
    t = fine * np.arange(round(12.0 / fine))
    late = np.where(t < DELAY, command[0], command[np.clip(((t - DELAY) / 0.02 + 1e-9).astype(int), 0, 599)])
    spool = np.empty(len(t))
    s, keep = 0.0, np.exp(-fine / LAG)
    for k, u in enumerate(late):
        spool[k] = s
        s = u + (s - u) * keep
    speed = GAIN * (np.maximum(spool - BAND, 0.0) + np.minimum(spool + BAND, 0.0))
    x = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * fine)])
    at = np.round(time / fine).astype(int)
    channels = {
        "command": Channel("command", "1", time, command),
        "position": Channel("position", "m", time, x[at] + 2e-5 * rng.standard_normal(600)),
    }
    return Measurement(channels, source="valve"), spool[at]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    folder = tmp_path_factory.mktemp("valve")
    Path(folder, "model.py").write_text(VALVE)
    model = read_folder(folder)
    (run,) = runs_of(recording()[0], model, "run")
    blocks = (Block(run, 0.0, 4.0), Block(run, 4.0, 8.0))
    return Study(model, Parts(blocks, (Block(run, 8.0, 10.0),), (Block(run, 10.0, 12.0),)), catalogue=())


def left(study: Study) -> float:
    """Root mean square of the errors in deviations of the noise, initial states where they fit best."""
    problem = study._problem(study.problems["fit"].windows)  # a new one: inputs are kept
    fitted = fit(problem, problem.start(study.values), [], iterations=0)
    assert fitted is not None
    return float(np.sqrt(fitted.cost / len(fitted.linear.errors)))


def test_a_step_is_cut_where_the_delayed_command_changes(study, monkeypatch):
    cut = left(study)
    monkeypatch.setattr(InputTable, "edge", lambda *_: None)
    assert cut < 3.0
    assert left(study) > 3.0 * cut


def test_slopes_by_a_delay_are_those_of_finite_differences(study):
    problem = study.problems["short"]
    point, change = problem.start(study.values), 1e-5
    delay = problem.parameter("delay")
    slopes = problem.simulate(point, 0, [delay])[2][:, -1, 0]
    sides = []
    for sign in (1.0, -1.0):
        p = point.p.copy()
        p[delay] += sign * change
        sides.append(problem.simulate(replace(point, p=p), 0)[1][:, 0])
    difference = (sides[0] - sides[1]) / (2.0 * change)
    assert slopes == pytest.approx(difference, abs=0.01 * np.abs(difference).max())


def test_states_that_no_output_shows_start_where_the_run_brings_them(study):
    problem, spool = study.problems["short"], recording()[1]
    point = problem.start(study.values)
    for k, window in enumerate(problem.windows):
        truth = np.interp(window.start_s, 0.02 * np.arange(600), spool)
        assert point.x0[k, 0] == pytest.approx(truth, abs=0.02)
