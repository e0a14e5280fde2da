"""The catalogue of effects: one small file a place; what the contract names and is not here is in MISSING."""

from reconcile.catalogue import forces, inertias, inputs, outputs
from reconcile.catalogue.effect import Effect, Scales

ALL: tuple[Effect, ...] = (*inputs.EFFECTS, *forces.EFFECTS, *inertias.EFFECTS, *outputs.EFFECTS)

MISSING = (
    "input_hysteresis",
    "internal_leakage",
    "relief_limit",
    "shared_pump_flow",
    "supply_pressure_sag",
    "compressibility",
    "temperature_dependent_viscosity",
    "counterbalance_drop",
    "brake_engagement",
    "slope_torque",
    "wind_load",
    "pendulum_length_change",
    "coriolis_coupling",
    "centrifugal_coupling",
    "euler_coupling",
    "tool_reaction",
    "structural_compliance",
    "gear_backlash",
    "sensor_quantization",
    "clock_drift",
)

__all__ = ["ALL", "MISSING", "Effect", "Scales"]
