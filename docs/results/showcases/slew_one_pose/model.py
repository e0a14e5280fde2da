"""The slew drive with the inertia of one pose: what `slew` is, less that its inertia follows the arm.

It keeps the connectors of `slew`, so that it takes its place in a system.  What moves is always
`slew_inertia_reference`; the friction follows the load on the bearing as it does there, told by `inertia`.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from fmus.models.slew import model as slew

Namespace = Any


def _rates(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> Mapping[str, Any]:
    rates = slew.MODEL.rhs(x, u, m, p)
    torque = rates["qd"] * (u.inertia + p.slew_inertia_extra) + u.inertia_rate * x.qd
    return {**rates, "qd": torque / (p.slew_inertia_reference + p.slew_inertia_extra)}


# The ports are those of `slew`; `inertia` and its rate tell the reach of the arm there.
OWN = tuple(n for n in slew.PORTS["slew"]["has"] if n != "pose_dependent_inertia")
PORTS = slew.PORTS | {"slew": slew.PORTS["slew"] | {"has": OWN}}

MODEL = replace(slew.MODEL, description="Slew drive with the inertia of one pose", rhs=_rates)
