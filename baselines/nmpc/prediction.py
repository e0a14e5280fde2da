"""What the controller believes of the machine: drive, arm and tool with nominal figures, stepped forwards.

    s' = (s_c - s) / T_spool                          valve opening, commanded beyond the dead band
    p_a', p_b'                                        fmus/equations/slew_drive.py, relief without lag
    I_0 w' = D (p_a - p_b) - friction + k m r g sin(t_x)      k m: share of the tool that swings with its tip
    v' = (v_ref - v) / T_arm,  q' = v                 boom, stick
    l_x t_x'' = -g sin t_x - w' (r - l_y t_y) - 2 w (r' - l_y t_y') + w^2 l_x t_x - b l_x t_x'
    l_y t_y'' = -g sin t_y + r'' - w^2 (r - l_y t_y) - 2 w l_x t_x' - w' l_x t_x - b l_y t_y'

with I_0 the slew inertia without the swinging share of the tool, r the radius of the arm tip.  Figures:
specs/parameters slew.toml, geometry.toml, machine.toml (of the grab: masses, lengths) and the load that the
controller was told; none of a machine draw.  The pressures are kept as sum and difference: a motion and its
mirror image are then the same to the last bit.  A step is semi-implicit: valve and arm by implicit Euler,
each pressure by linearly implicit Euler (its valves are stiff), then the speed with the new pressures, then
tool and angles with the new speed.
"""

from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from fmus.equations import kinematics, multibody, slew_drive
from fmus.models.machine import dynamics
from specs import parameters

PRESSURE = 1e7  # Pa, unit of the pressures here
DRIVE = ("slew", "speed", "p_sum", "p_difference", "opening")
TOOL = ("roll", "pitch", "roll_rate", "pitch_rate")
ARM = ("boom", "stick", "boom_rate", "stick_rate")
STATES = (*DRIVE, *TOOL, *ARM)
INPUTS = ("opening", "boom", "stick")  # commanded opening, velocity references (rad/s)
FILES = ("geometry", "slew", "machine")
FED = 30e5  # Pa: above it a chamber is fed by the valve, not by the suction valve
STILL = 0.01  # rad/s
CRACKING = 150e5  # Pa: above it the soft-stop valve passes a part of the flow
LEAST, MOST = 0.004, 0.15  # openings between which the dead band is told
ARM_LAG_S = 0.12  # rest of the arm's delay behind the start of the horizon, and its own lag


def figures() -> SimpleNamespace:
    """Nominal parameters of the machine by name."""
    return SimpleNamespace(**{name: q.value for name, q in parameters.load(*FILES).items()})


def step(x: Any, u: Any, load: Any, h: float) -> ca.SX:
    """State [13] after `h` s at inputs `u` [3] with `load` kg told."""
    p = figures()
    p.load_mass = load
    now = SimpleNamespace(**{name: x[i] for i, name in enumerate(STATES)})
    opening = now.opening + h / (p.slew_spool_lag + h) * (u[0] - now.opening)
    p_a, p_b = _pressures(now, opening, h, p)
    share = h / (ARM_LAG_S + h)
    boom_rate = now.boom_rate + share * (u[1] - now.boom_rate)
    stick_rate = now.stick_rate + share * (u[2] - now.stick_rate)
    boom, stick = now.boom + h * boom_rate, now.stick + h * stick_rate
    tip = _tip(now, boom_rate, stick_rate, h, p)
    speed = now.speed + h * _slew_acceleration(now, p_a, p_b, tip[0], p)
    roll_rate, pitch_rate = _swing(now, speed, (speed - now.speed) / h, tip, h, p)
    values = {
        "slew": now.slew + h * (now.speed + speed) / 2,
        "speed": speed,
        "p_sum": p_a + p_b,
        "p_difference": p_a - p_b,
        "opening": opening,
        "roll": now.roll + h * roll_rate,
        "pitch": now.pitch + h * pitch_rate,
        "roll_rate": roll_rate,
        "pitch_rate": pitch_rate,
        "boom": boom,
        "stick": stick,
        "boom_rate": boom_rate,
        "stick_rate": stick_rate,
    }
    return ca.vertcat(*(values[name] for name in STATES))


def tool_lengths(load: Any) -> tuple[Any, Any, Any]:
    """Pendulum lengths (roll, pitch; m) and the mass (kg) that swings with the arm tip, `load` kg told."""
    p = figures()
    p.load_mass = load
    mass, first, second = multibody.tool_moments(p)
    pitch_inertia, _ = dynamics.tool_inertias(p)
    return second / first, pitch_inertia / (mass * p.grab_offset + first), first * first / second


def span(p: SimpleNamespace) -> float:
    """Joystick beyond the dead band at full opening."""
    return 1.0 - p.slew_dead_band - slew_drive.ROUNDING / 2


def joystick(opening: Any, band: Any, ramp: float) -> Any:
    """Joystick for a commanded `opening`; the dead band `band` is jumped over +-`ramp` of opening."""
    p = figures()
    jump = ca.fmin(ca.fmax(opening / ramp, -1.0), 1.0)
    wanted = opening * span(p) + (band + slew_drive.ROUNDING / 2) * jump
    return ca.fmin(ca.fmax(wanted, -1.0), 1.0)


