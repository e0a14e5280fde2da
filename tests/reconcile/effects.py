"""Effects in the rig's truth, in their non-smooth form, by name: what reconcile has to find."""

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from tests.reconcile.truth import DT, Truth, coulomb

Shape = Callable[[np.ndarray], np.ndarray]


def lag(time: float) -> Shape:
    """First-order lag of a held signal, exact."""
    decay = np.exp(-DT / time)
    return lambda u: lfilter([0.0, 1.0 - decay], [1.0, -decay], u, zi=[u[0]])[0]


def delay(seconds: float) -> Shape:
    """Transport delay."""
    n = round(seconds / DT)
    return lambda u: np.concatenate([np.full(n, u[0]), u[:-n]])


def dead_zone(half_width: float) -> Shape:
    """Nothing within +-half_width."""
    return lambda u: np.sign(u) * np.maximum(np.abs(u) - half_width, 0.0)


def play(gap: float) -> Shape:
    """Backlash of full width `gap`."""

    def shape(u: np.ndarray) -> np.ndarray:
        followed, at = np.empty_like(u), u[0]
        for i, value in enumerate(u):
            at = min(max(at, value - 0.5 * gap), value + 0.5 * gap)
            followed[i] = at
        return followed

    return shape


def stribeck(kinetic: float, static: float, speed: float) -> dict:
    """Friction that falls from `static` to `kinetic` around `speed`."""
    return {
        "static": (static, static),
        "kinetic": lambda v: np.sign(v) * (kinetic + (static - kinetic) * np.exp(-((v / speed) ** 2))),
    }


# name -> (truth, the value of a parameter of the effect that tells it)
SINGLE: dict[str, tuple[Truth, dict[str, float]]] = {
    "coulomb_friction": (Truth(**coulomb(1.0)), {"Fc": 1.0}),
    "stribeck_friction": (Truth(**stribeck(0.8, 1.6, 0.1)), {"Fc": 0.8, "Fs": 1.6, "vs": 0.1}),
    "quadratic_drag": (Truth(force=lambda x, v, t: -0.6 * v * abs(v)), {"k": 0.6}),
    "stiffness": (Truth(force=lambda x, v, t: -1.5 * x), {"k": 1.5}),
    "cubic_stiffness": (Truth(force=lambda x, v, t: -0.8 * x**3), {"k3": 0.8}),
    "torque_ripple": (Truth(force=lambda x, v, t: 0.5 * np.sin(9 * x)), {"waves": 9.0, "sine": 0.5}),
    "end_stop": (Truth(force=lambda x, v, t: -300 * max(x - 1.2, 0)), {"k": 300.0, "position": 1.2}),
    "input_dead_zone": (Truth(inputs=dead_zone(1.0)), {"half_width": 1.0}),
    "input_lag": (Truth(inputs=lag(0.12)), {"time": 0.12}),
    "input_saturation": (Truth(inputs=lambda u: np.clip(u, -4, 4)), {"limit": 4.0}),
    "asymmetric_gain": (Truth(inputs=lambda u: np.where(u > 0, 1.1, 0.9) * u), {"difference": 0.2}),
    "sensor_scale": (Truth(velocity=lambda v: 1.08 * v), {"error": 0.08}),
    "sensor_nonlinearity": (Truth(position=lambda y: y + 0.02 * y**2), {"curve": 0.02}),
    "sensor_delay": (Truth(velocity=delay(0.05)), {"delay": 0.05}),
    "sensor_lag": (Truth(velocity=lag(0.05)), {"time": 0.05}),
}
