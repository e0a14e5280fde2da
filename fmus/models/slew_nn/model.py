"""The paper's slew model: pressure and velocity network with 1 s of history, weights as data.

    every 0.1 s   [p_l, p_r, omega][k] = F(u[k-9..k], p_l, p_r, omega[k-10..k-1], I[k-1])     (network.py)
    in between    p and omega on straight lines from k-1 to k,   q' = omega

The prediction for k is made at k-1, with the joystick of that instant as u[k]: a joystick that is held for
0.1 s gives the very roll-out of learning/slew/score.py.  If it moves in between, the history gets its mean,
as in training.  Histories start at zero (u, omega) and at `start_slew_pressure`.

Not of the networks: a disturbance torque T turns the carriage as a free rigid body, omega[k] += 0.1 T / I,
while the brake is released, and comes back to the networks by their history; `brake_released` is the mode of
fmus/equations/slew_drive.py on the joystick.  `inertia_rate` has no effect: the networks know I alone.
"""

from pathlib import Path
from typing import Any

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals
from fmus.equations import slew_drive
from fmus.models.slew_nn.network import HISTORY, PERIOD_S, SlewNetwork
from fmus.models.slew_nn.symbolic import predict

STEP = 0.02  # s
TICKS = round(PERIOD_S / STEP)  # of a prediction
WEIGHTS = Path(__file__).with_name("weights.npz")
CHANNELS = {  # name -> (length, unit, what, nominal); rows from old to new
    "u": (HISTORY - 1, "1", "Joystick", 1.0),
    "p_l": (HISTORY, "Pa", "Pressure of chamber b", 1e7),
    "p_r": (HISTORY, "Pa", "Pressure of chamber a", 1e7),
    "omega": (HISTORY, "rad/s", "Slew speed", 0.1),
}
BRAKE_TIMES = ("slew_brake_threshold", "slew_brake_release_time", "slew_brake_engage_time")


INERTIA_UNKNOWN = "inertia number not stated"


def of_network(network: SlewNetwork, name: str = "slew_nn", ahead: int = 0) -> Model:
    """The model with this network; same inputs and outputs as `slew`.

    A network whose speed is late is run `ahead` periods before the clock, on the present joystick for what is
    still to come: its speed is then that of the machine.
    """
    tick = _tick(network, ahead)
    unknown = f"; {INERTIA_UNKNOWN}" if network.inertia_map is None else ""
    return Model(
        name=name,
        description=f"Slew drive as pressure and velocity network (one step of 0.1 s ahead){unknown}",
        kind="discrete",
        step=STEP,
        states=(
            Variable("q", "rad", "Slew angle"),
            Variable("phase", "1", "Ticks since the last prediction, 0 to 4"),
            *(
                Variable(
                    f"{key}_{i}", unit, f"{what}, {(n - i) * PERIOD_S:.1f} s before the next", nominal=size
                )
                for key, (n, unit, what, size) in CHANNELS.items()
                for i in range(n)
            ),
        ),
        inputs=from_signals("u_slew", "inertia", "inertia_rate", "disturbance_torque_slew"),
        outputs=from_signals("q_slew", "qd_slew", "p_slew_a", "p_slew_b", "brake_released"),
        parameters=(
            *(v for v in from_parameters("geometry") if v.name == "start_q_slew"),
            *(v for v in from_parameters("slew") if v.name in BRAKE_TIMES),
            *from_parameters("slew_nn"),
        ),
        rhs=lambda x, u, m, p: _next_state(tick, x, u, m),
        out=_outputs,
        initial=_start,
        modes=(slew_drive.BRAKE,),
        symbolic="MX",
    )


def _next_state(tick: ca.Function, x: Namespace, u: Namespace, m: Namespace) -> dict[str, Any]:
    before = [_history(x, key) for key in CHANNELS]
    push = PERIOD_S * m.brake_is_released * u.disturbance_torque_slew / u.inertia
    after = dict(zip(CHANNELS, tick(x.phase < 0.5, x.phase, u.u_slew, u.inertia, push, *before), strict=True))
    phase = ca.if_else(x.phase > TICKS - 1.5, 0.0, x.phase + 1.0)
    speeds = _interpolated(before[-1], x.phase), _interpolated(after["omega"], phase)
    return {
        "q": x.q + STEP * (speeds[0] + speeds[1]) / 2,
        "phase": phase,
        **{f"{key}_{i}": after[key][i] for key in CHANNELS for i in range(CHANNELS[key][0])},
    }


def _tick(network: SlewNetwork, ahead: int) -> ca.Function:
    """(whether a prediction is due, phase, u_slew, inertia, push, histories) -> histories one tick later."""
    phase, u_slew, inertia, push = (ca.MX.sym(n) for n in ("phase", "u_slew", "inertia", "push"))
    u, p_l, p_r, omega = past = [ca.MX.sym(key, n) for key, (n, *_) in CHANNELS.items()]
    arguments = [phase, u_slew, inertia, push, *past]

    known = ca.vertcat(u[ahead:], ca.repmat(u_slew, ahead + 1, 1))
    left, right, speed = predict(network)(known, p_l, p_r, omega, inertia)
    newest = (u_slew, left, right, speed + push)
    moved = [ca.vertcat(old[1:], new) for old, new in zip(past, newest, strict=True)]
    due = ca.Function("due", arguments, moved)

    mean = u[-1] + (u_slew - u[-1]) / (phase + 1.0)  # over this prediction's ticks so far
    waiting = ca.Function("waiting", arguments, [ca.vertcat(u[:-1], mean), p_l, p_r, omega])
    return ca.Function.if_else("tick", due, waiting)


def _outputs(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    return {
        "q_slew": x.q,
        "qd_slew": _interpolated(_history(x, "omega"), x.phase),
        "p_slew_a": _interpolated(_history(x, "p_r"), x.phase),
        "p_slew_b": _interpolated(_history(x, "p_l"), x.phase),
        "brake_released": m.brake_is_released,
    }


def _interpolated(history: ca.MX, phase: ca.MX) -> ca.MX:
    """On the line from the last but one to the last value of a history, which is reached at phase 0."""
    share = ca.if_else(phase < 0.5, 1.0, phase / TICKS)
    return share * history[-1] + (1.0 - share) * history[-2]


def _history(x: Namespace, key: str) -> ca.MX:
    return ca.vertcat(*(getattr(x, f"{key}_{i}") for i in range(CHANNELS[key][0])))


def _start(p: Namespace) -> dict[str, Any]:
    pressures = {f"{key}_{i}": p.start_slew_pressure for key in ("p_l", "p_r") for i in range(HISTORY)}
    return {"q": p.start_q_slew, **pressures}


MODEL = of_network(SlewNetwork.load(WEIGHTS))
