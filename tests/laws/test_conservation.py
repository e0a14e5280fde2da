"""What goes in is stored, lost or comes out: energy, oil and angular momentum of the machine's models."""

from types import SimpleNamespace

import numpy as np
import pytest

from fmus.equations import slew_drive
from fmus.models.machine import energy
from fmus.models.machine.model import MODEL as MACHINE
from fmus.models.slew.model import MODEL
from fmus.toolchain.stepper import Stepper
from tests.fmus.models.machine_runs import start, working
from tests.fmus.models.test_slew import FREE, INERTIA, STATES, parameter, running, start_values


def test_the_machines_power_balances() -> None:
    """Supply = losses + storage + change of mechanical energy, within a thousandth of the supply."""
    machine = Stepper(MACHINE, start(1.0, -1.3, load_mass=1000.0, slope_pitch=0.03), step=1e-3)
    balance, rows = energy.balance(MACHINE), []
    for k in range(2000):
        machine.set(**working(k * 0.004))
        machine.advance(4)
        rows.append([float(v) for v in balance(machine.x, machine.u, machine.m, machine.p)])
    supply, valves, friction, oil, mechanical = np.array(rows).T
    supplied, lost, rubbed, stored = (np.trapezoid(v, dx=0.004) for v in (supply, valves, friction, oil))
    assert supplied > 2e5
    assert rubbed > 2e4
    assert np.all(valves > -1e-6)
    left = supplied - lost - rubbed - stored
    assert left == pytest.approx(mechanical[-1] - mechanical[0], abs=1e-3 * supplied)


def test_chambers_balance_volume_and_energy():
    """What the valves give the chambers is work on the carriage, leakage and compression, within 0.2 %."""
    run, p = running(u_slew=0.8), start_values()
    work = swept = lost = 0.0
    stored = [_stored(run.x, p)]
    for tick in range(4000):
        if tick == 2500:
            run.set(u_slew=0.0)
        before = _flows(run.x, p)
        run.advance()
        a, b, torque_power, leak = 0.5 * (before + _flows(run.x, p))
        work, swept, lost = (
            work + (a + b) * MODEL.step,
            swept + torque_power * MODEL.step,
            lost + leak * MODEL.step,
        )
    stored.append(_stored(run.x, p))
    assert work > 1e5
    assert work == pytest.approx(swept + lost + stored[1] - stored[0], rel=2e-3)


def test_torques_balance_kinetic_energy():
    run, p = running(u_slew=0.6), start_values()
    given = 0.0
    for _ in range(3000):
        power = _torque(run, p) * run.state("qd")
        run.advance()
        given += 0.5 * (power + _torque(run, p) * run.state("qd")) * MODEL.step
    kinetic = 0.5 * (INERTIA + parameter("slew_inertia_extra")) * run.state("qd") ** 2
    assert given == pytest.approx(kinetic, rel=2e-3)


def test_changing_inertia_keeps_angular_momentum():
    """Without motor and friction, I' w is all that acts: (I + I_0) w' = -I' w."""
    x, p = np.zeros(6), MODEL.start_parameters({"slew_friction_viscous": 0.0, "slew_friction_dry": 0.0})
    x[STATES.index("qd")] = 0.3
    rate = np.array(MODEL.f(x, [0, INERTIA, 2e4, 0], FREE, p)).ravel()[STATES.index("qd")]
    assert rate == pytest.approx(-2e4 * 0.3 / (INERTIA + parameter("slew_inertia_extra")), rel=1e-12)


def _flows(x: np.ndarray, p: SimpleNamespace) -> np.ndarray:
    """Power (W) into chambers a and b from the valves, given to the motor, and lost in leaks."""
    s = dict(zip(STATES, x, strict=True))
    f = slew_drive.flows(s["spool"], s["relief"], s["p_a"], s["p_b"], p)
    difference = s["p_a"] - s["p_b"]
    leak = p.slew_leak_internal * difference**2
    leak += sum(p.slew_leak_external * (s[n] - p.slew_boost_pressure) * s[n] for n in ("p_a", "p_b"))
    motor = p.slew_displacement * difference * s["qd"]
    return np.array([float(f.a) * s["p_a"], float(f.b) * s["p_b"], motor, leak])


def _stored(x: np.ndarray, p: SimpleNamespace) -> float:
    s = dict(zip(STATES, x, strict=True))
    return (s["p_a"] ** 2 + s["p_b"] ** 2) / 2 * p.slew_chamber_volume / p.slew_bulk_modulus


def _torque(run: Stepper, p: SimpleNamespace) -> float:
    pressures, speed = (run.state("p_a"), run.state("p_b")), run.state("qd")
    return float(slew_drive.torque(*pressures, speed, INERTIA, run.m[0], p))
