"""The controller's optimisation: Gauss-Newton on the condensed problem, a fixed number of steps, no branch.

The plan z holds N openings and N / 2 velocity references for boom and stick each.  From the state x_0 at
which a new command acts, the states follow by single shooting, x_{k+1} = phi(x_k, u_k); it minimises

    V = sum_k |r(x_k)|^2 + |R z - d|^2        low <= z <= high

(r: `cost.py`; R: steps of the inputs).  One iteration: sensitivities G_k = dx_k/dz along the roll-out, then
the quadratic model 1/2 s'Hs + g's in the box by projected Newton (Bertsekas 1982), then the best of a few
step lengths by roll-outs: V never grows.  Converged: the last iteration gained next to nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from baselines.nmpc import cost, prediction
from baselines.nmpc.cost import Cost

STAGES = 20
STAGE_S = 0.2
SUBSTEPS = 4  # of a stage
HELD = 2  # stages that an arm reference is held for
ARM_STEPS = STAGES // HELD
SIZE = STAGES + 2 * ARM_STEPS
ITERATIONS = 4
NEWTON = 5  # steps of the projected Newton method
NX, NU = len(prediction.STATES), len(prediction.INPUTS)
NOT_SMOOTH = {"is_diff_in": [False] * 4, "is_diff_out": [False] * 3}


@dataclass(frozen=True)
class Stage:
    """One stage as CasADi functions: (x, u, load) -> x; with d/dx, d/du."""

    roll: ca.Function
    sensed: ca.Function


def stage() -> Stage:
    """The stage of `prediction` by SUBSTEPS steps, and its exact derivatives."""
    x, u, load = ca.SX.sym("x", NX), ca.SX.sym("u", NU), ca.SX.sym("load")  # type: ignore[call-arg]
    one = ca.cse(prediction.step(x, u, load, STAGE_S / SUBSTEPS))
    slopes = [ca.cse(m) for m in (ca.jacobian(one, x), ca.jacobian(one, u))]
    step = ca.Function("nmpc_step", [x, u, load], [one])
    sensed = ca.Function("nmpc_step_sensed", [x, u, load], [one, *slopes])
    at, by_x, by_u = x, ca.SX.eye(NX), ca.SX(NX, NU)
    end = x
    for _ in range(SUBSTEPS):
        end = step(end, u, load)
        at, a, b = sensed(at, u, load)
        by_x, by_u = a @ by_x, a @ by_u + b
    roll = ca.Function("nmpc_stage", [x, u, load], [end])
    results = [at, ca.densify(by_x), ca.densify(by_u)]
    return Stage(roll, ca.Function("nmpc_stage_sensed", [x, u, load], results))


def solver(aim: Cost | None = None) -> ca.Function:
    """(x_0, plan, given, task) -> (plan, gain of the last iteration relative to V, V).

    x_0 [13] where the plan begins; plan [SIZE] to begin with; given [3] inputs before the plan; task: what
    `aim` is told, that of a target without one.
    """
    own, aim = stage(), aim or cost.of_target()
    x0, plan, given, task = _arguments(aim)
    iteration, value = _iteration(own, aim), plan_cost(own, aim)
    z, before = plan, value(x0, plan, given, task)
    gain: Any = ca.MX(1)
    for _ in range(ITERATIONS):
        z, after = iteration(x0, z, given, task)
        gain, before = (before - after) / (after + 1e-9), after
    return ca.Function("nmpc_solve", [x0, plan, given, task], [z, gain, before], NOT_SMOOTH)


def inputs(plan: Any, k: int) -> Any:
    """Inputs [3] of stage `k`."""
    arm = STAGES + k // HELD
    return ca.vertcat(plan[k], plan[arm], plan[arm + ARM_STEPS])


def bounds() -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest plan [SIZE]."""
    limit = cost.ARM_LIMIT
    high = np.concatenate([np.ones(STAGES), np.full(2 * ARM_STEPS, limit)])
    return -high, high


def shifted(plan: Any) -> Any:
    """The plan half a stage later, the last inputs held."""
    parts = [plan[:STAGES], plan[STAGES : STAGES + ARM_STEPS], plan[STAGES + ARM_STEPS :]]
    shares = (0.5, 0.5 / HELD, 0.5 / HELD)
    return ca.vertcat(
        *(
            ca.vertcat((1 - s) * part[:-1] + s * part[1:], part[-1])
            for part, s in zip(parts, shares, strict=True)
        )
    )


def _iteration(own: Stage, aim: Cost) -> ca.Function:
    """(x_0, plan, given, task) -> (plan, V): one Gauss-Newton step, never uphill."""
    x0, plan, given, task = _arguments(aim)
    value = plan_cost(own, aim)
    steps, wanted = _steps(aim, task)
    miss = steps @ plan - wanted(given)
    hessian, gradient = steps.T @ steps, steps.T @ miss
    x, slope = x0, ca.MX.zeros(NX, SIZE)
    for k in range(STAGES):
        x, a, b = own.sensed(x, inputs(plan, k), task[0])
        slope = a @ slope + b @ _chosen(k)
        r, by_x = aim.residual[k == STAGES - 1](x, aim.at(task, k))
        by_plan = by_x @ slope
        hessian += by_plan.T @ by_plan
        gradient += by_plan.T @ r
    step = _box_newton()(hessian, gradient, plan)
    best, least = plan, value(x0, plan, given, task)
    for length in aim.lengths:
        tried = plan + length * step
        v = value(x0, tried, given, task)
        better = v < least
        best, least = ca.if_else(better, tried, best), ca.if_else(better, v, least)
    return ca.Function("nmpc_iteration", [x0, plan, given, task], [best, least])


