"""Whether the slew speed is late behind the motor pressures: two delays, one product each.

    T, a  torque D (p_a - p_b) and acceleration, both behind a lag of 1/SMOOTH, less their slow part (SLOW)
    J_k' = (a(t) T(t - k) - J_k) / T_memory          k: 0 and LATE ticks

Torque is inertia times acceleration, whatever the inertia: T(t - k) is most like a(t) where k is how late
the speed is.  It counts as late where J_LATE is `nmpc_margin` times J_0: in starts and stops from 0.16 s on
(tests/baselines/test_nmpc.py).  A drive that answers late as a whole, pressures too, shows nothing here.
"""

from typing import Any

from fmus.definition import Namespace, Variable
from fmus.equations import slew_control as control

LATE = 4  # ticks
SMOOTH, SLOW = 4.0, 2.0  # 1/s: between them lie starts and stops, not noise nor friction
PRIOR = 5e-4  # rad/s2: what speaks for a speed that is not late, before anything moved
STATES = (
    Variable("smooth_torque", "1", "Torque of the motor behind a lag, over 50 kN m"),
    Variable("smooth_speed", "rad/s", "Slew speed behind the same lag"),
    Variable("steady_torque", "1", "Slow part of the torque behind the lag"),
    Variable("steady_turning", "rad/s2", "Slow part of the acceleration behind the lag"),
    *(Variable(f"torque_{i}", "1", f"Change of torque, {i + 1} ticks old") for i in range(LATE)),
    *(
        Variable(f"alike_{k}", "rad/s2", f"Likeness to the torque of {k} ticks before", start=start)
        for k, start in ((0, PRIOR), (LATE, 0.0))
    ),
)  # fmt: skip


def told(x: Namespace, u: Namespace, speed: Any, p: Namespace) -> dict[str, Any]:
    """Next `STATES`."""
    torque = p.control_displacement * (u.p_slew_a - u.p_slew_b) / control.LIVELY
    turning = SMOOTH * (speed - x.smooth_speed)
    torque_change, turning_change = x.smooth_torque - x.steady_torque, turning - x.steady_turning
    before = [torque_change, *(getattr(x, f"torque_{i}") for i in range(LATE))]
    alike = {k: getattr(x, f"alike_{k}") for k in (0, LATE)}
    share = control.STEP / p.nmpc_memory
    return {
        "smooth_torque": x.smooth_torque + control.STEP * SMOOTH * (torque - x.smooth_torque),
        "smooth_speed": x.smooth_speed + control.STEP * turning,
        "steady_torque": x.steady_torque + control.STEP * SLOW * torque_change,
        "steady_turning": x.steady_turning + control.STEP * SLOW * turning_change,
        **{f"torque_{i}": before[i] for i in range(LATE)},
        **{f"alike_{k}": alike[k] + share * (turning_change * before[k] - alike[k]) for k in (0, LATE)},
    }


def ticks(x: Namespace, p: Namespace) -> Any:
    """Ticks that a late speed asks for, 0 where it is not late."""
    return LATE * (getattr(x, f"alike_{LATE}") > p.nmpc_margin * x.alike_0)
