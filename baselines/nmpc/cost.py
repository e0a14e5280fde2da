"""What the plan is good for: residuals of a predicted state, whose squares the solver adds up.

r_e     slew error, pseudo-Huber: pulls evenly from afar, quadratic within `nmpc_huber`
r_t     tool rates (roll, pitch)
r_v     speed beyond the pace's limit
r_a     arm tip's joints off their targets, Huber too
r_end   the same at the end of the horizon, with speed and swing still left there
"""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import casadi as ca

from baselines.nmpc import prediction

TASK = (  # what the solver is told, beside the state; SI
    "load", "boom", "stick", "speed_limit", "error", "huber", "tool", "over", "arm", "arm_huber",
    "end_error", "end_speed", "end_tool", "step",
)  # fmt: skip
ARM_LIMIT = 0.2  # rad/s
STEP_WEIGHTS = (0.02, 2.0, 2.0)  # of the steps of opening (unless one is told), boom and stick reference
SIZE_WEIGHTS = (1e-4, 0.1, 0.1)
NX = len(prediction.STATES)


@dataclass(frozen=True)
class Cost:
    """What a plan is good for, as the solver takes it; each by whether the stage is the last.

    `residual`  (x, told) -> r, dr/dx: Gauss-Newton with the weights held
    `value`     (x, told) -> the stage's share of V
    `told`      numbers that each stage is told, the load first; `staged`: a column of them for each stage
    `lengths`   of a step, tried by roll-out
    `step`      which of the numbers told is the weight of the opening's steps; None: STEP_WEIGHTS
    """

    residual: dict[bool, ca.Function]
    value: dict[bool, ca.Function]
    told: int
    staged: bool = False
    lengths: tuple[float, ...] = (1.0, 0.5, 0.2)
    step: int | None = None

    def at(self, told: Any, k: int) -> Any:
        """What stage `k` is told."""
        return told[:, k] if self.staged else told


def of_target() -> Cost:
    """Of a target of slew, boom and stick."""
    residuals, values = {}, {}
    for last in (False, True):
        x, task = _symbols()
        r, weights = _weighted(x, task, last)
        slope = ca.diag(weights) @ ca.jacobian(r, x)
        name = "nmpc_end" if last else "nmpc_residual"
        residuals[last] = ca.Function(name, [x, task], [ca.densify(weights * r), ca.densify(slope)])
        terms = [_loss(error, width, weight) for error, width, weight in _terms(x, task, last)]
        values[last] = ca.Function(f"nmpc_{'end_' if last else ''}value", [x, task], [sum(terms, ca.SX(0))])
    return Cost(residuals, values, len(TASK), step=TASK.index("step"))


def _weighted(x: ca.SX, task: ca.SX, last: bool) -> tuple[ca.SX, ca.SX]:
    """Residuals and their weights' roots: a Huber loss as a quadratic with the weight of here and now."""
    errors, weights = [], []
    for error, width, weight in _terms(x, task, last):
        errors.append(error)
        loss = 1 if width is None else 1 / ca.sqrt(1 + (error / width) ** 2)
        weights.append(ca.sqrt(weight * loss))
    return ca.vertcat(*errors), ca.vertcat(*weights)


def _loss(error: Any, width: Any, weight: Any) -> Any:
    """weight e^2 or, with a width d, weight 2 d^2 (sqrt(1 + (e/d)^2) - 1)."""
    if width is None:
        return weight * error**2
    return weight * 2 * width**2 * (ca.sqrt(1 + (error / width) ** 2) - 1)


def _terms(x: ca.SX, task: ca.SX, last: bool) -> list[tuple[Any, Any, Any]]:
    """(error, Huber width or None, weight) of each residual; the slew target is at angle 0."""
    now = SimpleNamespace(**{name: x[i] for i, name in enumerate(prediction.STATES)})
    t = SimpleNamespace(**{name: task[i] for i, name in enumerate(TASK)})
    over = ca.fmax(ca.fabs(now.speed) - t.speed_limit, 0)
    boom, stick = now.boom - t.boom, now.stick - t.stick
    terms = [
        (now.slew, t.huber, t.end_error if last else t.error),
        (now.roll_rate, None, t.end_tool if last else t.tool),
        (now.pitch_rate, None, t.end_tool if last else t.tool),
        (over, None, t.over),
        (boom, t.arm_huber, t.arm),
        (stick, t.arm_huber, t.arm),
    ]
    if last:
        terms += [
            (now.speed, None, t.end_speed),
            (2.2 * now.roll, None, t.end_tool),  # rad/s: as fast as it would swing through the middle
            (2.2 * now.pitch, None, t.end_tool),
        ]
    return terms


def _symbols() -> tuple[ca.SX, ca.SX]:
    return ca.SX.sym("x", NX), ca.SX.sym("task", len(TASK))  # type: ignore[call-arg]
