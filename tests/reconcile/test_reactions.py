"""What swings below an axis pulls back on it: told from recordings that show its swing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reconcile.equations.model import Folder, read_folder
from reconcile.equations.ports import find_ports
from reconcile.judging import unidentifiable
from reconcile.recordings.data import Run, runs_of, split
from reconcile.search.core import Core
from reconcile.search.sets import Sets
from reconcile.workflow import examine
from records.measurement import Channel, Measurement
from specs.errors import InputError
from tests.reconcile.truth import PERIOD, excitation

HUNG = Path(__file__).with_name("hung")
LENGTH, GRAVITY, LOAD = 0.8, 9.80665, 0.6  # kg
STEP = 1e-3


@pytest.fixture(scope="module")
def hung() -> Folder:
    return read_folder(HUNG)


def swinging(seconds: float, seed: int, mass: float = 2.2, drag: float = 1.5) -> Measurement:
    """Carriage and rod as the two bodies that they are (Lagrange), semi-implicit at STEP; all simulated.

    The swing's sensor shows its mean over the sample that follows, which is what an input holds.
    """
    rng, command = np.random.default_rng(seed), excitation(seconds, seed, size=1.5)
    per = round(PERIOD / STEP)
    q, v = np.zeros(2), np.zeros(2)  # position, deflection
    shown, swing = [], np.empty((per * len(command), 2))
    for k in range(per * len(command)):
        if k % per == 0:
            shown.append((q[0], v[0]))
        cosine, sine = np.cos(q[1]), np.sin(q[1])
        m = np.array([[mass + LOAD, LOAD * LENGTH * cosine], [cosine, LENGTH]])
        swung = LOAD * LENGTH * v[1] ** 2 * sine
        force = [command[k // per] - drag * v[0] + swung, -GRAVITY * sine]
        v = v + STEP * np.linalg.solve(m, force)
        q = q + STEP * v
        swing[k] = q[1], v[1]
    (x, speed), (sway, rate) = np.array(shown).T, swing.reshape(-1, per, 2).mean(axis=1).T
    noise = {"position": 2e-4, "velocity": 2e-3, "sway": 1e-4, "sway_rate": 1e-3, "force": 0.0}
    columns = {"position": x, "velocity": speed, "sway": sway, "sway_rate": rate, "force": command}
    units = {"position": "m", "velocity": "m/s", "sway": "rad", "sway_rate": "rad/s", "force": "N"}
    t = PERIOD * np.arange(len(x))
    noisy = {n: c + noise[n] * rng.standard_normal(len(t)) for n, c in columns.items()}
    return Measurement({n: Channel(n, units[n], t, c) for n, c in noisy.items()}, source="hung")


@pytest.fixture(scope="module")
def runs(hung) -> list[Run]:
    return runs_of(swinging(20.0, 3), hung, "run")


def test_it_is_among_the_first_forces_and_its_mass_is_right(hung, runs):
    core = Core(hung, split(runs, (), ()))
    sets = Sets(core)
    forces = [s for s in sets.scores(frozenset()) if s.attached.effect.place in ("force", "coupling")]
    reaction = next(s for s in forces[:6] if s.attached.key == "tool_reaction@load")  # so many are fitted
    grown = sets.attempt(frozenset(), reaction)
    assert grown is not None
    assert sets.points[grown].values["tool_reaction@load.mass"] == pytest.approx(LOAD, rel=0.05)


@pytest.mark.slow
@pytest.mark.long
def test_it_is_named(hung, runs):
    figures = examine(hung, runs)[0]
    assert figures["verdict"] == "named"
    (effect,) = figures["effects"]
    assert (effect["name"], effect["place"], effect["port"]) == ("tool_reaction", "coupling", "load")
    assert effect["parameters"]["mass"]["unit"] == "kg"
    assert effect["parameters"]["mass"]["value"] == pytest.approx(LOAD, rel=0.05)


@pytest.fixture(scope="module")
def reaching(hung) -> Folder:
    """The same carriage, which knows how far out its load hangs, and nothing of its swing."""
    axis = {"velocity": "v", "position": "x", "unit": "N", "inertia": "mass", "drive": "force"}
    return replace(
        hung, ports=find_ports(hung.model, {"carriage": axis | {"reach2": lambda x, u, m, p: 1.0}})
    )


def test_a_swing_that_nobody_recorded_is_told_by_what_it_does_to_the_axis(reaching, runs):
    core = Core(reaching, split([without_swing(r) for r in runs], (), ()))
    (swing,) = (a for a in core.candidates if a.effect.name == "tool_reaction")
    sets = Sets(core)
    scored = next(s for s in sets.scores(frozenset()) if s.attached is swing)
    grown = sets.attempt(frozenset(), scored)
    assert grown is not None
    values = sets.points[grown].values
    assert values[swing.name("mass")] == pytest.approx(LOAD, rel=0.05)
    assert values[swing.name("frequency")] == pytest.approx(np.sqrt(GRAVITY / LENGTH), rel=0.03)


def test_a_model_that_does_not_say_what_hangs_from_it_is_told_so(rig, runs):
    rows = {r["effect"]: r["because"] for r in unidentifiable.effects(rig, [without_swing(r) for r in runs])}
    assert "kind hung" in rows["tool_reaction"]


def without_swing(run: Run) -> Run:
    return replace(run, inputs={"force": run.inputs["force"]})


def test_a_port_without_its_pull_or_of_no_axis_is_refused(hung):
    axis = {"velocity": "v", "position": "x", "inertia": "mass"}
    with pytest.raises(InputError, match="no 'pull'"):
        find_ports(hung.model, {"carriage": axis, "load": {"kind": "hung", "axis": "carriage"}})
    with pytest.raises(InputError, match="load"):
        find_ports(hung.model, {"carriage": axis, "load": {"kind": "hung", "axis": "x", "pull": "sway"}})
