"""Optimal control: known optima of small plants, the reduced machine against the whole, stored results."""

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from baselines.optima import lookup, resimulate, search, store
from baselines.optima.case import Case
from baselines.optima.collocation import POINTS, Phase, Problem
from baselines.optima.plant import PRESSURE, STATES, Plant
from baselines.optima.store import Entry, Key
from fmus.toolchain.loader import load_model
from fmus.toolchain.stepper import Stepper
from specs.errors import InputError

POSE = (1.3, -1.9)


def _problem(rates: list, x: ca.SX, u: ca.SX, intervals: int, longest: float) -> Problem:
    """From rest at 0, one phase of free length."""
    f = ca.Function("f", [x, u], [ca.vertcat(*rates)])
    problem = Problem(f, np.zeros(x.numel()), [Phase(intervals, None, 0.2, longest)])
    problem.bound_inputs([-1.0], [1.0])
    return problem


def test_double_integrator_is_bang_bang() -> None:
    """Rest to rest over d with |a| <= 1 takes 2 sqrt(d) (Pontryagin), full on to the middle and full back."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 1)  # type: ignore[call-arg]
    problem = _problem([x[1], u], x, u, 20, 10.0)
    end = problem.parts[0]
    problem.demand(end.ends[:, -1], [4.0, 0.0], [4.0, 0.0])
    problem.minimise(end.h * 20)
    found = problem.solve(problem.guess([np.zeros((2, 20 * POINTS))], [np.zeros((1, 20))], [5.0]))
    assert found.converged
    assert found.lengths[0] == pytest.approx(4.0, abs=1e-4)
    np.testing.assert_allclose(found.inputs[0][0], np.repeat([1.0, -1.0], 10), atol=2e-3)
    np.testing.assert_allclose(found.command(np.array([0.1, 1.9, 2.1, 3.9]))[:, 0], [1, 1, -1, -1], atol=2e-3)


def test_pendulum_takes_the_time_of_zero_vibration() -> None:
    """A speed step of a crane with |a| <= a that leaves no swing: a pulse of one period is enough (ZV limit).

    Trolley acceleration u in 0 .. 1 to a speed v = T/2 / 2: two pulses half a period T apart.
    """
    x, u = ca.SX.sym("x", 3), ca.SX.sym("u", 1)  # type: ignore[call-arg]
    period = 2.0
    w = 2 * np.pi / period
    problem = _problem([u, x[2], -(w**2) * x[1] - u], x, u, 40, 6.0)
    problem.bound_inputs([0.0], [1.0])
    end, speed = problem.parts[0], 0.1
    problem.demand(end.ends[:, -1], [speed, 0.0, 0.0], [speed, 0.0, 0.0])
    problem.minimise(end.h * 40)
    found = problem.solve(problem.guess([np.zeros((3, 40 * POINTS))], [np.full((1, 40), 0.1)], [1.5]))
    assert found.converged
    # two pulses of speed / 2 each, their middles half a period apart
    assert found.lengths[0] == pytest.approx(period / 2 + speed / 2, rel=0.03)


def test_reduced_machine_moves_as_the_whole_one() -> None:
    """One draw, a slew with its tool: the rates of all states at the whole machine's own points."""
    draw = search.draws.named("tuning:0")
    pose = dict(zip(("start_q_boom", "start_q_stick"), POSE, strict=True))
    machine = Stepper(load_model("machine"), {**draw, **pose, "load_mass": 1000.0})
    plant = Plant({**draw, "load_mass": 1000.0})
    names = {
        "slew": "slew_angle", "spool": "slew_spool", "relief": "slew_relief", "p_a": "slew_pressure_a",
        "p_b": "slew_pressure_b", "pitch": "tool_pitch", "roll": "tool_roll", "pitch_rate": "tool_pitch_rate",
        "roll_rate": "tool_roll_rate", "boom": "boom_angle", "stick": "stick_angle",
    }  # fmt: skip
    scale = np.array([PRESSURE if n in ("relief", "p_a", "p_b") else 1.0 for n in STATES])
    machine.set(u_slew=0.6)
    for _ in range(3):
        machine.advance(800)
        x = np.array([machine.state(names.get(n, n)) for n in STATES]) / scale
        rates = machine.rates()
        whole = np.array([rates[names.get(n, n)] for n in STATES]) / scale
        own = np.array(plant.rates(x, [0.6, 0.0, 0.0])).ravel()
        assert np.abs(own - whole)[:6].max() < 0.012  # the drive
        assert np.abs(own - whole)[6:8].max() < 1e-9
        assert np.abs(own - whole)[8:10].max() < 0.2  # rad/s2: the tool also feels the arm's oil give way


