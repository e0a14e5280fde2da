"""The slew model: rest, brake, torque limit, reference roll-out."""

import csv
import os
from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from fmus.equations import slew_drive
from fmus.models.slew.model import MODEL
from fmus.toolchain import codegen
from fmus.toolchain.stepper import Stepper

REFERENCE = Path(__file__).resolve().parents[3] / "fmus" / "models" / "slew" / "reference.csv"
INERTIA = 4e5
FREE, HELD = [1.0], [0.0]
STATES = [v.name for v in MODEL.states]
SCALES = np.array([1.0, 0.5, 2e7, 2e7, 0.6, 2e7])


def parameter(name: str) -> float:
    return next(v.start for v in MODEL.parameters if v.name == name)


def running(u_slew: float = 0.0, step: float | None = None, **parameters: float) -> Stepper:
    run = Stepper(MODEL, parameters, step)
    run.set(u_slew=u_slew, inertia=INERTIA, inertia_rate=0.0)
    return run


def points(count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(1)
    states = SCALES * rng.uniform(-1, 1, (count, 6))
    states[:, [2, 3]] = np.abs(states[:, [2, 3]])
    inertia, others = rng.uniform(2e5, 1.4e6, count), rng.normal(0, 1e4, (count, 2))
    inputs = np.column_stack([rng.uniform(-1, 1, count), inertia, others])
    return list(zip(states, inputs, strict=True))


def test_jacobian_is_the_derivative():
    p = MODEL.start_parameters()
    for x, u in points(20):
        exact = np.array(MODEL.jacobian(x, u, FREE, p)) * SCALES
        for k, size in enumerate(SCALES * 1e-7):
            moved = [np.array(MODEL.f(x + s * size * np.eye(6)[k], u, FREE, p)).ravel() for s in (1, -1)]
            slope = (moved[0] - moved[1]) / (2 * size) * SCALES[k]
            assert np.all(
                np.abs(exact[:, k] - slope) <= 1e-3 * np.abs(slope) + 1e-5 * np.abs(exact).max(axis=1)
            )


def test_no_output_feeds_through():
    codegen.check_no_feedthrough(MODEL)


def test_every_parameter_is_used():
    x, u, m, p = MODEL.symbols
    guards = ca.vertcat(*MODEL.guards(x, u, m, p))
    everything = ca.vertcat(MODEL.f(x, u, m, p), MODEL.h(x, u, m, p), guards, MODEL.x0(p))
    hits = ca.which_depends(everything, p, 1, False)
    named = {*MODEL.delays.values(), *(d for mode in MODEL.modes for d in (mode.on_delay, mode.off_delay))}
    unused = [
        v.name for v, hit in zip(MODEL.parameters, hits, strict=True) if not hit and v.name not in named
    ]
    assert unused == []


@pytest.mark.parametrize("mode", [FREE, HELD])
def test_rest_stays_at_rest(mode):
    run = running()
    start = run.x.copy()
    run.m[:] = mode
    run.advance(1000)
    assert np.array_equal(run.x, start)


def test_dead_band_moves_nothing():
    run = running(u_slew=0.95 * parameter("slew_dead_band"))
    run.advance(2500)
    assert run.m[0] == 1.0  # the brake is off, yet
    assert run.state("q") == 0.0
    assert run.state("p_a") == run.state("p_b")


def test_brake_holds_against_a_push_and_lets_go_when_released():
    moved = {}
    for joystick in (0.0, 0.9 * parameter("slew_dead_band")):
        run = running(u_slew=joystick)
        run.set(disturbance_torque_slew=1e5)
        run.advance(1000)
        moved[joystick] = abs(np.degrees(run.state("q")))
    held, free = moved.values()
    assert held < 0.2
    assert free > 1.0


def test_brake_timers():
    run = running(u_slew=0.5)
    run.advance(round((parameter("slew_delay") + parameter("slew_brake_release_time")) / MODEL.step) - 2)
    assert run.m[0] == 0.0
    run.advance(6)
    assert run.m[0] == 1.0
    run.set(u_slew=0.0)
    run.advance(round(parameter("slew_brake_engage_time") / MODEL.step))
    assert run.m[0] == 1.0
    run.advance(round(parameter("slew_delay") / MODEL.step) + 10)
    assert run.m[0] == 0.0


def test_steady_state_is_one_and_faster_with_more_joystick():
    speeds, pressures = [], []
    for joystick in (0.24, 0.5, 1.0):
        run = running(u_slew=joystick, step=0.01)  # a coarse step finds the same rest
        run.advance(4000)
        rates = run.rates()
        assert abs(rates["qd"]) < 1e-5
        assert abs(rates["p_a"]) < 1e3
        speeds.append(np.degrees(run.state("qd")))
        pressures.append(run.state("p_a"))
    assert speeds[0] > 3
    assert speeds == sorted(speeds)
    assert 40 < speeds[-1] < 60


def test_drive_is_torque_limited():
    """With the carriage held, the pressure stops at the cut-off, which rises with the joystick."""
    found = []
    for joystick in (0.24, 0.47, 1.0):
        run = running(u_slew=joystick, slew_brake_release_time=0.5)
        run.advance(round((0.5 + parameter("slew_delay")) / MODEL.step))
        found.append(run.state("p_a"))
        opening = float(slew_drive.opening(joystick, start_values()))
        low, high, scale = (parameter(f"slew_cut_off_{n}") for n in ("low", "high", "scale"))
        limit = low + (high - low) * (1 - np.exp(-opening / scale)) / (1 - np.exp(-1 / scale))
        assert found[-1] < 1.02 * limit
    assert found == sorted(found)
    assert found[-1] > 300e5


def test_reference_roll_out():
    """`SLEWRIGHT_UPDATE_REFS=1 pytest ...` rewrites reference.csv; the difference is then in the commit."""

    def joystick(time: float) -> float:
        return 0.7 if time < 3 else -1.0 if time < 6 else 0.35 if time < 8 else 0.0

    run = running()
    found = run.run(
        lambda t: {"u_slew": joystick(t), "disturbance_torque_slew": 5e3 * (4 < t < 5)}, 10.0, 0.1
    )
    found["u_slew"] = np.array([joystick(t) for t in found["time"]])
    if os.environ.get("SLEWRIGHT_UPDATE_REFS"):
        rows = zip(*(found[n] for n in found), strict=True)
        lines = [",".join(found), *(",".join(f"{value:.12g}" for value in row) for row in rows)]
        REFERENCE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with REFERENCE.open(encoding="utf-8", newline="") as file:
        header, *rows = list(csv.reader(file))
    assert header == list(found)
    np.testing.assert_allclose(np.array(rows, dtype=float).T, list(found.values()), rtol=1e-7, atol=1e-7)


def start_values() -> SimpleNamespace:
    """Parameter namespace of start values."""
    return SimpleNamespace(**{v.name: v.start for v in MODEL.parameters})
