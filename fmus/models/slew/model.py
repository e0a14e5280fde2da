"""The slew drive as a grey box of two chambers, fitted to the slew traces; equations: README.md.

States are the slew angle and speed, the two chamber pressures, the spool and the lagged pressure difference
of the relief valves.  The joystick arrives one transport delay late; the brake is a mode with timers.
"""

from typing import Any

from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals
from fmus.equations import slew_drive

STEP = (
    0.002  # s: halving it moves a full-joystick run by less than 0.001 °/s (tests/fmus/models/test_slew.py)
)
NOMINAL_PRESSURE = 1e7  # Pa


def _rates(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    flows = slew_drive.flows(x.spool, x.relief, x.p_a, x.p_b, p)
    p_a_rate, p_b_rate = slew_drive.pressure_rates(flows, x.p_a, x.p_b, x.qd, p)
    torque = slew_drive.torque(x.p_a, x.p_b, x.qd, u.inertia, m.brake_is_released, p)
    torque += u.disturbance_torque_slew - u.inertia_rate * x.qd
    return {
        "q": x.qd,
        "qd": torque / (u.inertia + p.slew_inertia_extra),
        "p_a": p_a_rate,
        "p_b": p_b_rate,
        "spool": slew_drive.spool_rate(u.u_slew, x.spool, p),
        "relief": slew_drive.relief_rate(x.p_a, x.p_b, x.relief, p),
    }


def _outputs(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    return {
        "q_slew": x.q,
        "qd_slew": x.qd,
        "p_slew_a": x.p_a,
        "p_slew_b": x.p_b,
        "brake_released": m.brake_is_released,
    }


def _start(p: Namespace) -> dict[str, Any]:
    rest = {"q": p.start_q_slew, "p_a": p.slew_boost_pressure, "p_b": p.slew_boost_pressure}
    return rest | {"qd": 0.0, "spool": 0.0, "relief": 0.0}


def _brake(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> Any:
    return slew_drive.brake(x.qd, 0.0, p)


# Where effects attach (reconcile/README.md).  Of each phenomenon its size is doubted; the shapes of its
# curves, knees and valve settings are the design's.  REACH: the inertia by the squared radius of the arm tip,
# I = 41.6 t m2 + 3506 kg r2: least squares over the working range, tool empty (kinematics.inertia_z).
REACH = (41.6e3, 3506.0)
PORTS = {
    "slew": {
        "velocity": "qd",
        "position": "q",
        "unit": "N.m",
        "input": "disturbance_torque_slew",
        "upright": True,
        "reach2": lambda x, u, m, p: (u.inertia - REACH[0]) / REACH[1],
        "reach2_rate": lambda x, u, m, p: u.inertia_rate / REACH[1],
        "has": ("coulomb_friction", "viscous_friction", "pose_dependent_inertia"),
    },
    "oil": {
        "kind": "hydraulic",
        "pressures": ("p_a", "p_b"),
        "stiffness": lambda x, u, m, p: p.slew_bulk_modulus / p.slew_chamber_volume,
        "return": "slew_boost_pressure",
        "outlet": "slew_outlet_flow",
        "opening": lambda x, u, m, p: slew_drive.opening(x.spool, p),
        "supply": ("slew_cut_off_low", "slew_cut_off_high"),
        "flow": ("slew_inlet_flow",),
        "demand": "inertia_rate",
        "viscous": ("slew_friction_viscous",),
        "axis": "slew",
        "brake": _brake,
        "released": "brake_is_released",
        "difference": "relief",
        "has": ("internal_leakage",),
    },
    "u_slew": {"kind": "input", "has": ("input_dead_zone", "input_delay", "input_lag")},
    "encoder": {"kind": "outputs", "outputs": ("q_slew", "qd_slew")},
    "parameters": {
        "kind": "parameters",
        "doubtful": (
            "slew_delay",
            "slew_dead_band",
            "slew_spool_lag",
            "slew_inlet_flow",
            "slew_cut_off_high",
            "slew_leak_internal",
            "slew_leak_external",
            "slew_stop_flow",
            "slew_friction_viscous",
            "slew_friction_dry",
        ),
    },
}

MODEL = Model(
    name="slew",
    description="Hydraulic slew drive with two chambers, torque-limited supply and a binary brake",
    kind="continuous",
    step=STEP,
    states=(
        Variable("q", "rad", "Slew angle"),
        Variable("qd", "rad/s", "Slew speed", nominal=0.1),
        Variable(
            "p_a", "Pa", "Pressure of the chamber that drives positive motion", nominal=NOMINAL_PRESSURE
        ),
        Variable(
            "p_b", "Pa", "Pressure of the chamber that drives negative motion", nominal=NOMINAL_PRESSURE
        ),
        Variable("spool", "1", "Spool opening, positive towards chamber a"),
        Variable("relief", "Pa", "Pressure difference that the relief valves see", nominal=NOMINAL_PRESSURE),
    ),
    inputs=from_signals("u_slew", "inertia", "inertia_rate", "disturbance_torque_slew"),
    outputs=from_signals("q_slew", "qd_slew", "p_slew_a", "p_slew_b", "brake_released"),
    parameters=(
        *(v for v in from_parameters("geometry") if v.name == "start_q_slew"),
        *from_parameters("slew"),
    ),
    rhs=_rates,
    out=_outputs,
    initial=_start,
    modes=(slew_drive.BRAKE,),
    delays={"u_slew": "slew_delay"},
)