def opening_miss(opening: Any, p_a: Any, p_b: Any, climb_a: Any, climb_b: Any, speed: Any) -> Any:
    """How much more the valve seems to be open than `opening` (towards its side), from what flows through it.

    Pressures in PRESSURE and `climb_*` their rates (1/s).  Only small openings tell a dead band: a drive that
    pulls slowly or stands shows the inlet's flow, one that is braked by a nearly closed valve the outlet's.
    0 everywhere else.
    """
    p = figures()
    side = ca.if_else(opening > 0, 1.0, -1.0)
    share, turning = ca.fabs(opening), side * speed
    fed, back = (ca.if_else(opening > 0, one, other) * PRESSURE for one, other in ((p_a, p_b), (p_b, p_a)))
    fed_climb, back_climb = (
        ca.if_else(opening > 0, one, other) * PRESSURE
        for one, other in ((climb_a, climb_b), (climb_b, climb_a))
    )
    flows = slew_drive.flows_at(share, fed - back, fed, back, p)
    compliance = p.slew_chamber_volume / p.slew_bulk_modulus
    leak = p.slew_leak_internal * (fed - back)
    swept = p.slew_displacement * turning
    inlet = swept + leak + p.slew_leak_external * (fed - p.slew_boost_pressure) + compliance * fed_climb
    outlet = swept + leak - p.slew_leak_external * (back - p.slew_boost_pressure) - compliance * back_climb
    pulling = (fed > FED) + (ca.fabs(speed) < STILL) * (fed <= FED) * (back <= FED)
    braked = (fed <= FED) * (back > FED) * (back < CRACKING) * (turning > STILL)
    by_inlet = pulling * (inlet - flows.inlet_a + flows.cross) / (2 * p.slew_inlet_flow)
    root = ca.fmax(flows.outlet_b / ca.fmax(share, 1e-3), 1e-6)
    by_outlet = braked * (outlet / root - share)
    return (share > LEAST) * (share < MOST) * (by_inlet + by_outlet)


def _pressures(now: SimpleNamespace, opening: Any, h: float, p: SimpleNamespace) -> tuple[Any, Any]:
    """Chamber pressures after `h` s, each by one linearly implicit Euler step of its own."""
    symbols = ca.SX.sym("p", 2)  # type: ignore[call-arg]
    p_a, p_b = symbols[0] * PRESSURE, symbols[1] * PRESSURE
    flows = slew_drive.flows_at(opening, p_a - p_b, p_a, p_b, p)
    rates = ca.vertcat(*slew_drive.pressure_rates(flows, p_a, p_b, now.speed, p)) / PRESSURE
    slopes = ca.vertcat(*(ca.jacobian(rates[i], symbols[i]) for i in range(2)))
    after = symbols + h * rates / (1 - h * slopes)
    before = ca.vertcat(now.p_sum + now.p_difference, now.p_sum - now.p_difference) / 2
    after = ca.substitute(after, symbols, before)
    least = 0.02  # of PRESSURE: the checks hold the low side up
    return ca.fmax(after[0], least), ca.fmax(after[1], least)


def _tip(now: SimpleNamespace, boom_rate: Any, stick_rate: Any, h: float, p: SimpleNamespace) -> tuple:
    """Radius of the arm tip, its rate and acceleration."""
    radius, _ = kinematics.arm_tip(now.boom, now.stick, p)
    before, _ = kinematics.arm_tip_rate(now.boom, now.stick, now.boom_rate, now.stick_rate, p)
    boom, stick = now.boom + h * boom_rate, now.stick + h * stick_rate
    after, _ = kinematics.arm_tip_rate(boom, stick, boom_rate, stick_rate, p)
    return radius, after, (after - before) / h


def _slew_acceleration(now: SimpleNamespace, p_a: Any, p_b: Any, radius: Any, p: SimpleNamespace) -> Any:
    whole = kinematics.inertia_z(now.boom, now.stick, p.load_mass, p)
    _, _, mass = tool_lengths(p.load_mass)
    rigid = whole + p.slew_inertia_extra - mass * radius**2
    drive = p.slew_displacement * (p_a - p_b) * PRESSURE
    friction = slew_drive.friction(now.speed, whole, p)
    return (drive - friction + mass * radius * p.gravity * ca.sin(now.roll)) / rigid


def _swing(
    now: SimpleNamespace, speed: Any, slew_acc: Any, tip: tuple, h: float, p: SimpleNamespace
) -> tuple[Any, Any]:
    """Roll and pitch rate after `h` s."""
    radius, radius_rate, radius_acc = tip
    l_x, l_y, _ = tool_lengths(p.load_mass)
    across = slew_acc * (radius - l_y * now.pitch) + 2 * speed * (radius_rate - l_y * now.pitch_rate)
    roll = (-p.gravity * ca.sin(now.roll) - across) / l_x + speed**2 * now.roll
    along = radius_acc - speed**2 * (radius - l_y * now.pitch)
    along = along - 2 * speed * l_x * now.roll_rate - slew_acc * l_x * now.roll
    pitch = (-p.gravity * ca.sin(now.pitch) + along) / l_y
    roll = roll - p.grab_damping_roll * now.roll_rate
    pitch = pitch - p.grab_damping_pitch * now.pitch_rate
    return now.roll_rate + h * roll, now.pitch_rate + h * pitch


def rest(boom: float, stick: float) -> np.ndarray:
    """State [13] at rest with the tool hanging."""
    boost = figures().slew_boost_pressure / PRESSURE
    values = {"boom": boom, "stick": stick, "p_sum": 2 * boost}
    return np.array([values.get(name, 0.0) for name in STATES])
