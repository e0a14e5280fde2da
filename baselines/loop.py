"""The slew loop of any controller, linearised: margins, sensitivity, delay margin, and whether it is stable.

The controller is linearised by its own CasADi Jacobians near its target, outside of its rest band; the drive
where it turns slowly, outside of its dead band, as in `baselines.analysis`: dead band and its compensation
are both left out.  The tool swings as the nominal pendulum.  The loop is cut at the joystick:

    L = -(du_slew / d sensors)(z)  sensors(s)  drive(s) e^{-s dead time}  hold

Margins say how far from unstable a loop is, not on which side: that is told by the eigenvalues of the sampled
loop as a whole (`growth` a step).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import casadi as ca
import numpy as np
from scipy.linalg import expm

from baselines import analysis
from baselines.analysis import FREQUENCIES, Margins, Plant
from baselines.gains import limits
from baselines.registry import Controller
from fmus.definition import Model
from fmus.equations import kinematics
from fmus.toolchain.discrete import DiscreteStepper
from fmus.toolchain.loader import load_model
from specs import parameters
from specs.errors import InputError, nearest

ERROR = 0.03  # rad from the target: where controllers are linearised
ROLL = 0.15  # rad: swing outside of the dead zones of sway feedback
SETTLE_S = 5.0  # for the controller's own states
JOYSTICK = 0.25  # at which the drive turns slowly
NEUTRAL = 1e-6  # eigenvalues this near to 1 belong to what is only remembered
POSES = {  # name: boom, stick (rad), load (kg), told
    "near, empty": (1.35, -2.1, 0.0),
    "middle, empty": (1.3, -1.9, 0.0),
    "middle, 2 t": (1.3, -1.9, 2000.0),
    "far, 2 t": (0.9, -0.7, 2000.0),
}


@dataclass(frozen=True)
class Loop:
    """The loop at one point; `sensitivity` is the largest |1/(1+L)|, `growth` the largest |eigenvalue|."""

    margins: Margins
    sensitivity: float
    growth: float
    inertia: float  # kg m2

    @property
    def stable(self) -> bool:
        return self.growth < 1.0

    def as_dict(self) -> dict[str, float | bool]:
        """For JSON."""
        m = self.margins
        return {
            "inertia": self.inertia,
            "gain_db": m.gain_db,
            "phase_deg": m.phase_deg,
            "delay_s": m.delay_s,
            "crossover_rad_s": m.crossover_rad_s,
            "sensitivity": self.sensitivity,
            "growth": self.growth,
            "stable": self.stable,
        }


def analyse(
    controller: Controller, gains: Mapping[str, float] | None = None, later_s: float = 0.0
) -> dict[str, Loop]:
    """The loop of a controller at every pose, with `gains` over its own and `later_s` more dead time.

    Raises InputError for a controller that has no linear loop, or a gain that it does not have.
    """
    if controller.linear:
        raise InputError(f"controller {controller.name} has no linear loop: {controller.linear}")
    model = load_model(controller.folder)
    values = {**controller.settings, **(gains or {})}
    known = {v.name: v for v in model.parameters}
    for name, value in values.items():
        if name not in known:
            raise InputError(f"{controller.name}: no parameter '{name}'; {nearest(name, known)}")
        low, high = limits(known[name])
        if not low <= value <= high:
            raise InputError(f"parameter {name} = {value:g}: outside {low:g} … {high:g}")
    return {name: _loop(model, values, pose, later_s) for name, pose in POSES.items()}


def _loop(
    model: Model, values: Mapping[str, float], pose: tuple[float, float, float], later_s: float
) -> Loop:
    inertia = float(kinematics.inertia_z(*pose, kinematics.geometry()))
    radius, _ = kinematics.arm_tip(*pose[:2], kinematics.geometry())
    plant = _plant(inertia)
    plant = replace(plant, dead_s=plant.dead_s + later_s)
    a, b, c = linear_controller(model, values, pose)
    response = -_response(a, b, c, plant, float(radius)) * np.exp(-1j * FREQUENCIES * analysis.STEP / 2)
    return Loop(
        margins=analysis.margins(response, FREQUENCIES),
        sensitivity=float(np.max(1 / np.abs(1 + response))),
        growth=_growth(a, b, c, plant, float(radius)),
        inertia=inertia,
    )


@cache
def _plant(inertia: float) -> Plant:
    return analysis.slew_plant(inertia, JOYSTICK)


def linear_controller(
    model: Model, values: Mapping[str, float], pose: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(A, B, C) a step: states to states, SENSORS to states, states to u_slew, near the target."""
    compensation = {n: 0.0 for n in ("control_dead_band",) if n in {v.name for v in model.parameters}}
    stepper = DiscreteStepper(model, {**values, **compensation})
    stepper.set(**_near_target(pose))
    stepper.advance(round(SETTLE_S / model.step))
    if "band" in {v.name for v in model.states}:
        stepper.x[model.index("states", "band")] = 0.0
    if "imu_tool_roll" in {v.name for v in model.inputs}:
        stepper.set(imu_tool_roll=ROLL)
    x, u, m, p = model.symbols
    columns = [model.index("inputs", n) if n in {v.name for v in model.inputs} else None for n in SENSORS]
    by_input = ca.jacobian(model.f(x, u, m, p), u)
    b = ca.horzcat(*(ca.SX(len(model.states), 1) if i is None else by_input[:, i] for i in columns))
    c = ca.jacobian(model.h(x, u, m, p)[model.index("outputs", "u_slew")], x)
    at = ca.Function(
        "abc", [x, u, m, p], [ca.densify(e) for e in (ca.jacobian(model.f(x, u, m, p), x), b, c)]
    )
    return tuple(np.array(e) for e in at(stepper.x, stepper.u, [], stepper.p))  # type: ignore[return-value]


