"""Inertia that the model leaves out, at a force port: (J + added) dv/dt = J dv/dt of the model + force."""

import casadi as ca

from reconcile.catalogue.effect import ANY, Effect, Namespace, Parameter, Result, none


def _payload(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(p.inertia)


def _pose(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """The force beside it is what a varying inertia asks for: −½ dJ/dq v² (Lagrange)."""
    added = p.cosine * ca.cos(c.q) + p.sine * ca.sin(c.q)
    slope = -p.cosine * ca.sin(c.q) + p.sine * ca.cos(c.q)
    return Result(added, force=-0.5 * slope * c.v**2)


EFFECTS = (
    Effect(
        "payload_mass",
        "inertia",
        "(J + m) dv/dt = F",
        (Parameter("inertia", "{inertia}", none, amplitude=True),),
        _payload,
        "Newtonian mechanics",
    ),
    Effect(
        "pose_dependent_inertia",
        "inertia",
        "(J + cosine cos q + sine sin q) dv/dt + ½ J'(q) v² = F",
        (
            Parameter("cosine", "{inertia}", none, amplitude=True, low=ANY),
            Parameter("sine", "{inertia}", none, amplitude=True, low=ANY),
        ),
        _pose,
        "Lagrangian mechanics",
        needs=("rad",),
    ),
)
