"""Reference machine: 40 t material handler, five joints, hydraulics on three of them, one pump, sensors.

Stands in for the real machine, of which no recordings are public; equations and sources: README.md.

    M(q) q'' + c(q, q') = torques          fmus/equations/multibody.py    slew, boom, stick, tool pitch, roll
    p' = bulk / V (flows - volume rate)    fmus/equations/cylinder.py     boom, stick
                                           fmus/equations/slew_drive.py   slew motor with its brake
    p_pump' = bulk / V (pump - demands)    fmus/models/machine/arm_hydraulics.py

Angles rad, pressures Pa (gauge), flows m3/s, torques N m.  Valid inside the joint limits of geometry.toml,
tool angles below 1.2 rad (at a roll of pi/2 the universal joint locks), loads of 0..2500 kg.
"""

from typing import Any

from fmus.definition import Model, Variable, from_parameters, from_signals
from fmus.equations import cylinder, multibody, slew_drive
from fmus.models.machine import arm_hydraulics, dynamics, sensors

Namespace = Any

STATES = (
    Variable("slew_angle", "rad", "Slew angle"),
    Variable("boom_angle", "rad", "Boom above horizontal"),
    Variable("stick_angle", "rad", "Stick to boom"),
    Variable("tool_pitch", "rad", "Tool about the slewing frame's y axis, 0 hanging"),
    Variable("tool_roll", "rad", "Tool about its roll axis, 0 hanging"),
    Variable("slew_rate", "rad/s", "Slew rate"),
    Variable("boom_rate", "rad/s", "Boom rate"),
    Variable("stick_rate", "rad/s", "Stick rate"),
    Variable("tool_pitch_rate", "rad/s", "Tool pitch rate"),
    Variable("tool_roll_rate", "rad/s", "Tool roll rate"),
    Variable("slew_spool", "1", "Slew spool"),
    Variable("slew_relief", "Pa", "Slew motor, pressure difference that its relief valves see", nominal=1e7),
    Variable("slew_pressure_a", "Pa", "Slew motor, side that drives positive motion", nominal=1e7),
    Variable("slew_pressure_b", "Pa", "Slew motor, other side", nominal=1e7),
    Variable("boom_spool", "1", "Boom spool"),
    Variable("boom_pressure_a", "Pa", "Boom cylinder, bore side", nominal=1e7),
    Variable("boom_pressure_b", "Pa", "Boom cylinder, rod side", nominal=1e7),
    Variable("stick_spool", "1", "Stick spool"),
    Variable("stick_pressure_a", "Pa", "Stick cylinder, bore side", nominal=1e7),
    Variable("stick_pressure_b", "Pa", "Stick cylinder, rod side", nominal=1e7),
    Variable("pump_pressure", "Pa", "Pump line", nominal=1e7),
)
STEP = 0.0005  # s: halving it moves the scenarios' metrics by less than 1 % (docs/results/dossier.md)
SERVES = 4  # steps with one Jacobian; the metrics hardly change (docs/decisions/machine-step.md)
COMMANDS = ("u_slew", "u_boom", "u_stick")
DISTURBANCES = tuple(
    f"disturbance_{n}"
    for n in (
        *("torque_slew", "torque_boom", "torque_stick", "force_tool_x", "force_tool_y", "force_tool_z"),
        *("moment_tool_x", "moment_tool_y", "acc_x", "acc_y", "acc_z"),
    )
)
OUTPUTS = tuple(
    [*sensors.declarations()]
    + [f"true_{q}_{j}" for j in ("slew", "boom", "stick", "tool_x", "tool_y") for q in ("q", "qd")]
    + [f"true_tool_{a}" for a in "xyz"]
    + [f"true_p_{j}_{s}" for j in ("slew", "boom", "stick") for s in "ab"]
    + ["true_p_pump"]
)


def initial(p: Namespace) -> dict[str, Any]:
    """At rest at the start pose: tool hanging, chambers in static equilibrium with gravity."""
    pitch, roll = multibody.hanging(multibody.gravity_in_s(p.start_q_slew, p))
    q = (p.start_q_slew, p.start_q_boom, p.start_q_stick, pitch, roll)
    hold = dynamics.holding_torques(q, p)
    values: dict[str, Any] = {v.name: 0.0 for v in STATES} | dict(zip(dynamics.ANGLES, q, strict=True))
    for i, joint in ((multibody.BOOM, "boom"), (multibody.STICK, "stick")):
        rest = cylinder.rest_pressures(hold[i], q[i], arm_hydraulics.parameters(p, joint))
        values[f"{joint}_pressure_a"], values[f"{joint}_pressure_b"] = rest
    values["slew_pressure_a"] = values["slew_pressure_b"] = p.slew_boost_pressure
    values["pump_pressure"] = p.pump_standby
    return values


MODEL = Model(
    name="machine",
    description="Reference machine: hydraulics on three joints, shared pump, spatial tool, sensors",
    kind="continuous",
    step=STEP,
    serves=SERVES,
    states=STATES,
    inputs=from_signals(*COMMANDS, *DISTURBANCES),
    outputs=from_signals(*OUTPUTS),
    parameters=from_parameters("geometry", "slew", "machine"),
    rhs=dynamics.rates,
    out=sensors.outputs,
    initial=initial,
    modes=(slew_drive.BRAKE,),
    delays={"u_slew": "slew_delay", "u_boom": "boom_valve_delay", "u_stick": "stick_valve_delay"},
    sensors=sensors.declarations(),
)
