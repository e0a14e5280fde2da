"""Physics of the machine: power balance, rest, the tool's free swing, the order of the integrator."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from fmus.equations import multibody
from fmus.models.machine import dynamics, energy
from fmus.models.machine.model import MODEL
from fmus.toolchain.stepper import Stepper
from records.record import Record
from verification.dossier.machine import JOINTS, Bench

REST_S, SWING_S, BALANCE_S = 60.0, 40.0, 12.0
LOADS = {"empty": 0.0, "2 t": 2000.0}
PUSH_N, PUSH_S = 300.0, 0.5
HELD_KNEE = 1e-4  # rad/s: a brake that hardly creeps, so that the tool swings from a fixed point
ORDER_STEPS = (1e-3, 5e-4, 2.5e-4)  # s
FINEST = 6.25e-5  # s, the reference of the order
SMOOTH = {"u_slew": 0.6, "u_boom": 0.5, "u_stick": -0.4}
DESIGNED_ORDER = 2


def power_balance() -> dict[str, Any]:
    """Move all three functions for 12 s and add up where the pump's energy went (J)."""
    stepper = Stepper(MODEL, {"load_mass": 1000.0})
    x, u, m = [], [], []
    for _ in range(round(BALANCE_S / stepper.step_s) + 1):
        stepper.set(**_moves(stepper.time))
        x.append(stepper.x.copy())
        u.append(stepper.u.copy())
        m.append(stepper.m.copy())
        stepper.advance()
    columns = [np.array(rows).T for rows in (x, _late(u, stepper), m)] + [np.tile(stepper.p[:, None], len(x))]
    found = (np.array(r).ravel() for r in energy.balance(MODEL).map(len(x))(*columns))
    powers = dict(zip(energy.NAMES, found, strict=True))
    sums = {n: cumulative_trapezoid(powers[n], dx=stepper.step_s, initial=0.0) for n in energy.NAMES[:-1]}
    mechanical = powers["mechanical"] - powers["mechanical"][0]
    rest = sums["supply"] - sums["valves"] - sums["friction"] - sums["oil"] - mechanical
    return {
        **{f"{n}_j": float(s[-1]) for n, s in sums.items()},
        "mechanical_j": float(mechanical[-1]),
        "mechanical_swing_j": float(np.ptp(mechanical)),
        "largest_gap_j": float(np.abs(rest).max()),
        "gap_share_of_supply": float(np.abs(rest).max() / sums["supply"][-1]),
        "gap_share_of_mechanical": float(np.abs(rest).max() / np.ptp(mechanical)),
    }


def _moves(time: float) -> dict[str, float]:
    """Commands that start, reverse and stop every function."""
    slew = 0.7 if 1 <= time < 5 else -0.5 if 7 <= time < 9 else 0.0
    boom = 0.5 if 0.5 <= time < 3 else -0.5 if 4 <= time < 6 else 0.0
    stick = 0.6 if 2 <= time < 4 else -0.6 if 6 <= time < 8 else 0.0
    return {"u_slew": slew, "u_boom": boom, "u_stick": stick}


def _late(u: Sequence[np.ndarray], stepper: Stepper) -> np.ndarray:
    """Inputs as the equations see them: delayed ones late by whole steps."""
    rows = np.array(u)
    for name, parameter in MODEL.delays.items():
        i = MODEL.index("inputs", name)
        back = int(stepper.p[MODEL.index("parameters", parameter)] / stepper.step_s + 0.5)
        rows[:, i] = np.concatenate([np.full(back, rows[0, i]), rows[:, i]])[: len(rows)]
    return rows


def drift(bench: Bench) -> dict[str, dict[str, float]]:
    """Largest movement (rad) of each joint in 60 s at rest with all inputs neutral, empty and with 2 t."""
    found = {}
    for name, load in LOADS.items():
        record = bench.run(REST_S, parameters={"load_mass": load})
        angles = {j: record.column(f"true_q_{j}") for j in JOINTS}
        found[name] = {j: float(np.abs(a - a[0]).max()) for j, a in angles.items()}
    return found


