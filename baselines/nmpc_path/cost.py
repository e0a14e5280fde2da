"""What a plan along a path is good for: each stage has its own place on the path and its own distances.

r_p     grab point off its place on the path: along the turn, outwards, upwards
r_t     tool rates (roll, pitch)
r_n     what a part of the machine is nearer to a thing than the distance to keep:
        max(0, keep - c - g (q - q_0)), with distance c and slope g about the pose q_0 that the last plan has
        for the stage (`field`)
r_end   at the end of the horizon also speed off the path's, and the swing left there
"""

from types import SimpleNamespace

import casadi as ca

from baselines.nmpc import prediction
from baselines.nmpc.cost import Cost
from fmus.equations import kinematics

POSE = ("slew", "boom", "stick", "pitch", "roll")  # what distances depend on, in the order of `specs.pose`
PLANES = 3  # nearest things that a stage knows of: two of the tool, one of the arm
SWING_RATE = 2.2  # 1/s: rate with which a swing of 1 rad goes through the middle
TOLD = ("load", "slew", "radius", "height", "speed", "place", "speed_weight", "tool", "swing", "near")
# of a step: where the way leads over a rim, only small ones are downhill at first
LENGTHS = (1.0, 0.5, 0.2, 0.05)
SIZE = len(TOLD) + PLANES * (1 + len(POSE))


def of_path() -> Cost:
    """Residuals of a stage are told `TOLD`, then of each plane `keep - c + g q_0` and g."""
    x, told = ca.SX.sym("x", len(prediction.STATES)), ca.SX.sym("told", SIZE)  # type: ignore[call-arg]
    r = _residual(x, told)
    residual = ca.Function("path_residual", [x, told], [ca.densify(r), ca.densify(ca.jacobian(r, x))])
    value = ca.Function("path_value", [x, told], [ca.sumsqr(r)])
    both = (False, True)  # the last stage is told other weights
    return Cost(dict.fromkeys(both, residual), dict.fromkeys(both, value), SIZE, staged=True, lengths=LENGTHS)


def _residual(x: ca.SX, told: ca.SX) -> ca.SX:
    now = SimpleNamespace(**{name: x[i] for i, name in enumerate(prediction.STATES)})
    t = SimpleNamespace(**{name: told[i] for i, name in enumerate(TOLD)})
    place, tool, swing, near = (ca.sqrt(w) for w in (t.place, t.tool, t.swing, t.near))
    p = prediction.figures()
    radius, height = kinematics.arm_tip(now.boom, now.stick, p)
    along = t.radius * (now.slew - t.slew) + (p.tool_length - p.grab_offset) * ca.sin(now.roll)
    out = radius - p.tool_length * ca.sin(now.pitch) - t.radius
    pose = ca.vertcat(*(getattr(now, name) for name in POSE))
    planes = ca.reshape(told[len(TOLD) :], 1 + len(POSE), PLANES)
    missing = planes[0, :].T - planes[1:, :].T @ pose
    return ca.vertcat(
        place * ca.vertcat(along, out, height - t.height),
        tool * ca.vertcat(now.roll_rate, now.pitch_rate),
        ca.sqrt(t.speed_weight) * (now.speed - t.speed),
        swing * SWING_RATE * ca.vertcat(now.roll, now.pitch),
        near * ca.fmax(missing, 0),
    )