def _near_target(pose: tuple[float, float, float]) -> dict[str, float]:
    g = kinematics.geometry()
    point = kinematics.grab_point(ERROR, *kinematics.arm_tip(*pose[:2], g), g)
    target = dict(zip(("target_x", "target_y", "target_z"), map(float, point), strict=True))
    return {**target, "q_boom": pose[0], "q_stick": pose[1], "load_told": pose[2], "pace": 1.0}


def _pendulum() -> tuple[float, float, float]:
    """(length m, damping 1/s, gravity m/s2) of the nominal tool's roll."""
    known = parameters.load("geometry", "tool")
    return known["tool_length_x"].value, known["tool_damping_x"].value, known["gravity"].value


def _roll(s: np.ndarray, radius: float) -> np.ndarray:
    """Roll of the tool over slew acceleration."""
    length, damping, gravity = _pendulum()
    return -radius / (length * s * s + damping * length * s + gravity)


SENSORS: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {  # over the slew angle: s, radius
    "q_slew": lambda s, radius: np.ones_like(s),
    "imu_cabin_rate_z": lambda s, radius: s,
    "imu_tool_roll": lambda s, radius: s * s * _roll(s, radius),
    "imu_tool_rate_x": lambda s, radius: s**3 * _roll(s, radius),
}


def _response(a: np.ndarray, b: np.ndarray, c: np.ndarray, plant: Plant, radius: float) -> np.ndarray:
    """Joystick back to joystick, at FREQUENCIES."""
    s = 1j * FREQUENCIES
    sensed = np.array([sensor(s, radius) for sensor in SENSORS.values()]) * plant.response
    z = np.exp(s * analysis.STEP)
    eye = np.eye(len(a))
    return np.array([(c @ np.linalg.solve(zk * eye - a, b @ sensed[:, k]))[0] for k, zk in enumerate(z)])


def _growth(a: np.ndarray, b: np.ndarray, c: np.ndarray, plant: Plant, radius: float) -> float:
    """Largest |eigenvalue| of the sampled loop, but for what is only remembered (eigenvalues of 1)."""
    ad, bd, output = _sampled(plant, radius)
    late = round(plant.dead_s / analysis.STEP)
    n, m = len(a), len(ad)
    whole = np.zeros((n + m + late, n + m + late))
    whole[:n, :n], whole[:n, n : n + m] = a, b @ output
    whole[n : n + m, n : n + m] = ad
    line = n + m
    if late:
        whole[n : n + m, -1:] = bd
        whole[line : line + 1, :n] = c
        whole[line + 1 :, line:-1] = np.eye(late - 1)
    else:
        whole[n : n + m, :n] = bd @ c
    eigenvalues = np.linalg.eigvals(whole)
    return float(max(abs(eigenvalues[abs(eigenvalues - 1.0) > NEUTRAL])))


def _sampled(plant: Plant, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(A, B, outputs of SENSORS) of drive and pendulum over a step with the joystick held."""
    a, b, c = (np.asarray(e) for e in (plant.system.A, plant.system.B, plant.system.C))
    length, damping, gravity = _pendulum()
    n = len(a)
    rate = c @ a  # of the angle: the speed
    turn = rate @ a  # acceleration by the states; the joystick does not reach it at once
    whole = np.zeros((n + 3, n + 3))
    whole[:n, :n], whole[:n, -1:] = a, b
    whole[n, n + 1] = 1.0
    whole[n + 1, :n] = -radius / length * turn
    whole[n + 1, n : n + 2] = -gravity / length, -damping
    step = expm(whole * analysis.STEP)
    rows = np.zeros((len(SENSORS), n + 2))
    rows[0, :n], rows[1, :n], rows[2, n], rows[3, n + 1] = c, rate, 1.0, 1.0
    return step[:-1, :-1], step[:-1, -1:], rows
