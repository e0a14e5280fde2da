"""The catalogue of effects: one small file a place.

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
    reactions,
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
    *reactions.EFFECTS,
    *groups.EFFECTS,
    *outputs.EFFECTS,
)

__all__ = ["ALL", "Effect", "Scales"]
