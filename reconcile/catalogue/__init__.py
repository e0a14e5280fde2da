"""The catalogue of effects: one small file a place; what the contract names and is not here is in MISSING."""

from reconcile.catalogue import couplings, forces, inertias, inputs, outputs
from reconcile.catalogue.effect import Effect, Scales

ALL: tuple[Effect, ...] = (
    *inputs.EFFECTS,
    *forces.EFFECTS,
    *inertias.EFFECTS,
    *couplings.EFFECTS,
    *outputs.EFFECTS,
)

MISSING = (
    "internal_leakage",
    "relief_limit",
    "shared_pump_flow",
    "supply_pressure_sag",
    "compressibility",
    "temperature_dependent_viscosity",
    "counterbalance_drop",
    "brake_engagement",
    "slope_torque",
    "pendulum_length_change",
    "coriolis_coupling",
    "centrifugal_coupling",
    "euler_coupling",
    "tool_reaction",
    "sensor_quantization",
)

__all__ = ["ALL", "MISSING", "Effect", "Scales"]
