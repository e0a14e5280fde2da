"""Building blocks of hydraulic and friction equations: pure functions of CasADi expressions or floats.

Everything is at least once continuously differentiable, so that the linearly implicit step and exact
sensitivities are well defined; what is zero is exactly zero (a closed valve does not leak, a check valve
does not flow backwards), and functions of a signed quantity are exactly odd.
Pressures in Pa (gauge), flows in m3/s.
"""

from typing import Any

import casadi as ca

Scalar = Any  # casadi.SX or float
REFERENCE_DROP = 100e5  # Pa: valve sizes are given as their flow at this pressure drop


def ramp(x: Scalar, width: Scalar) -> Scalar:
    """Smooth positive part: exactly 0 for x <= 0, x - width/2 above `width`, a parabola between."""
    knee = ca.fmin(ca.fmax(x, 0.0), width)
    return knee * knee / (2.0 * width) + ca.fmax(x - width, 0.0)


def dead_band(x: Scalar, band: Scalar, width: Scalar) -> Scalar:
    """Share of full stroke beyond a dead band: odd in x, 0 inside, 1 at x = 1, rounded over `width`."""
    return (ramp(x - band, width) - ramp(-x - band, width)) / (1.0 - band - 0.5 * width)


def limited_lag(target: Scalar, x: Scalar, lag: Scalar, rate: Scalar) -> Scalar:
    """dx/dt of a first-order lag (s) towards `target` whose speed saturates softly at `rate` (1/s)."""
    return rate * ca.tanh((target - x) / (lag * rate))


def root(drop: Scalar, laminar: Scalar) -> Scalar:
    """Signed square root of a pressure drop (Pa), linear below `laminar` (d sqrt|x| at 0 is not a number)."""
    return drop / ca.sqrt(ca.sqrt(drop * drop + laminar * laminar))


def orifice_flow(size: Scalar, drop: Scalar, laminar: Scalar) -> Scalar:
    """Flow through a turbulent orifice that passes `size` at a drop of 100 bar."""
    return size * root(drop, laminar) / ca.sqrt(REFERENCE_DROP)


def check_flow(conductance: Scalar, drop: Scalar, width: Scalar) -> Scalar:
    """Flow of a check valve in its linear range (`conductance` in m3/(s Pa)), exactly 0 against it."""
    return conductance * ramp(drop, width)


def relief_flow(size: Scalar, drop: Scalar, cracking: Scalar, width: Scalar) -> Scalar:
    """Flow of a relief valve with a quadratic curve: `size` at 100 bar above `cracking`; odd in `drop`."""
    forward = ramp(drop - cracking, width) / REFERENCE_DROP
    backward = ramp(-drop - cracking, width) / REFERENCE_DROP
    return size * (forward * forward - backward * backward)


def cut_off_pressure(opening: Scalar, low: Scalar, high: Scalar, scale: Scalar) -> Scalar:
    """Pressure (Pa) at which a torque-limited supply stops: `low` when closed, `high` at full opening."""
    return low + (high - low) * (1.0 - ca.exp(-opening / scale)) / (1.0 - ca.exp(-1.0 / scale))


def coulomb(speed: Scalar, torque: Scalar, knee: Scalar) -> Scalar:
    """Dry friction (N.m), rounded over the speed `knee` (rad/s): the torque that opposes the motion."""
    return torque * ca.tanh(speed / knee)


def stribeck(speed: Scalar, static: Scalar, kinetic: Scalar, decay: Scalar, knee: Scalar) -> Scalar:
    """Friction (N.m) that falls from `static` to `kinetic` over the speed `decay`, rounded over `knee`."""
    ratio = speed / decay
    return (kinetic + (static - kinetic) * ca.exp(-ratio * ratio)) * ca.tanh(speed / knee)
