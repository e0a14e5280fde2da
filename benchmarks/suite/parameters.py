"""The generator's parameters in the names and units of a report: one table, by effect.

A parameter of a report that the table does not have is not judged: what has no true value of its own (the
stiffness of a stop or a gap, which only has to be large), and what is nothing in the truth.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from specs import parameters as spec_parameters


@dataclass(frozen=True)
class Setting:
    """Where an effect acts: inertia there (kg.m2), the true base parameters, what it is told."""

    inertia: float
    base: Mapping[str, float]
    subsystem: str
    effect: Mapping[str, Any]  # as reported


Given = Mapping[str, float]
Row = dict[str, Callable[[Given, Setting], float]]


def _same(*names: str) -> Row:
    return {name: (lambda v, s, name=name: v[name]) for name in names}


def _as(**theirs: str) -> Row:
    """report's name = generator's name"""
    return {name: (lambda v, s, own=own: v[own]) for name, own in theirs.items()}


def _any(*names: str) -> Row:
    """Of an effect with several forms: what the one that was put in has."""
    return {name: (lambda v, s, name=name: v.get(name, 0.0)) for name in names}


def _side(v: Given, s: Setting) -> float:
    """A stop at ±position, reported as one of its sides."""
    reported = s.effect["parameters"]["position"]["value"]
    return v["position"] if reported >= 0.0 else -v["position"]


SHAFT_SHARE = 0.3  # of the inertia that the generator puts before a shaft or gap
STOP_DAMPING = 0.3  # of the generator's stops, by the root of stiffness times inertia
FULL_DEMAND = 30e3  # kg.m2/s: what the arm takes at this rate of the inertia is the whole share
WARMING_S = 15.0

TABLE: dict[str, Row] = {
    "input_dead_zone": _same("half_width") | _as(high="half_width", low="half_width"),
    "input_delay": _same("delay"),
    "input_lag": _as(time="lag"),
    "input_saturation": _same("limit"),
    "input_rate_limit": _same("rate"),
    "input_backlash": _same("gap"),
    "input_hysteresis": _as(full_width="width") | {"share": lambda v, s: 0.5},
    "asymmetric_gain": {"difference": lambda v, s: 2.0 * v["asymmetry"]},
    "input_offset": _same("offset"),
    "input_crosstalk": _same("share"),
    "valve_flow_curve": _same("curve"),
    "coulomb_friction": _same("Fc"),
    "asymmetric_coulomb_friction": _as(Fc_positive="Fc_plus", Fc_negative="Fc_minus"),
    "stribeck_friction": _same("Fs", "Fc", "vs"),
    "viscous_friction": _same("b"),
    # a model with viscous friction of its own takes up what both sides share
    "asymmetric_viscous_friction": {"b_positive - b_negative": lambda v, s: v["b_plus"] - v["b_minus"]},
    "load_dependent_friction": _same("mu"),
    "quadratic_drag": _as(k="c"),
    "presliding_hysteresis": _same("Fc") | {"distance": lambda v, s: v["Fc"] / v["sigma"]},
    "constant_load": _as(load="F0"),
    "gravity_load": _as(torque="G", torque_sin="G") | {"torque_cos": lambda v, s: 0.0},
    "stiffness": _same("k"),
    "cubic_stiffness": _same("k3"),
    "torque_ripple": _same("sine", "cosine") | _as(waves="order"),
    "end_stop": {"position": _side},
    "pose_dependent_inertia": {"cosine": lambda v, s: v["alpha"] * s.inertia},
    "structural_compliance": _same("k", "c") | {"share": lambda v, s: SHAFT_SHARE},
    "gear_backlash": _same("gap") | {"share": lambda v, s: SHAFT_SHARE},
    "sensor_bias": _same("bias"),
    "sensor_scale": _as(error="scale"),
    "sensor_delay": _same("delay"),
    "sensor_lag": _as(time="lag"),
    "sensor_backlash": _same("gap"),
    "sensor_drift": _as(rate="drift"),
    "clock_drift": _same("drift"),
    "cross_axis_misalignment": _same("angle"),
    "coriolis_coupling": _same("factor"),
    "centrifugal_coupling": _same("factor"),
    "euler_coupling": _same("factor"),
    "wind_load": _any("a_x", "a_y", "k", "wind"),
    "supply_pressure_sag": _same("sag"),
    "shared_pump_flow": _same("share") | {"full": lambda v, s: FULL_DEMAND},
    "temperature_dependent_viscosity": _same("fall") | {"time": lambda v, s: WARMING_S},
    "counterbalance_drop": _same("pressure"),
    "compressibility": _as(pressure="air"),
    "brake_engagement": _as(time="lag"),
    "relief_limit": {"limit": lambda v, s: s.base["slew_relief_pressure"] - v["below"]},
    "payload_mass": _same("mass"),
    "pendulum_length_change": _same("rate"),
    "slope_torque": _as(torque_sin="sine", torque_cos="cosine"),
}


def expected(
    placed: Mapping[str, Any], effect: Mapping[str, Any], truth: Mapping[str, Any]
) -> dict[str, float]:
    """True values of the parameters of a reported effect under the report's names, in its units.

    `placed` and `truth` as sealed, `effect` as reported.  A name "a - b" stands for the difference of two.
    """
    setting = Setting(_inertia(placed, truth), truth["base"], placed["subsystem"], effect)
    found = {}
    for name, value in TABLE.get(placed["name"], {}).items():
        if all(part in effect["parameters"] for part in name.split(" - ")):
            true = value(placed["parameters"], setting) * _unit(name, effect, placed, truth, setting.inertia)
            if true != 0.0:
                found[name] = true
    return found


def _inertia(placed: Mapping[str, Any], truth: Mapping[str, Any]) -> float:
    if placed["subsystem"] in ("roll", "pitch"):
        geometry = spec_parameters.load("geometry")
        mass = geometry["tool_mass"].value + geometry["load_mass"].value
        return mass * truth["base"]["tool_length_" + "xy"[placed["subsystem"] == "pitch"]] ** 2
    scale = truth["scale"]
    part = "arm" if placed["subsystem"] in ("boom", "stick") else "slew"
    return scale.get("parts", {}).get(part, scale)["inertia"]


def _unit(
    name: str, effect: Mapping[str, Any], placed: Mapping[str, Any], truth: Mapping[str, Any], inertia: float
) -> float:
    """Factor from the generator's unit: torques and accelerations are either's at will.

    The generator's forces on the tool are accelerations, on all else torques.
    """
    unit = effect["parameters"][name.split(" - ")[0]]["unit"]
    if placed["subsystem"] in ("roll", "pitch"):
        return inertia if unit.startswith("N.m") else 1.0
    if placed["name"] == "pose_dependent_inertia":
        return 1.0 if unit == "kg.m2" else 1.0 / inertia
    return 1.0 / inertia if unit.startswith("rad/s2") else 1.0
