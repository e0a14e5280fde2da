"""The load estimate as a discrete model for the control core: the same balance, tick by tick.

While boom and stick stand (a piston slower than `load_estimate_still_speed` for the settling time), y and h
of `balance.rows` are averaged over at most a window, and

    load = sum h y / sum h^2     over both joints, kg

In motion, and until half a window has been seen, the last estimate is kept; -1 before the first.  The slew
may turn: w^2 r is in the balance.  Rates are from a filtered difference (arm) and the gyros (slew, tool); of
the accelerations only the tool's is in it.  The interval that `estimate.py` gives is not computed here.
"""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import casadi as ca

from baselines.load.balance import JOINTS, Seen, figures, rows, unknowns
from fmus.definition import Model, Namespace, Variable, from_signals
from fmus.equations import cylinder
from fmus.models.machine import arm_hydraulics

STEP = 0.02  # s
LAG = 0.2  # s, of the filters that give rates
ANGLES = ("q_boom", "q_stick")
PRESSURES = ("p_boom_a", "p_boom_b", "p_stick_a", "p_stick_b")
NONE = -1.0  # kg: no estimate yet
LARGEST = 4000.0  # kg, of the signal


def model(calibration: Mapping[str, float] | None = None) -> Model:
    """The model, with the unknowns of a calibration by name (default: their nominal values)."""
    found = SimpleNamespace(**({u.name: u.value for u in unknowns()} | dict(calibration or {})))
    return Model(
        name="load",
        description="Load in the grab from boom and stick pressures while the arm stands",
        kind="discrete",
        step=STEP,
        states=(
            *(Variable(f"slow_{j}", "rad", "Filtered angle") for j in JOINTS),
            *(Variable(f"still_{j}", "s", "For so long the piston has stood") for j in JOINTS),
            *(Variable(f"way_{j}", "1", "Which way it last moved") for j in JOINTS),
            *(Variable(f"tool_rate_{a}", "rad/s", "Filtered rate of the tool") for a in "xy"),
            Variable("started", "1", "1 after the first step"),
            Variable("seen", "s", "Averaged over so long"),
            *(Variable(f"mean_{n}", "1", "Mean of h y, of h^2") for n in ("hy", "hh")),
            Variable("load", "kg", "Last estimate", start=NONE),
        ),
        inputs=from_signals(
            *("q_slew", *ANGLES, *PRESSURES, "imu_cabin_rate_z", "imu_cabin_pitch", "imu_cabin_roll"),
            *("imu_tool_pitch", "imu_tool_roll", "imu_tool_rate_x", "imu_tool_rate_y"),
        ),
        outputs=from_signals("load_estimate"),
        parameters=(),
        rhs=lambda x, u, m, p: _next_state(x, u, found),
        out=lambda x, u, m, p: {"load_estimate": x.load},
    )


def _next_state(x: Namespace, u: Namespace, found: Namespace) -> dict[str, Any]:
    g, started = figures(), x.started > 0.5
    arm = {j: _joint(j, x, u, started) for j in JOINTS}
    rates = {
        a: ca.if_else(started, getattr(x, f"tool_rate_{a}"), getattr(u, f"imu_tool_rate_{a}")) for a in "xy"
    }
    standing = [arm[j][f"still_{j}"] >= g.load_estimate_settling for j in JOINTS]
    hy, hh = _balance(x, u, arm, rates, found)
    steady = standing[0] * standing[1] * _calm(u)
    seen = steady * ca.fmin(x.seen + STEP, g.load_estimate_window)
    share = STEP / ca.fmax(seen, STEP)
    mean_hy = x.mean_hy * (x.seen > 0) + share * (hy - x.mean_hy * (x.seen > 0))
    mean_hh = x.mean_hh * (x.seen > 0) + share * (hh - x.mean_hh * (x.seen > 0))
    load = ca.fmin(ca.fmax(mean_hy / ca.fmax(mean_hh, 1.0), 0.0), LARGEST)
    return {
        **{name: value for joint in arm.values() for name, value in joint.items()},
        **{
            f"tool_rate_{a}": r + STEP / LAG * (getattr(u, f"imu_tool_rate_{a}") - r)
            for a, r in rates.items()
        },
        "started": 1.0,
        "seen": seen,
        "mean_hy": steady * mean_hy,
        "mean_hh": steady * mean_hh,
        "load": ca.if_else(seen >= g.load_estimate_window / 2, load, x.load),
    }


def _joint(joint: str, x: Namespace, u: Namespace, started: Any) -> dict[str, Any]:
    """Next filter, standing time and direction of a joint's cylinder."""
    g, q = figures(), getattr(u, f"q_{joint}")
    slow = ca.if_else(started, getattr(x, f"slow_{joint}"), q)
    lever = cylinder.lever(q, arm_hydraulics.parameters(g, joint))
    speed = lever * (q - slow) / LAG  # m/s, of the piston
    stands = ca.fabs(speed) < g.load_estimate_still_speed
    return {
        f"slow_{joint}": slow + STEP / LAG * (q - slow),
        f"still_{joint}": stands * (getattr(x, f"still_{joint}") + STEP),
        f"way_{joint}": ca.if_else(stands, getattr(x, f"way_{joint}"), ca.sign(speed)),
    }


def _calm(u: Namespace) -> Any:
    """1 where the tool does not swing too far."""
    g = figures()
    angles, rates = (u.imu_tool_pitch, u.imu_tool_roll), (u.imu_tool_rate_x, u.imu_tool_rate_y)
    inside = [ca.fabs(a) < g.load_estimate_swing_angle for a in angles]
    inside += [ca.fabs(r) < g.load_estimate_swing_rate for r in rates]
    return inside[0] * inside[1] * inside[2] * inside[3]


def _balance(
    x: Namespace, u: Namespace, arm: dict[str, Any], rates: dict[str, Any], found: Namespace
) -> tuple[Any, Any]:
    """(h y, h^2) of this moment, summed over the joints."""
    turns = {a: (getattr(u, f"imu_tool_rate_{a}") - rates[a]) / LAG for a in "xy"}  # rad/s2, about LAG late
    seen = Seen(
        q=ca.vertcat(u.q_slew, u.q_boom, u.q_stick, u.imu_tool_pitch, u.imu_tool_roll),
        v=ca.vertcat(u.imu_cabin_rate_z, 0.0, 0.0, u.imu_tool_rate_y, u.imu_tool_rate_x),
        a=ca.vertcat(0.0, 0.0, 0.0, turns["y"], turns["x"]),
        pressures=ca.vertcat(*(getattr(u, n) for n in PRESSURES)),
        tilt=ca.vertcat(u.imu_cabin_pitch, u.imu_cabin_roll),
        sliding=ca.vertcat(0.0, 0.0),
        direction=ca.vertcat(*(arm[j][f"way_{j}"] for j in JOINTS)),
    )
    y, h = rows(seen, found)
    return ca.dot(h, y), ca.dot(h, h)