def plan_cost(own: Stage, aim: Cost) -> ca.Function:
    """(x_0, plan, given, task) -> V by roll-out."""
    x0, plan, given, task = _arguments(aim)
    steps, wanted = _steps(aim, task)
    total, x = ca.sumsqr(steps @ plan - wanted(given)), x0
    for k in range(STAGES):
        x = own.roll(x, inputs(plan, k), task[0])
        total += aim.value[k == STAGES - 1](x, aim.at(task, k))
    return ca.Function("nmpc_value", [x0, plan, given, task], [total])


def _box_newton() -> ca.Function:
    """(H, g, plan) -> step s in the box about `plan` that minimises 1/2 s'Hs + g's nearly."""
    hessian, gradient = ca.MX.sym("H", SIZE, SIZE), ca.MX.sym("g", SIZE)  # type: ignore[call-arg]
    plan = ca.MX.sym("plan", SIZE)  # type: ignore[call-arg]
    low, high = (ca.DM(b) - plan for b in bounds())
    s: Any = ca.MX.zeros(SIZE)
    for _ in range(NEWTON):
        slope = gradient + hessian @ s
        at_low, at_high = (s <= low + 1e-9) * (slope > 0), (s >= high - 1e-9) * (slope < 0)
        free = 1 - ca.fmin(at_low + at_high, 1)
        mask = ca.diag(free)
        reduced = mask @ hessian @ mask + ca.diag(1 - free) + 1e-6 * ca.MX.eye(SIZE)
        newton = -ca.solve(ca.densify(reduced), free * slope, "ldl")
        s = _best(s, newton, low, high, hessian, gradient)
    return ca.Function("nmpc_box", [hessian, gradient, plan], [s])


def _best(s: Any, newton: Any, low: Any, high: Any, hessian: Any, gradient: Any) -> Any:
    """The projected step with the least quadratic model, of a few lengths."""
    best, least = s, ca.dot(gradient, s) + ca.dot(s, hessian @ s) / 2
    for length in (1.0, 0.5, 0.1):
        tried = ca.fmin(ca.fmax(s + length * newton, low), high)
        v = ca.dot(gradient, tried) + ca.dot(tried, hessian @ tried) / 2
        better = v < least
        best, least = ca.if_else(better, tried, best), ca.if_else(better, v, least)
    return best


def _chosen(k: int) -> ca.DM:
    """[3, SIZE]: which parts of the plan the inputs of stage `k` are."""
    matrix = np.zeros((NU, SIZE))
    for row, column in enumerate((k, STAGES + k // HELD, STAGES + ARM_STEPS + k // HELD)):
        matrix[row, column] = 1.0
    return ca.DM(matrix)


def _steps(aim: Cost, task: Any) -> tuple[Any, Callable[[Any], Any]]:
    """R of the inputs' steps and sizes, weighted, and d from the inputs given before the plan."""
    rows, firsts, weights = [], [], list[Any]()
    of_opening = cost.STEP_WEIGHTS[0] if aim.step is None else task[aim.step]
    for start, count, weight, own in (
        (0, STAGES, of_opening, cost.SIZE_WEIGHTS[0]),
        (STAGES, ARM_STEPS, cost.STEP_WEIGHTS[1], cost.SIZE_WEIGHTS[1]),
        (STAGES + ARM_STEPS, ARM_STEPS, cost.STEP_WEIGHTS[2], cost.SIZE_WEIGHTS[2]),
    ):
        for i in range(count):
            row = np.zeros(SIZE)
            row[start + i] = 1.0
            size = row.copy()
            if i:
                row[start + i - 1] = -1.0
            rows += [row, size]
            weights += [weight, own]
            channel = (0, 1, 2)[(start >= STAGES) + (start >= STAGES + ARM_STEPS)]
            firsts += [channel if i == 0 else None, None]
    scale = ca.diag(ca.sqrt(ca.vertcat(*weights)))
    picked = np.zeros((len(rows), NU))
    for i, channel in enumerate(firsts):
        if channel is not None:
            picked[i, channel] = 1.0
    matrix, first = (scale @ ca.sparsify(ca.DM(m)) for m in (np.array(rows), picked))
    return matrix, lambda given: first @ given


def _arguments(aim: Cost) -> tuple[Any, Any, Any, Any]:
    sizes = (
        ("x0", NX, 1),
        ("plan", SIZE, 1),
        ("given", NU, 1),
        ("task", aim.told, STAGES if aim.staged else 1),
    )
    return tuple(ca.MX.sym(name, rows, columns) for name, rows, columns in sizes)  # type: ignore[return-value]