def free_swing(bench: Bench) -> tuple[dict[str, dict[str, float]], dict[str, Record]]:
    """Period (s) and decay (1/s) of the tool after a push, against its parameters; and the records."""
    found, records = {}, {}
    for joint, axis, name in (("tool_y", "x", "pitch"), ("tool_x", "y", "roll")):
        force = f"disturbance_force_tool_{axis}"
        push = {1.0: {force: PUSH_N}, 1.0 + PUSH_S: {force: 0.0}}
        records[name] = bench.run(SWING_S, push)
        as_is = _swing(records[name], joint)
        held = _swing(bench.run(SWING_S, push, {"slew_brake_knee": HELD_KNEE}), joint)
        found[name] = held | {"decay_as_is_1_s": as_is["decay_1_s"]} | expected_swing(name)
    return found, records


def expected_swing(joint: str, values: Mapping[str, float] | None = None) -> dict[str, float]:
    """Small swing of the hanging tool by its parameters: I q'' + d I q' + m g l q = 0; I / (m l) long."""
    p = SimpleNamespace(**{v.name: v.start for v in MODEL.parameters} | dict(values or {}))
    mass, first, _ = multibody.tool_moments(p)
    pitch, roll = dynamics.tool_inertias(p)
    inertia, moment, damping = {
        "pitch": (pitch, mass * p.grab_offset + first, p.grab_damping_pitch),
        "roll": (roll, first, p.grab_damping_roll),
    }[joint]
    rate = math.sqrt(p.gravity * moment / inertia - (damping / 2) ** 2)
    return {
        "period_expected_s": 2 * math.pi / rate,
        "decay_expected_1_s": damping / 2,
        "length_m": inertia / moment,
    }


def _swing(record: Record, joint: str) -> dict[str, float]:
    """Period from zero crossings, decay from the peaks between them, once the push is over."""
    rows = record.time > 1.0 + 2 * PUSH_S
    time, angle = np.asarray(record.time[rows]), record.column(f"true_q_{joint}")[rows]
    angle = angle - np.mean(angle[-len(angle) // 4 :])
    at = np.flatnonzero(angle[:-1] * angle[1:] < 0)
    crossings = time[at] - angle[at] * (time[at + 1] - time[at]) / (angle[at + 1] - angle[at])
    peaks = np.array([np.abs(angle[a : b + 1]).max() for a, b in pairwise(at)])
    middles = (crossings[:-1] + crossings[1:]) / 2
    return {
        "period_s": float(2 * np.polyfit(np.arange(len(crossings)), crossings, 1)[0]),
        "decay_1_s": float(-np.polyfit(middles, np.log(peaks), 1)[0]),
        "largest_deg": float(np.degrees(np.abs(angle).max())),
    }


def order() -> dict[str, Any]:
    """Error after 0.5 s of smooth motion of all joints, by internal step, and the observed order."""
    parameters = {"load_mass": 1000.0}
    start = Stepper(MODEL, parameters)
    start.set(**SMOOTH)
    start.advance(round(2.0 / start.step_s))
    exact = _smooth_end(start, parameters, FINEST)
    scale = np.array([v.nominal or 1.0 for v in MODEL.states])
    errors = [float(np.linalg.norm((_smooth_end(start, parameters, h) - exact) / scale)) for h in ORDER_STEPS]
    slope = np.polyfit(np.log(ORDER_STEPS), np.log(errors), 1)[0]
    return {"steps_s": list(ORDER_STEPS), "errors": errors, "order": float(slope), "designed": DESIGNED_ORDER}


def _smooth_end(start: Stepper, parameters: Mapping[str, float], step: float) -> np.ndarray:
    """State 0.5 s after that of `start`, commands unchanged, so without delays."""
    stepper = Stepper(MODEL, {**parameters, **dict.fromkeys(MODEL.delays.values(), 0.0)}, step)
    stepper.x, stepper.m = start.x.copy(), start.m.copy()
    stepper.set(**SMOOTH)
    stepper.advance(round(0.5 / step))
    return stepper.x
