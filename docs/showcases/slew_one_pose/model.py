"""The slew drive with the inertia of one pose: what `slew` is, less that its inertia follows the arm.

It keeps the connectors of `slew`, so that it takes its place in a system, and leaves `inertia` and
`inertia_rate` unread: the inertia is `slew_inertia_reference`, at which the slew's friction is stated.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from fmus.slew import model as slew

Namespace = Any


def _at_one_pose(u: Namespace, p: Namespace) -> Namespace:
    return SimpleNamespace(**(vars(u) | {"inertia": p.slew_inertia_reference, "inertia_rate": 0.0}))


def _rates(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> Mapping[str, Any]:
    return slew.MODEL.rhs(x, _at_one_pose(u, p), m, p)


# The ports are those of `slew`; `inertia` and its rate tell the reach of the arm there.
OWN = tuple(n for n in slew.PORTS["slew"]["has"] if n != "pose_dependent_inertia")
PORTS = slew.PORTS | {"slew": slew.PORTS["slew"] | {"has": OWN}}

MODEL = replace(slew.MODEL, description="Slew drive with the inertia of one pose", rhs=_rates)
