"""The catalogue of effects: one small file a place; what the contract names and is not here is in MISSING.

Sensor quantization cannot be told by a fit; reconcile/quantization.py finds it in the values.
"""

from reconcile.catalogue import (
    couplings,
    forces,
    groups,
    hydraulics,
    inertias,
    inputs,
    loads,
    outputs,
    pendulum,
)
from reconcile.catalogue.effect import Effect, Scales

ALL: tuple[Effect, ...] = (
    *inputs.EFFECTS,
    *forces.EFFECTS,
    *inertias.EFFECTS,
    *couplings.EFFECTS,
    *hydraulics.EFFECTS,
    *loads.EFFECTS,
    *pendulum.EFFECTS,
    *groups.EFFECTS,
    *outputs.EFFECTS,
)

MISSING = ("tool_reaction",)

__all__ = ["ALL", "MISSING", "Effect", "Scales"]
