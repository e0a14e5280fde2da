"""Effects with a memory: what they show now, how the memory moves, and its exact step in models with steps.

Each gives (value, Result fields `rates`, `next`) for one hidden state.  On a model in steps the value is the
memory after the step that the present target makes: a held target is followed at once, as at a sampler.
`c.averaged`: the value is the mean over the step instead; `c.slope`: first and second derivative by time of a
target that moves on.
"""

from typing import Any

import casadi as ca

from reconcile.catalogue import smooth
from reconcile.catalogue.effect import Namespace, Result

Scalar = Any
ANYWHERE = 0.29  # of a gap: standard deviation of what lies anywhere in it


def lag(c: Namespace, target: Scalar, name: str, state: Scalar, time: Scalar) -> Result:
    """First order: time dw/dt = target - w; over a step with the target held, by exp(-step/time)."""
    if c.step is None:
        return Result(state, {name: (target - state) / time}, {name: target})
    kept = ca.exp(-c.step / time)
    after = state + (1.0 - kept) * (target - state)
    if c.slope is not None:  # the target went up to here in a parabola
        slope, bend = c.slope(target)
        after += slope * (c.step * kept - time * (1.0 - kept))
        after += bend * (time**2 - kept * (0.5 * c.step**2 + time * c.step + time**2))
    value = target + (state - target) * (1.0 - kept) * time / c.step if c.averaged else after
    return Result(value, starts={name: target}, next={name: after})


def play(c: Namespace, target: Scalar, name: str, state: Scalar, gap: Scalar) -> Result:
    """Play of full width `gap`; continuous: once the gap is used up, followed within c.width seconds."""
    # a rounded kink would creep back within the gap
    pushed = ca.fmax(target - state - 0.5 * gap, 0.0) - ca.fmax(state - target - 0.5 * gap, 0.0)
    if c.step is None:
        # what is pushed ahead of the memory is shown as well: else a gap is wider, by twice v c.width
        return Result(state + pushed, {name: pushed / c.width}, {name: target})
    return Result(state + pushed, starts={name: target}, next={name: state + pushed})


def rate_limit(c: Namespace, target: Scalar, name: str, state: Scalar, rate: Scalar) -> Result:
    """dw/dt = rate sgn(target - w), reached within c.width seconds; over a step, at most rate times step."""
    if c.step is None:
        speed = ca.fmin(ca.fmax((target - state) / c.width, -rate), rate)
        return Result(state + c.width * speed, {name: speed}, {name: target})
    most = rate * c.step
    after = state + ca.fmin(ca.fmax(target - state, -most), most)
    moving = ca.fmin(ca.fabs(target - state) / most, 1.0)  # share of the step
    value = 0.5 * (state + after) * moving + after * (1.0 - moving) if c.averaged else after
    return Result(value, starts={name: target}, next={name: after})


def bristle(c: Namespace, name: str, state: Scalar, distance: Scalar) -> Result:
    """Dahl's: distance dz/dt = v - |v| z; over a step with v held, z tends to sgn v exponentially."""
    way, side = smooth.magnitude(c.v, c.width), smooth.sign(c.v, c.width)
    if c.step is None:
        return Result(state, {name: (c.v - way * state) / distance}, {name: side})
    after = side + (state - side) * ca.exp(-way * c.step / distance)
    return Result(after, starts={name: side}, next={name: after})