def test_a_stored_optimum_is_what_the_machine_does() -> None:
    """Golden: the nominal machine, 90 degrees at 11 deg/s, run again open loop."""
    entry = store.read()[Key("nominal", 0.0, 90.0, 11.0)]
    case = Case(90.0)
    again = resimulate.run(search.command(entry), case.parameters({}), case.target)
    assert entry.counts
    assert again.reached
    assert again.speed == pytest.approx(entry.found["speed"], abs=0.05)
    assert again.tool == pytest.approx(entry.found["tool"], abs=0.02)
    assert again.tool < 2.1
    assert entry.predicted_tool == pytest.approx(again.tool, rel=0.05)


def test_stored_fronts_make_sense() -> None:
    """Every entry is of a machine that may be looked at, and gentler commands of a case are slower."""
    entries = store.read()
    assert entries
    for key, entry in entries.items():
        assert not key.machine.startswith("test")
        assert 0 <= entry.found["tool"] < 40
        if entry.counts and entry.status == "Solve_Succeeded" and entry.reserve_deg < 0.8:
            assert entry.found["speed"] >= key.speed * 0.98
    cases = {(k.machine, k.load_kg, k.travel_deg, k.move) for k in entries}
    for machine, load, travel, move in cases:
        points = lookup.front(travel, load, machine, move=move)
        assert points == sorted(points)
        hull = lookup.hull(points)
        assert [p[1] for p in hull] == sorted(p[1] for p in hull)


def test_least_tool_spends_speed_where_it_is_cheap() -> None:
    cheap, dear = [(10.0, 1.0), (14.0, 2.0)], [(10.0, 1.0), (14.0, 9.0)]
    assert lookup.fastest([cheap, dear]) == 14.0
    assert lookup.least_tool([cheap, dear], 12.0) == pytest.approx(1.5)  # all of it from the first
    assert lookup.least_tool([cheap, dear], 13.0) == pytest.approx((2.0 + 5.0) / 2)
    assert lookup.least_tool([cheap, dear], 14.1) is None
    assert lookup.least_tool([cheap, dear], 8.0) == 1.0
    assert lookup.share([cheap, dear], 12.0, 3.0) == lookup.Share(12.0 / 14.0, 0.5)
    bent = [(8.0, 1.0), (10.0, 5.0), (12.0, 4.0), (14.0, 9.0)]
    assert lookup.hull(bent) == [(8.0, 1.0), (12.0, 4.0), (14.0, 9.0)]


def test_store_round_trip(tmp_path: Path) -> None:
    found = {"time_s": 8.0, "speed": 11.0, "tool": 2.0, "reached": True}
    entry = Entry(
        Key("nominal", 0.0, 90.0), found, 8.0, 2.0, "Solve_Succeeded", 9, 0.15, "quintic", (1.0,), ((0.1,),)
    )
    path = tmp_path / "found.json"
    store.write([entry], {"solver": "x"}, path)
    again = store.read(path)[entry.key]
    assert json.loads(path.read_text())["solver"] == "x"
    assert again.found == found
    assert again.key.name == "nominal, 0 kg, 90 deg, least time"
    path.write_text("[]")
    with pytest.raises(InputError, match="not a file of optima"):
        store.read(path)


@pytest.mark.parametrize(
    ("key", "message"),
    [
        (Key("nominal", 0.0, 200.0), "travel 200 deg: valid are 45 to 135"),
        (Key("nominal", -1.0, 90.0), "load -1 kg"),
        (Key("nominal", 0.0, 90.0, 1.0), "speed 1 deg/s over 90 deg"),
        (Key("test:0", 0.0, 90.0), "sealed"),
    ],
)
def test_a_case_that_no_run_has_is_refused(key: Key, message: str) -> None:
    with pytest.raises(InputError, match=message):
        search.find([key], lambda what, done, total: None)
