"""The free-swinging tool, exactly the paper's two pendulum equations with every term, at 0.02 s.

    wy[k+1] = wy[k] + dt ((dvx/dt cos(ty) - g sin(ty) - w_slew^2 r_y) / l_y - b_y wy)
    wx[k+1] = wx[k] + dt ((-dvy/dt cos(tx) - (g cos(ty) + wy^2 l_y) sin(tx)) / l_x - b_x wx)
    t[k+1]  = t[k] + dt w[k+1]

ty pitch (q_tool_y), tx roll (q_tool_x), wy and wx their rates, dv the change of the suspension's velocity in
one step (v_x = radius_rate, v_y = qd_slew radius), r_y = radius - l_y sin(ty).  The paper prints the two rate
equations only; the angles are integrated with the new rates, which keeps the undamped swing from growing.
Disturbances enter where gravity and dv stand.  Range of validity and what is left out: README.md.
"""

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals
from fmus.equations import kinematics

STEP = 0.02  # s
USED = {  # of specs/parameters/geometry.toml
    "gravity",
    "boom_foot_x",
    "boom_foot_z",
    "boom_length",
    "stick_length",
    "tool_mass",
    "load_mass",
    "start_q_slew",
    "start_q_boom",
    "start_q_stick",
}


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, ca.SX]:
    v_x, v_y = u.radius_rate, u.qd_slew * u.radius
    acceleration_x = (v_x - x.v_x) / STEP + _forced(u.disturbance_acc_x, u.disturbance_force_tool_x, p)
    acceleration_y = (v_y - x.v_y) / STEP + _forced(u.disturbance_acc_y, u.disturbance_force_tool_y, p)
    g = p.gravity + _forced(u.disturbance_acc_z, u.disturbance_force_tool_z, p)
    moment_y = u.disturbance_moment_tool_y / (_mass(p) * p.tool_length_y**2)
    moment_x = u.disturbance_moment_tool_x / (_mass(p) * p.tool_length_x**2)
    r_y = u.radius - p.tool_length_y * ca.sin(x.theta_y)
    pitch = acceleration_x * ca.cos(x.theta_y) - g * ca.sin(x.theta_y) - u.qd_slew**2 * r_y
    gravity = g * ca.cos(x.theta_y) + x.omega_y**2 * p.tool_length_y
    roll = -acceleration_y * ca.cos(x.theta_x) - gravity * ca.sin(x.theta_x)
    omega_y = x.omega_y + STEP * (pitch / p.tool_length_y - p.tool_damping_y * x.omega_y + moment_y)
    omega_x = x.omega_x + STEP * (roll / p.tool_length_x - p.tool_damping_x * x.omega_x + moment_x)
    theta_y, theta_x = x.theta_y + STEP * omega_y, x.theta_x + STEP * omega_x
    swing = {"theta_x": theta_x, "theta_y": theta_y, "omega_x": omega_x, "omega_y": omega_y}
    return swing | {"v_x": v_x, "v_y": v_y} | _point(theta_x, theta_y, u.q_slew, u.radius, u.height, p)


def _outputs(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, ca.SX]:
    return {
        "q_tool_x": x.theta_x,
        "q_tool_y": x.theta_y,
        "qd_tool_x": x.omega_x,
        "qd_tool_y": x.omega_y,
        "true_tool_x": x.point_x,
        "true_tool_y": x.point_y,
        "true_tool_z": x.point_z,
    }


def _start(p: Namespace) -> dict[str, ca.SX]:
    radius, height = kinematics.arm_tip(p.start_q_boom, p.start_q_stick, p)
    angles = {"theta_x": p.start_q_tool_x, "theta_y": p.start_q_tool_y}
    return angles | _point(p.start_q_tool_x, p.start_q_tool_y, p.start_q_slew, radius, height, p)


def _point(
    theta_x: ca.SX, theta_y: ca.SX, q_slew: ca.SX, radius: ca.SX, height: ca.SX, p: Namespace
) -> dict[str, ca.SX]:
    """Grab point in the machine base frame: pitch joint, the link l_y - l_x, roll joint, the length l_x."""
    arm = p.tool_length_y - p.tool_length_x + p.tool_length_x * ca.cos(theta_x)
    radial, tangential = radius - arm * ca.sin(theta_y), p.tool_length_x * ca.sin(theta_x)
    return {
        "point_x": radial * ca.cos(q_slew) - tangential * ca.sin(q_slew),
        "point_y": radial * ca.sin(q_slew) + tangential * ca.cos(q_slew),
        "point_z": height - arm * ca.cos(theta_y),
    }


