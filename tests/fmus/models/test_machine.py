"""The reference machine: form, rest, arm speeds, shared pump, reference roll-out."""

import csv
import os
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fmus.equations import cylinder, kinematics
from fmus.models.machine import arm_hydraulics, dynamics
from fmus.models.machine.model import MODEL
from fmus.toolchain import codegen
from fmus.toolchain.stepper import Stepper
from tests.fmus.models.machine_runs import ANGLES, COARSE, PARAMETERS, POSES, start, working

REFERENCE = Path(__file__).resolve().parents[3] / "fmus" / "models" / "machine" / "reference.csv"


def test_no_output_feeds_through() -> None:
    codegen.check_no_feedthrough(MODEL)


def test_every_parameter_is_used() -> None:
    x, u, m, p = MODEL.symbols
    everything = ca.vertcat(MODEL.f(x, u, m, p), MODEL.h(x, u, m, p), *MODEL.guards(x, u, m, p), MODEL.x0(p))
    hits = ca.which_depends(everything, p, 1, False)
    named = {*MODEL.delays.values(), *(d for mode in MODEL.modes for d in (mode.on_delay, mode.off_delay))}
    named |= {n for s in MODEL.sensors.values() for n in (s.delay, s.bias, s.noise, s.quantum)}
    elsewhere = set(kinematics.geometry().__dict__)  # geometry.toml also serves controllers
    unused = {v.name for v, hit in zip(MODEL.parameters, hits, strict=True) if not hit}
    assert unused - named - elsewhere == set()


def test_cylinders_reach_over_the_joint_range() -> None:
    for joint in ("boom", "stick"):
        c = arm_hydraulics.parameters(PARAMETERS, joint)
        lowest, highest = (getattr(PARAMETERS, f"{joint}_{end}") for end in ("min", "max"))
        assert c.retracted < float(cylinder.length(lowest, c)) - 0.05
        assert float(cylinder.length(highest, c)) + 0.05 < c.extended


@pytest.mark.parametrize("load", [0.0, 2000.0])
@pytest.mark.parametrize("pose", POSES)
def test_starts_in_equilibrium(pose: tuple[float, float], load: float) -> None:
    rates = Stepper(MODEL, start(*pose, load_mass=load)).rates()
    scale = {v.name: 1e-6 * (v.nominal or 1.0) for v in MODEL.states}
    assert {n: r for n, r in rates.items() if abs(r) > scale[n]} == {}


def test_nothing_moves_in_a_minute_of_neutral() -> None:
    run = Stepper(MODEL, start(1.0, -1.2, load_mass=1500.0), COARSE).run({}, 60.0, every=0.1)
    assert max(np.ptp(run[n]) for n in ANGLES) < 1e-6


def test_arm_does_not_sink_after_a_move() -> None:
    """Oil springs and tool have come to rest 20 s after the valves closed; from then on nothing creeps."""
    machine = Stepper(MODEL, start(1.0, -1.2, load_mass=2000.0), COARSE)
    machine.run(
        lambda t: {"u_boom": -0.6, "u_stick": 0.6} if t < 1 else {"u_boom": 0.0, "u_stick": 0.0}, 22.0
    )
    later = machine.run({}, 20.0, every=0.1)
    for joint in ("boom", "stick"):
        first, last = (later[f"true_q_{joint}"][part].mean() for part in (slice(0, 60), slice(-60, None)))
        assert abs(last - first) < 2e-4


def test_brake_holds_on_a_slope() -> None:
    run = Stepper(MODEL, start(1.0, -1.2, slope_roll=0.05), COARSE).run({}, 10.0, every=0.1)
    assert np.degrees(np.ptp(run["true_q_slew"])) < 0.5


@pytest.mark.parametrize("load", [0.0, 2000.0])
@pytest.mark.parametrize(
    ("joint", "pose", "u"),
    [
        ("boom", (0.95, -1.5), 1),
        ("boom", (1.25, -1.5), -1),
        ("stick", (1.1, -1.6), 1),
        ("stick", (1.1, -1.1), -1),
    ],
)
def test_arm_reaches_its_speed(joint: str, pose: tuple[float, float], u: float, load: float) -> None:
    """More than the 0.2 rad/s of the velocity references within the joystick's range, with some margin."""
    run = Stepper(MODEL, start(*pose, load_mass=load), COARSE).run({f"u_{joint}": u}, 2.2)
    steady = run["time"] > 1.2
    speed = u * run[f"true_qd_{joint}"][steady].mean()
    assert 0.225 < speed < 0.4


def test_dead_band_moves_nothing() -> None:
    u = {f"u_{j}": 0.95 * getattr(PARAMETERS, f"{j}_valve_dead_band") for j in ("boom", "stick")}
    run = Stepper(MODEL, None, COARSE).run(u, 3.0)
    assert max(np.ptp(run[n]) for n in ANGLES) < 1e-9


def test_simultaneous_demands_share_the_pump() -> None:
    pose = start(0.9, -1.6, load_mass=1000.0)
    everything = {"u_slew": 1.0, "u_boom": 1.0, "u_stick": 1.0}
    speeds = {}
    for name, u in {"boom": {"u_boom": 1.0}, "stick": {"u_stick": 1.0}, "all": everything}.items():
        run = Stepper(MODEL, pose, COARSE).run(u, 2.0)
        speeds[name] = {j: run[f"true_qd_{j}"][-40:].mean() for j in ("boom", "stick")}
    alone = speeds["boom"]["boom"] + speeds["stick"]["stick"]
    assert speeds["all"]["boom"] + speeds["all"]["stick"] < 0.9 * alone


def test_slew_alone_is_never_short_of_oil() -> None:
    """The pump stays above the drive's own cut-off pressure: alone, it behaves as calibrated."""
    machine = Stepper(MODEL, start(1.1, -2.1), COARSE)
    x, _, _, p = MODEL.namespaces
    cut_off = ca.Function("load", list(MODEL.symbols), [dynamics.slew_load_pressure(x.slew_spool, p)])
    machine.set(u_slew=1.0)
    machine.advance(round(0.15 / machine.step_s))  # the joystick's delay and the pump's own rise
    for _ in range(50):
        machine.advance(round(0.05 / machine.step_s))
        wanted = float(cut_off(machine.x, machine.u, machine.m, machine.p))
        assert machine.state("pump_pressure") > 0.995 * wanted


def test_reference_roll_out() -> None:
    """`SLEWRIGHT_UPDATE_REFS=1 pytest ...` rewrites it; the difference is then in the commit."""
    run = Stepper(MODEL, start(1.0, -1.3, load_mass=1000.0)).run(working, 8.0, every=0.1)
    header = list(run)
    rows = np.array(list(run.values())).T
    if os.environ.get("SLEWRIGHT_UPDATE_REFS"):
        lines = [",".join(header), *(",".join(f"{value:.10g}" for value in row) for row in rows)]
        REFERENCE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with REFERENCE.open(encoding="utf-8", newline="") as file:
        read_header, *read = list(csv.reader(file))
    assert read_header == header
    scale = np.array([v.nominal or 1.0 for v in MODEL.outputs])
    np.testing.assert_allclose(
        rows[:, 1:] / scale, np.array(read, dtype=float)[:, 1:] / scale, rtol=1e-6, atol=1e-6
    )
