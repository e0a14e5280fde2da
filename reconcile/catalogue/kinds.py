"""Kinds of effects: recordings often tell the kind before they tell which effect of it it is."""

KINDS: dict[str, tuple[str, ...]] = {
    "friction": (
        "coulomb_friction",
        "asymmetric_coulomb_friction",
        "stribeck_friction",
        "viscous_friction",
        "asymmetric_viscous_friction",
        "load_dependent_friction",
        "quadratic_drag",
        "presliding_hysteresis",
        "internal_leakage",
        "speed_curve",
        "friction_curve",
    ),
    "load": ("constant_load", "gravity_load", "slope_torque", "wind_load", "input_offset"),
    "stiffness": ("stiffness", "cubic_stiffness", "end_stop", "position_curve"),
    "ripple": ("torque_ripple",),
    "delay": ("input_delay", "input_lag", "sensor_delay", "sensor_lag", "clock_drift", "input_rate_limit"),
    "input gain": (
        "input_dead_zone",
        "input_saturation",
        "asymmetric_gain",
        "valve_flow_curve",
        "input_crosstalk",
        "input_backlash",
        "input_hysteresis",
        "command_curve",
        "gain_curve",
    ),
    "sensor": (
        "sensor_bias",
        "sensor_scale",
        "sensor_nonlinearity",
        "sensor_drift",
        "sensor_backlash",
        "sensor_quantization",
        "cross_axis_misalignment",
        "absolute_value_sensor",
    ),
    "inertia": ("payload_mass", "pose_dependent_inertia", "pendulum_length_change"),
    "shaft": ("structural_compliance", "gear_backlash", "compressibility"),
    "supply": ("relief_limit", "shared_pump_flow", "supply_pressure_sag", "temperature_dependent_viscosity"),
}


def kind(name: str) -> str:
    """The kind of an effect; one that shares no kind is a kind of its own."""
    return next((k for k, names in KINDS.items() if name in names), name)