def _forced(acceleration: ca.SX, force: ca.SX, p: Namespace) -> ca.SX:
    """A force on the tool acts as an acceleration of its suspension the other way."""
    return acceleration - force / _mass(p)


def _slew_acceleration(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> ca.SX:
    """rad/s2: the step's change of the slew rate; v_y of one step ago was the rate times the radius then."""
    return (u.qd_slew - x.v_y / (u.radius - STEP * u.radius_rate)) / STEP


def _radius_acceleration(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> ca.SX:
    """m/s2: the step's change of the suspension's radial velocity."""
    return (u.radius_rate - x.v_x) / STEP


def _mass(p: Namespace) -> ca.SX:
    return p.tool_mass + p.load_mass


# Where effects attach (reconcile/README.md).  A load changes a pendulum by its length alone; it has no drive.
OWN = ("viscous_friction", "gravity_load", "payload_mass", "pose_dependent_inertia", "torque_ripple")
PORTS = {
    "roll": {
        "velocity": "omega_x",
        "position": "theta_x",
        "unit": "N.m",
        "input": "disturbance_moment_tool_x",
        "has": OWN,
    },
    "pitch": {
        "velocity": "omega_y",
        "position": "theta_y",
        "unit": "N.m",
        "input": "disturbance_moment_tool_y",
        "has": OWN,
    },
    "pendulum": {
        "kind": "pendulum",
        "pitch": "pitch",
        "roll": "roll",
        "pitch_length": "tool_length_y",
        "roll_length": "tool_length_x",
        "slew": "q_slew",
        "slew_rate": "qd_slew",
        "slew_acceleration": _slew_acceleration,
        "radius": "radius",
        "radius_rate": "radius_rate",
        "radius_acceleration": _radius_acceleration,
        "height": "height",
        "gravity": "gravity",
    },
    "motion": {
        "kind": "inputs",
        "inputs": ("q_slew", "qd_slew", "radius", "radius_rate", "height"),
        "offsets": ("qd_slew", "radius_rate"),
    },
    "roll_sensor": {"kind": "outputs", "outputs": ("q_tool_x", "qd_tool_x")},
    "pitch_sensor": {"kind": "outputs", "outputs": ("q_tool_y", "qd_tool_y")},
    "tool_sensor": {
        "kind": "outputs",
        "outputs": ("q_tool_x", "q_tool_y", "qd_tool_x", "qd_tool_y"),
        "turned": (("q_tool_x", "q_tool_y"), ("qd_tool_x", "qd_tool_y")),
    },
    "parameters": {
        "kind": "parameters",
        "doubtful": ("tool_length_x", "tool_length_y", "tool_damping_x", "tool_damping_y"),
    },
}

MODEL = Model(
    name="tool",
    description="Free-swinging tool: the paper's damped pendulum on two decoupled joints",
    kind="discrete",
    step=STEP,
    states=(
        Variable("theta_x", "rad", "Roll"),
        Variable("theta_y", "rad", "Pitch"),
        Variable("omega_x", "rad/s", "Roll rate"),
        Variable("omega_y", "rad/s", "Pitch rate"),
        Variable("v_x", "m/s", "Radial velocity of the suspension one step ago"),
        Variable("v_y", "m/s", "Tangential velocity of the suspension one step ago"),
        Variable("point_x", "m", "Grab point, x in the machine base frame"),
        Variable("point_y", "m", "Grab point, y in the machine base frame"),
        Variable("point_z", "m", "Grab point, height above the ground"),
    ),
    inputs=from_signals(
        "q_slew",
        "qd_slew",
        "radius",
        "radius_rate",
        "height",
        "disturbance_acc_x",
        "disturbance_acc_y",
        "disturbance_acc_z",
        "disturbance_force_tool_x",
        "disturbance_force_tool_y",
        "disturbance_force_tool_z",
        "disturbance_moment_tool_x",
        "disturbance_moment_tool_y",
    ),
    outputs=from_signals(
        "q_tool_x", "q_tool_y", "qd_tool_x", "qd_tool_y", "true_tool_x", "true_tool_y", "true_tool_z"
    ),
    parameters=(
        *(v for v in from_parameters("geometry") if v.name in USED),
        *from_parameters("tool"),
    ),
    rhs=_next_state,
    out=_outputs,
    initial=_start,
)
