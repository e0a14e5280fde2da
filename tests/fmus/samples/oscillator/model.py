"""A small model with one of everything the shim carries out: stiff state, delay, mode, sensor with noise."""

import casadi as ca

from fmus.definition import Mode, Model, Sensor, Variable

MODEL = Model(
    name="oscillator",
    description="Pendulum with friction, a fast follower, a delayed torque and a noisy late sensor",
    kind="continuous",
    step=0.002,
    serves=3,  # which does not divide the ten internal steps of a communication step
    states=(Variable("q", "rad"), Variable("v", "rad/s"), Variable("follower", "rad")),
    inputs=(Variable("torque", "N.m"), Variable("push", "N.m")),
    outputs=(
        Variable("angle", "rad"),
        Variable("measured", "rad"),
        Variable("moving", "1"),
        Variable("rate", "rad/s"),
    ),
    parameters=(
        Variable("start_angle", "rad", start=1.0, fixed=True),
        Variable("stiffness", "1/s2", start=4.0, min=0.0, max=100.0),
        Variable("friction", "rad/s2", start=0.1, min=0.0),
        Variable("torque_delay", "s", start=0.1, min=0.0, max=1.0),
        Variable("sensor_delay", "s", start=0.06, min=0.0, max=1.0),
        Variable("sensor_noise", "rad", start=0.01, min=0.0),
        Variable("switch_delay", "s", start=0.05, min=0.0),
    ),
    rhs=lambda x, u, m, p: {
        "q": x.v,
        "v": -p.stiffness * ca.sin(x.q)
        - p.friction * ca.tanh(x.v / 0.01)
        + u.torque
        + u.push
        - 0.3 * m.is_moving,
        "follower": 1000.0 * (x.q - x.follower),
    },
    out=lambda x, u, m, p: {"angle": x.q, "measured": x.follower, "moving": m.is_moving, "rate": x.v},
    initial=lambda p: {"q": p.start_angle, "v": 0.0, "follower": p.start_angle},
    modes=(
        Mode(
            "is_moving",
            on=lambda x, u, m, p: ca.fabs(x.v) - 0.1,
            off=lambda x, u, m, p: 0.05 - ca.fabs(x.v),
            on_delay="switch_delay",
            off_delay="switch_delay",
        ),
    ),
    delays={"torque": "torque_delay"},
    sensors={"measured": Sensor(delay="sensor_delay", noise="sensor_noise")},
)
