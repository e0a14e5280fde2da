"""Loads of an axis that turns about the vertical: a slope under the machine, a payload on its arm."""

import casadi as ca

from reconcile.catalogue.effect import ANY, Effect, Namespace, Parameter, Result, none


def _slope(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(p.torque_sin * ca.sin(c.q) + p.torque_cos * ca.cos(c.q))


def _at_reach(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """(J + m r²) dv/dt = F − d(m r²)/dt v."""
    return Result(p.mass * c.reach2, force=-p.mass * c.reach2_rate * c.v)


def _extended(c: Namespace, p: Namespace, w: Namespace) -> Result:
    point = _at_reach(c, p, w)
    return Result(point.value + p.inertia, force=point.force)


def _varying(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """The model's constant inertia is right for one reach only, which `inertia` takes off."""
    point = _at_reach(c, p, w)
    return Result(point.value - p.inertia, force=point.force)


MASS = Parameter("mass", "kg", none, amplitude=True, low=ANY)

EFFECTS = (
    Effect(
        "slope_torque",
        "force",
        "F = torque_sin sin(q) + torque_cos cos(q)",
        (
            Parameter("torque_sin", "{f}", none, amplitude=True, low=ANY),
            Parameter("torque_cos", "{f}", none, amplitude=True, low=ANY),
        ),
        _slope,
        "Newtonian mechanics: weight along the slope times the distance of the centre of mass from the axis",
        needs=("rad", "upright"),
    ),
    Effect(
        "payload_mass",
        "inertia",
        "(J + mass r²) dv/dt + mass d(r²)/dt v = F",
        (MASS,),
        _at_reach,
        "Newtonian mechanics",
        needs=("reach2", "reach2_rate"),
        form="at_reach",
    ),
    Effect(
        "pose_dependent_inertia",
        "inertia",
        "(J + mass r² − inertia) dv/dt + mass d(r²)/dt v = F",
        (MASS, Parameter("inertia", "{inertia}", none, amplitude=True, low=ANY)),
        _varying,
        "Lagrangian mechanics",
        needs=("reach2", "reach2_rate"),
        form="at_reach",
    ),
    Effect(
        "payload_mass",
        "inertia",
        "(J + mass r² + inertia) dv/dt + mass d(r²)/dt v = F",
        # of the payload's own, so not below nothing; that tells it from an inertia stated for another reach
        (MASS, Parameter("inertia", "{inertia}", none, amplitude=True)),
        _extended,
        "Newtonian mechanics: Huygens-Steiner",
        needs=("reach2", "reach2_rate"),
        form="extended",
        becomes={"payload_mass": "inertia → 0"},
    ),
)
